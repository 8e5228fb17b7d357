"""Vehicles on wheels, and the rooms they drive in."""
