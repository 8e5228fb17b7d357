"""x."""


def view() -> None:
    """X."""
