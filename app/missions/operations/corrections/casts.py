"""A mission's sound speed casts: added, replaced, removed, and the rule by which pings find theirs."""

import re
from collections.abc import Callable, Iterable, Sequence

from pydantic import ValidationError

from app.missions.errors import CastNotFoundError, ConflictError, InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections.recorrection import (
    check_casts,
    check_none_applied,
    correct_by,
    corrections_view,
)
from app.missions.soundings.corrections import ASSUMED_MPS
from app.missions.spec.base import FieldError
from app.missions.spec.water import Cast, CastDescription, CastRules, NewCasts, SoundSpeed
from app.missions.views.measurements.corrections import CorrectionsView
from app.missions.views.mission import Level

FieldOf = Callable[[str], str]
"""From a field of :class:`SoundSpeed`, for example ``further.0.time``, to the one of the request that says it."""


def _last_part(field: str) -> str:
    return field.rpartition(".")[2]


async def set_cast(live: LiveMission, name: str, cast: CastDescription, actor: str) -> CorrectionsView:
    """Add a cast, or replace the one of this name: every sounding is corrected anew. Raises InvalidRequestError."""
    try:
        named = Cast(**cast.model_dump(), name=name)
    except ValidationError as error:
        raise _refused(error, _last_part) from None
    return await _put(live, NewCasts(casts=[named]), actor, lambda _: _last_part)


async def add_casts(live: LiveMission, new: NewCasts, actor: str) -> CorrectionsView:
    """Add casts to those that there are, or replace those of their names, all or none of them.

    Raises
    ------
    InvalidRequestError, ConflictError
        Where one cannot be taken; where another speed is set in the sonars for the casts that there are.
    """

    def in_request(casts: Sequence[Cast]) -> FieldOf:
        numbers = {id(cast): number for number, cast in enumerate(new.casts)}

        def field_of(field: str) -> str:
            further = re.fullmatch(r"further\.(\d+)\.(.+)", field)
            place, part = (int(further[1]) + 1, further[2]) if further else (0, field)
            number = numbers.get(id(casts[place]))
            return "casts" if number is None or part == "further" else f"casts.{number}.{part}"

        return field_of

    return await _put(live, new, actor, in_request)


async def _put(
    live: LiveMission, new: NewCasts, actor: str, field_of: Callable[[Sequence[Cast]], FieldOf]
) -> CorrectionsView:
    """Add casts or replace those of their names; ``field_of`` names the fields of all that there are then."""
    async with live.correcting:
        speed = live.spec.sound_speed
        if speed is not None and new.assumed_mps not in (None, speed.assumed_mps):
            raise ConflictError(
                f"{speed.assumed_mps:g} m/s is set in the sonars for the casts that there are, not {new.assumed_mps:g}",
                "leave assumed_mps out, or change it for all casts: PUT /api/v1/missions/{id}/sound-speed",
            )
        known = _casts_of(live)
        names = {cast.name for cast in known}
        replaced = {cast.name: cast for cast in reversed(new.casts) if cast.name in names}
        added = [cast for cast in new.casts if replaced.get(cast.name) is not cast]
        casts = [*(replaced.get(cast.name, cast) for cast in known), *added]
        await _correct_with(live, casts, speed or CastRules(), new.assumed_mps, field_of(casts))
    done = [_named(cast.name for cast in added) + " added"] if added else []
    done += [_named(replaced) + " replaced"] if replaced else []
    await live.journal.log(Level.INFO, "corrections", f"{', '.join(done)} by {actor}", actor=actor)
    return corrections_view(live)


def _named(names: Iterable[str]) -> str:
    listed = [repr(name) for name in names]
    return f"sound speed cast{'s' if len(listed) > 1 else ''} {', '.join(listed)}"


async def remove_cast(live: LiveMission, name: str, actor: str) -> CorrectionsView:
    """Remove a cast; without the last one the sonars' own ranges are taken. Raises CastNotFoundError."""
    async with live.correcting:
        known = _casts_of(live)
        left = [one for one in known if one.name != name]
        if len(left) == len(known):
            listed = ", ".join(repr(one.name) for one in known) or "none"
            raise CastNotFoundError(f"the mission has no sound speed cast {name!r}", f"It has these: {listed}")
        await _correct_with(live, left, live.spec.sound_speed or CastRules())
    await live.journal.log(Level.INFO, "corrections", f"sound speed cast {name!r} removed by {actor}", actor=actor)
    return corrections_view(live)


async def set_cast_rule(live: LiveMission, rules: CastRules, actor: str) -> CorrectionsView:
    """Choose casts by another rule. Raises ConflictError, InvalidRequestError."""
    async with live.correcting:
        known = _casts_of(live)
        if not known:
            raise ConflictError(
                "the mission has no sound speed cast yet", "Add one first: PUT …/sound-speed/casts/NAME"
            )
        await _correct_with(live, known, rules)
    words = f"sound speed casts are taken {rules.rule.spoken}, set by {actor}"
    await live.journal.log(Level.INFO, "corrections", words, actor=actor)
    return corrections_view(live)


def _casts_of(live: LiveMission) -> Sequence[Cast]:
    return () if live.spec.sound_speed is None else live.spec.sound_speed.casts


async def _correct_with(
    live: LiveMission,
    casts: Sequence[Cast],
    rules: CastRules,
    assumed_mps: float | None = None,
    field_of: FieldOf = _last_part,
) -> None:
    """Correct all soundings by some casts; ``assumed_mps`` counts for first ones. Raises InvalidRequestError.

    Where it raises, nothing has changed.
    """
    sound_speed = None
    if casts:
        known = live.spec.sound_speed
        assumed = known.assumed_mps if known is not None else assumed_mps
        try:
            sound_speed = SoundSpeed.of(casts, rules, ASSUMED_MPS if assumed is None else assumed)
        except ValidationError as error:
            raise _refused(error, field_of) from None
        try:
            check_casts(live, sound_speed)
        except InvalidRequestError as error:
            raise InvalidRequestError(field_of(error.field), str(error), error.remedy) from None
        await check_none_applied(live)
    await correct_by(live, live.spec.model_copy(update={"sound_speed": sound_speed}))


def _refused(error: ValidationError, field_of: FieldOf) -> InvalidRequestError:
    """Return what is wrong with one cast beside the others, by the field of the request that says it."""
    first = error.errors()[0]
    reason = first.get("ctx", {}).get("error")
    words, _, advice = str(first["msg"]).removeprefix("Value error, ").rpartition(": ")
    field = reason.field if isinstance(reason, FieldError) else ".".join(map(str, first["loc"]))
    return InvalidRequestError(field_of(field), words or advice, advice)
