"""Sensors, simulated and real."""
