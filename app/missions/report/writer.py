"""Values of answers in the words and numbers of a report's language."""

import math

from app.missions.report.answers import Answers, as_value
from app.missions.report.document import Shown
from app.missions.report.texts import NONE, Texts
from imc_bridge.printable import printable


class Writer:
    """Puts values of answers into words.

    Parameters
    ----------
    answers
    texts
        Words and numbers of the report's language.
    """

    def __init__(self, answers: Answers, texts: Texts) -> None:
        self.answers = answers
        self.t = texts

    def number(self, source: str, decimals: int = 0, unit: str = "", *, signed: bool = False) -> Shown:
        """Return the number at a place of an answer."""
        value = self.answers.at(source)
        return Shown(self.t.number(value, decimals, unit, signed=signed), source, as_value(value))

    def share(self, source: str, unit: str = "%") -> Shown:
        """Return the percentage at a place of an answer, rounded down: 99.96 % of the cells is not all of them."""
        value = self.answers.at(source)
        floored = None if value is None else math.floor(round(10.0 * value, 6)) / 10.0
        return Shown(self.t.number(floored, 1, unit), source, as_value(value))

    def moment(self, source: str) -> Shown:
        """Return the time at a place of an answer."""
        value = self.answers.at(source)
        return Shown(self.t.moment(value), source, as_value(value))

    def string(self, source: str, *, mono: bool = False) -> Shown:
        """Return the text at a place of an answer, fit to be shown."""
        value = self.answers.at(source)
        return Shown(printable(str(value or "")).strip() or NONE, source, as_value(value), mono)

    def word(self, group: str, source: str) -> Shown:
        """Return the word for the value of an enumeration at a place of an answer."""
        value = self.answers.at(source)
        return Shown(NONE if value is None else self.t.of(group, value), source, as_value(value))

    def left_off(self, shown: int, of: int, name: str = "") -> str:
        """Return what is said where a table has no place for all rows; ``name`` is the file that has them."""
        if of <= shown:
            return ""
        count = self.t.number(of - shown)
        return self.t("left_off_file", count=count, file=name) if name else self.t("left_off", count=count)

    def order(self, name: str) -> str:
        """Return the name of an order of S-44."""
        return self.t(f"order_{name}")

    @property
    def is_search(self) -> bool:
        """Whether something was searched for."""
        return self.answers.at("mission.progress.search") is not None

    @property
    def is_swath(self) -> bool:
        """Whether swath sonars measured."""
        return self.answers.at("mission.progress.ensonified_pct") is not None
