"""Words in messages and printed results."""


def counted(number: int, singular: str, plural: str | None = None) -> str:
    """A number of things, as in "1 root" and "2 roots"."""
    return f"{number} {singular if number == 1 else plural or singular + 's'}"
