"""Texts in the cells of CSV files, which people open with spreadsheets."""

from imc_bridge.printable import printable

_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet takes for a formula begins with one of these."""


def text_cell(value: object) -> object:
    """Return a cell that is shown as the text it is: no formula, no control character. What is no text stays.

    Numbers are no texts: only free text may be given as such.
    """
    if not isinstance(value, str):
        return value
    shown = printable(value)
    return f"'{shown}" if value.lstrip()[:1] in _FORMULAS or value[:1] in _FORMULAS else shown
