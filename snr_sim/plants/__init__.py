"""Simulated physics behind the devices. Plants implement `Plant` of `prelude/plant.py` and know only that interface."""
