"""The underwater vehicle, its parts, its water, its pool."""
