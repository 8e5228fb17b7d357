"""The physics that answers the devices. A plant keeps the promise of `prelude/plant.py` and knows nobody else."""
