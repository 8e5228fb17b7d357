"""x."""


def resim() -> None:
    """X."""
