"""Recorded runs in rerun, and as pictures."""
