"""The report of ``bathyfleet evaluate generalize`` as Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.evaluation.generalize.summary import Run, summary_of
from app.evaluation.generalize.tasks import TASKS

INTRODUCTION = """\
Sea floors of families that no planner is developed on (`simulator/floors/unseen_floors.py`), each drawn by its seed:
development looks at even seeds, odd ones are reported. Means ± half their 95 % interval (Student) over floors; less is
better. *Figure* is the ratio to the yardstick where that was flown on the same floor, else what was left.
*Difference* is ours less the yardstick's, floor by floor, in the unit of what is compared. *Within* counts the floors
that are within what is asked. How to run it and how to read it: [On unseen floors](../generalization.md)."""


def markdown(
    runs: Mapping[str, Sequence[Run]], facts: Mapping[str, str], lacking: int, pictures: Mapping[str, str]
) -> str:
    """Return the report of the runs by task; ``lacking`` runs were asked for and are not there."""
    lines = ["# On unseen floors", ""]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    lines += [f"- **incomplete**: {lacking} runs are still missing"] if lacking else []
    lines += ["", INTRODUCTION, "", "| task | compared | yardstick | floors | figure | least, greatest | difference | "
              "asked | within |", "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    told = {name: summary_of(TASKS[name], runs[name]) for name in TASKS if runs.get(name)}
    for name, of in told.items():
        task, paired = TASKS[name], of["difference"]
        lines.append(
            f"| {name} | {task.figure} | {task.yardstick} | {of['floors']} | {of['mean']:.3g} ± {of['ci95']:.2g} | "
            f"{of['least']:.3g}, {of['greatest']:.3g} | {paired['mean']:+.3g} ± {paired['ci95']:.2g} | {task.asked} | "
            f"{of['kept']} of {of['floors']} |"
        )
    if len(told) > 0:
        lines += ["", "## By family", "", "Means of the figure.", "", *_families(told)]
    for name, of in told.items():
        lines += ["", f"## {name}: the worst floors", ""]
        if name in pictures:
            lines += [f"![{name}]({pictures[name]})", "", "Lines: vehicles. Black: what was left.", ""]
        lines += _worst(of["worst"])
        lines += ["", *_facts(runs[name]), *_yardstick_done(of)]
    return "\n".join(lines)


def _families(told: Mapping[str, Mapping[str, Any]]) -> list[str]:
    families = sorted({family for of in told.values() for family in of["families"]})
    lines = [f"| family | {' | '.join(told)} |", "| --- |" + " --- |" * len(told)]
    for family in families:
        cells = [f"{of['families'][family]:.3g}" if family in of["families"] else "–" for of in told.values()]
        lines.append(f"| {family} | {' | '.join(cells)} |")
    return lines


def _worst(worst: Sequence[Mapping[str, Any]]) -> list[str]:
    names = list(worst[0])
    lines = [f"| {' | '.join(name.replace('_', ' ') for name in names)} |", "|" + " --- |" * len(names)]
    for row in worst:
        cells = (str(row[n]) if isinstance(row.get(n), str) else f"{row[n]:.3g}" if n in row else "–" for n in names)
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _yardstick_done(of: Mapping[str, Any]) -> list[str]:
    done = of["yardstick_done"]
    if done is None:
        return []
    paired, never = done["difference"], of["floors"] - done["floors"]
    return [
        "",
        f"On {never} of {of['floors']} floors the yardstick did not get there and counts one step more than it had. "
        f"On the other {done['floors']} the figure is {done['mean']:.3g} ± {done['ci95']:.2g}, "
        f"the difference {paired['mean']:+.3g} ± {paired['ci95']:.2g}.",
    ]


def _facts(runs: Sequence[Run]) -> list[str]:
    names = list(dict.fromkeys(name for run in runs for name in run["facts"]))
    means = [(n, [run["facts"][n] for run in runs if n in run["facts"]]) for n in names]
    if not means:
        return []
    said = [f"{n.replace('_', ' ')} {sum(v) / len(v):.3g} ({min(v):.3g} to {max(v):.3g})" for n, v in means]
    return [f"Over all floors, mean (least to greatest): {'; '.join(said)}."]
