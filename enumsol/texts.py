"""Words in messages and printed results."""


def counted(number: int, singular: str, plural: str | None = None) -> str:
    """A number of things, as in "1 root" and "2 roots"."""
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def shortened(text: str, most: int = 200) -> str:
    """A text of another package in one line, cut off where it is longer: some quote whole files."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[: most - 3] + "..."
