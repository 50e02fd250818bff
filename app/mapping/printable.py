"""Text that may stand in every kind of file."""


def printable(text: str) -> str:
    """Return the text without control characters, which XML cannot hold, and in one line."""
    return "".join(letter if letter.isprintable() else " " for letter in text).strip()
