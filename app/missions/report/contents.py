"""What stands in a report, and in which order.

A further section is a function of one of ``sections`` that returns its blocks, none where there is nothing to say, and
an entry of ``SECTIONS``; its title is the text ``section_`` and its name.
"""

from collections.abc import Callable, Mapping

from app.missions.report.answers import Answers
from app.missions.report.document import Block, Document, Section
from app.missions.report.sections import corrections, crosslines, maps, mission, records, s44, uncertainty
from app.missions.report.texts import Texts
from app.missions.report.writer import Writer

SECTIONS: Mapping[str, Callable[[Writer], list[Block]]] = {
    "purpose": mission.purpose,
    "place": mission.place,
    "times": mission.times,
    "vehicles": mission.vehicles,
    "corrections": corrections.corrections,
    "map": maps.depths,
    "density": maps.density,
    "holidays": maps.holidays,
    "uncertainty": uncertainty.uncertainty,
    "crosslines": crosslines.crosslines,
    "s44": s44.s44,
    "rejected": records.rejected,
    "incidents": records.incidents,
    "files": records.files,
    "repeat": records.repeat,
}
"""What stands in a report, in its order."""


def document_of(answers: Answers, texts: Texts) -> Document:
    """Return the report of a mission."""
    w = Writer(answers, texts)
    name = answers.snapshot.facts.title
    found = ((section, make(w)) for section, make in SECTIONS.items())
    made = texts.moment(float(answers.made_s))
    return Document(
        language=texts.language,
        title=f"{texts('title')}: {name}",
        subtitle=texts("subtitle", made=made, version=answers.versions.get("bathyfleet", "")),
        author=answers.authority or "bathyfleet",
        footer=f"{made} · {name}",
        made_s=answers.made_s,
        words={word: texts(f"word_{word}") for word in ("page", "contents", "figure", "table")},
        sections=[Section(section, texts(f"section_{section}"), blocks) for section, blocks in found if blocks],
    )
