"""A program that typesets one document and ends: the typesetter keeps memory of all that it has set.

It reads JSON (``sources`` by name, ``fonts``: a folder, ``timestamp``) and writes the PDF. It imports nothing of ours.
"""

import json
import sys


def main() -> None:
    """Read a document, write its PDF."""
    import typst

    asked = json.load(sys.stdin.buffer)
    sources = {name: text.encode() for name, text in asked["sources"].items()}
    fonts = typst.Fonts(include_system_fonts=True, font_paths=[asked["fonts"]])
    sys.stdout.buffer.write(
        typst.compile(sources, format="pdf", font_paths=fonts, timestamp=asked["timestamp"])  # type: ignore[call-overload]
    )


if __name__ == "__main__":
    main()
