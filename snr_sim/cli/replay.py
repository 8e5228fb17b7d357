"""x."""


def replay() -> None:
    """X."""
