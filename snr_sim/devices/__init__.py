"""Simulated and real devices behind the same interfaces, and the loops that drive them."""
