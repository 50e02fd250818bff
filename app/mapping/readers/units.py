"""Units of length that files state for their depths."""

from app.mapping.readers.types import ReadError

FOOT_M, US_FOOT_M = 0.3048, 1200.0 / 3937.0

_METRES = {
    1.0: ("m", "metre", "metres", "meter", "meters"),
    0.1: ("dm", "decimetre", "decimetres", "decimeter", "decimeters"),
    0.01: ("cm", "centimetre", "centimetres", "centimeter", "centimeters"),
    0.001: ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
    1000.0: ("km", "kilometre", "kilometres", "kilometer", "kilometers"),
    FOOT_M: ("ft", "foot", "feet", "international_foot", "international_feet"),
    US_FOOT_M: ("us-ft", "ftus", "us_survey_foot", "us_survey_feet"),
    6.0 * FOOT_M: ("fathom", "fathoms"),
}
METRES_IN = {name: metres for metres, names in _METRES.items() for name in names}
"""How many metres a unit has, by its name in small letters, words joined by underscores."""


def known_metres_in(unit: object) -> float | None:
    """Return how many metres a unit has; None for what is not known as one of length."""
    return METRES_IN.get(_name(unit))


def metres_in(unit: object, where: str) -> float:
    """Return how many metres a unit has; nothing said: metres.

    Raises
    ------
    ReadError
        When it is no unit of length, or one that is not known; ``where`` has it.
    """
    found = known_metres_in(unit) if _name(unit) else 1.0
    if found is None:
        raise ReadError(where, "its unit is no known one of length", "write depths in metres, with the unit m")
    return found


def _name(unit: object) -> str:
    return "_".join(str(unit or "").lower().split())
