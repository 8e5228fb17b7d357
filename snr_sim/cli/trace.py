"""x."""


def trace() -> None:
    """X."""
