"""A mission's sound speed casts one by one: added, replaced, removed, and the rule by which pings find theirs."""

from collections.abc import Sequence

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
from app.missions.spec.water import Cast, CastDescription, CastRules, SoundSpeed
from app.missions.views.measurements.corrections import CorrectionsView
from app.missions.views.mission import Level


async def set_cast(live: LiveMission, name: str, cast: CastDescription, actor: str) -> CorrectionsView:
    """Add a cast, or replace the one of this name: every sounding is corrected anew. Raises InvalidRequestError."""
    try:
        named = Cast(**cast.model_dump(), name=name)
    except ValidationError as error:
        raise _refused(error) from None
    async with live.correcting:
        known = _casts_of(live)
        kept = [named if one.name == name else one for one in known]
        replaces = any(one.name == name for one in known)
        await _correct_with(live, kept if replaces else [*kept, named], live.spec.sound_speed or CastRules())
    words = f"sound speed cast {name!r} {'replaced' if replaces else 'added'} by {actor}"
    await live.journal.log(Level.INFO, "corrections", words, actor=actor)
    return corrections_view(live)


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


async def _correct_with(live: LiveMission, casts: Sequence[Cast], rules: CastRules) -> None:
    """Correct all soundings by some casts. Raises InvalidRequestError, with nothing changed."""
    sound_speed = None
    if casts:
        known = live.spec.sound_speed
        try:
            sound_speed = SoundSpeed.of(casts, rules, ASSUMED_MPS if known is None else known.assumed_mps)
        except ValidationError as error:
            raise _refused(error) from None
        check_casts(live, sound_speed)
        await check_none_applied(live)
    await correct_by(live, live.spec.model_copy(update={"sound_speed": sound_speed}))


def _refused(error: ValidationError) -> InvalidRequestError:
    """Return what is wrong with one cast beside the others, by the field of the request that says it."""
    first = error.errors()[0]
    reason = first.get("ctx", {}).get("error")
    words, _, advice = str(first["msg"]).removeprefix("Value error, ").rpartition(": ")
    field = reason.field if isinstance(reason, FieldError) else ".".join(map(str, first["loc"]))
    return InvalidRequestError(field.rpartition(".")[2], words or advice, advice)
