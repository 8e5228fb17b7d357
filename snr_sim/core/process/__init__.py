"""Loops in processes of their own: how they are started, what they exchange with their node."""
