"""What is right; wherever the lab goes, to a cluster or a container, this goes with it."""


def twice(x):
    """Return what `double` must return."""
    return x + x
