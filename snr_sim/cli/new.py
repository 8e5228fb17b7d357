"""x."""


def new() -> None:
    """X."""
