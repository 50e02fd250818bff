"""Mountings that are known are found from lines over known floors; what lines do not tell is not made up."""

import math

import numpy as np
import pytest

from app.mapping.swath.mounting import STRAIGHT, Mounting
from app.mapping.swath.patch_test import PARAMETERS, Known, LineErrors, MountingEstimate, NoOverlapError, NotWantedError
from app.mapping.swath.pings import Pings
from tests.support.mapping.patch_lines import (
    FRAME,
    PATCH,
    THERE_AND_BACK,
    Errors,
    bumpy,
    flat,
    lines,
    slope,
    told,
)

ASKEW = Mounting(math.radians(1.5), math.radians(-2.0), math.radians(2.5), 0.3, (0.5, 0.1, 0.2))
UNTURNED = Mounting(offset_m=ASKEW.offset_m)
"""What is stated of that sonar: its lever arm alone."""


def known(found: MountingEstimate) -> set[str]:
    return {name for name, one in found.parameters.items() if one.known is Known.DETERMINED}


def off(found: MountingEstimate, real: Mounting) -> dict[str, float]:
    """How many deviations what was found is from the truth."""
    return {
        name: abs(one.value - getattr(real, name)) / one.sd
        for name, one in found.parameters.items()
        if one.value is not None and one.sd is not None
    }


def test_a_flat_floor_tells_of_roll_alone_and_nothing_is_made_up_of_the_rest() -> None:
    found = told(lines(flat, ASKEW, THERE_AND_BACK, seed=0), UNTURNED)
    assert known(found) == {"roll_rad"}
    assert off(found, ASKEW)["roll_rad"] < 3.0
    rest = [found.parameters[name] for name in PARAMETERS[1:]]
    assert all((one.value, one.sd, one.proposed) == (None, None, False) for one in rest)
    assert found.proposal is not None
    assert (found.proposal.pitch_rad, found.proposal.offset_m) == (0.0, ASKEW.offset_m)
    assert found.agreement.after_m < 0.2 * found.agreement.before_m


def test_lines_of_one_speed_do_not_tell_latency_and_lines_in_one_direction_no_roll() -> None:
    found = told(lines(slope, ASKEW, THERE_AND_BACK, seed=0), UNTURNED)
    assert "latency_s" not in known(found)
    assert "pitch_rad" in known(found)
    same = [THERE_AND_BACK[0]] * 2
    assert known(told(lines(flat, ASKEW, same, seed=0), UNTURNED)) == set()


def test_lines_that_share_no_ground_are_refused() -> None:
    with pytest.raises(NoOverlapError):
        told(lines(flat, STRAIGHT, [THERE_AND_BACK[0]], seed=0))


def test_lines_that_part_while_mountings_are_tried_tell_nothing() -> None:
    found = told(hardly_overlapping(), errors=LineErrors(1.0, 0.1))
    assert (known(found), found.proposal) == (set(), None)
    assert found.agreement.before_m == found.agreement.after_m > 0.1


def hardly_overlapping() -> Pings:
    """Three lines side by side whose outer beams see different ground."""
    ping, beam = np.arange(300)[:, None], np.arange(60)
    line, along = np.divmod(ping[:, 0], 100)
    along = np.where(line % 2, 99 - along, along) / 99.0
    lat, lon = FRAME.to_geographic(8.4 + 16.8 * line, 5.6 + 88.9 * along)
    angle = np.radians(np.linspace(-60.0, 60.0, 60))
    depth = (10.0 + 2.0 * np.sin(6.0 * along) + 0.3 * np.cos(line))[:, None]
    level = np.zeros(300)
    return Pings(
        time_s=ping[:, 0] + 20.0 * line,
        lat_deg=lat,
        lon_deg=lon,
        depth_m=np.ones(300),
        roll_rad=level,
        pitch_rad=level,
        heading_rad=np.pi * (line % 2),
        position_sd_m=np.full(300, 0.3),
        angle_rad=np.tile(angle, (300, 1)).astype(np.float32),
        range_m=(depth / np.cos(angle) + 0.05 * np.sin(7.0 * beam + ping)).astype(np.float32),
    )


def test_nothing_is_searched_for_on_behalf_of_nobody() -> None:
    asked: list[int] = []

    def waits() -> bool:
        asked.append(len(asked))
        return len(asked) < 3

    with pytest.raises(NotWantedError):
        told(lines(flat, ASKEW, THERE_AND_BACK, seed=0), UNTURNED, is_wanted=waits)
    assert len(asked) == 3


def test_a_right_mounting_is_left_alone() -> None:
    found = told(lines(bumpy(2), STRAIGHT, PATCH[:5], seed=0, errors=Errors(position_m=0.2, level_m=0.03)))
    assert found.proposal is None
    assert not any(one.proposed for one in found.parameters.values())


@pytest.mark.slow
@pytest.mark.parametrize("errors", [LineErrors(0.3, 0.05), LineErrors(0.05, 0.02)], ids=["vague", "exact"])
def test_mountings_are_found_within_their_deviations_over_many_floors(errors: LineErrors) -> None:
    apart: dict[str, list[float]] = {name: [] for name in PARAMETERS}
    for seed in range(0, 12, 2):
        rng = np.random.default_rng(1000 + seed)
        roll, pitch, heading = np.radians(rng.uniform(-3.0, 3.0, 3)).tolist()
        real = Mounting(roll, pitch, heading, float(rng.uniform(-0.4, 0.4)))
        wrong = Errors(position_m=errors.position_m, level_m=errors.level_m)
        found = told(lines(bumpy(seed), real, PATCH, seed, wrong), STRAIGHT, errors)
        for name, deviation in off(found, real).items():
            apart[name].append(deviation)
        assert found.proposal is not None
        assert found.agreement.after_m < found.agreement.before_m
    for name, deviations in apart.items():
        assert len(deviations) >= 5, f"{name} is told nearly always"
        assert max(deviations) < 4.0, name
        assert math.sqrt(float(np.mean(np.square(deviations)))) < 1.7, name


@pytest.mark.slow
def test_right_mountings_are_left_alone_over_many_floors() -> None:
    wrong = Errors(position_m=0.3, level_m=0.05)
    proposals = [told(lines(bumpy(seed), STRAIGHT, PATCH, seed, wrong)).proposal for seed in range(0, 12, 2)]
    assert proposals == [None] * len(proposals)


@pytest.mark.slow
def test_an_estimate_that_is_taken_over_makes_lines_agree_and_is_found_again() -> None:
    pings = lines(bumpy(4), ASKEW, PATCH, seed=4)
    first = told(pings, UNTURNED)
    assert known(first) == set(PARAMETERS)
    assert first.proposal is not None
    again = told(pings, first.proposal)
    assert again.agreement.before_m == pytest.approx(first.agreement.after_m, rel=0.1)
    assert again.proposal is None
