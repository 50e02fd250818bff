"""What changes of a vehicle when it gets a leg, comes to its end, leaves the survey or the mission."""

from datetime import UTC, datetime

import numpy as np
import pytest

from app.missions.fleet.interface import LinkState, Position, VehicleReport, WaypointOrder, WaypointStatus
from app.missions.flown import Phase
from app.missions.spec.failsafes import Response
from app.missions.spec.vehicle import VehicleSpec
from app.missions.team import CommittedLeg, Member, Team, Withdrawal
from tests.support.missions.specs import FRAME, LAT, LON

AT = Position(LAT, LON, 2.0)
HERE_M, THERE_M, ON_M = np.zeros(2), np.array([10.0, 0.0]), np.array([20.0, 0.0])
LEAVES_AT = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture
def team() -> Team:
    team = Team()
    member = team.join(VehicleSpec.model_validate({"name": "a", "kind": "sim"}), 0)
    member.report = VehicleReport("a", 0.0, AT)
    member.follow(LinkState.ENGAGED)
    member.ahead[:] = [CommittedLeg(1, AT, THERE_M), CommittedLeg(2, AT, ON_M, surfacing=True)]
    member.committed.commit(2)
    return team


@pytest.fixture
def member(team: Team) -> Member:
    return team.named("a")


def order_next(member: Member) -> None:
    leg = member.take_next_leg(FRAME)
    member.set_order(WaypointOrder("m", leg.number, "a", leg.position, 1.0, 3.0, 1.0), leg.target_m)


def start_m(member: Member) -> list[float]:
    assert member.leg.start_m is not None
    return [round(float(value), 3) for value in member.leg.start_m]


def test_a_leg_begins_where_the_one_before_it_ended_if_its_vehicle_came_there(member: Member) -> None:
    order_next(member)
    assert (start_m(member), member.ordered, member.status) == ([0.0, 0.0], True, WaypointStatus.PLANNED)
    member.status = WaypointStatus.REACHED
    order_next(member)
    assert start_m(member) == THERE_M.tolist()
    assert (member.surfacing, member.fixes.risings) == (True, 1)


def test_a_leg_begins_where_its_vehicle_is_if_it_waited_elsewhere(member: Member) -> None:
    order_next(member)
    member.status = WaypointStatus.REACHED
    member.wait_at(THERE_M)
    order_next(member)
    assert start_m(member) == [0.0, 0.0]
    assert member.waits_m is None


def test_who_is_led_aside_often_is_no_longer_given_time_for_that_until_its_next_leg(member: Member) -> None:
    order_next(member)
    for lets_pass in (True, True, False):
        member.step_aside(2)
        assert member.lets_pass is lets_pass
    order_next(member)
    member.step_aside(2)
    assert member.lets_pass


def test_who_is_there_and_not_engaged_by_us_follows_no_more(member: Member) -> None:
    member.note_link(LinkState.LOST)
    assert (member.engaged, member.controllable) == (True, False)
    member.note_link(LinkState.READY)
    assert (member.engaged, member.left_alone) == (False, True)
    member.follow(LinkState.ENGAGED)
    assert member.controllable


def test_legs_that_are_missed_in_a_row_are_counted_but_not_those_that_are_given_up(member: Member) -> None:
    member.miss_leg()
    with member.counting_no_misses():
        member.miss_leg()
    assert (member.misses, member.flown.legs_missed, member.flown.missed_last) == (1, 1, 1)
    member.reach_leg()
    assert (member.misses, member.flown.legs_missed, member.flown.missed_last) == (0, 1, 0)


def test_only_something_stronger_takes_the_place_of_why_a_vehicle_left_the_survey(member: Member) -> None:
    member.pursuing = "tag-1"
    home = Withdrawal(Response.RETURN, "low energy")
    assert member.withdraw(home)
    assert member.pursuing is None
    assert not member.withdraw(Withdrawal(Response.HOLD, "a ship"))
    assert member.withdrawal is home
    assert member.withdraw(Withdrawal(Response.SURFACE, "a leak"))
    assert member.withdrawal is not None
    member.withdrawal.over = True
    assert not member.withdraw(Withdrawal(Response.STOP, "Ana wants it"))
    member.survey_again()
    assert member.plannable


def test_who_comes_back_goes_on_counting_and_has_no_legs(team: Team, member: Member) -> None:
    order_next(member)
    member.committed.way_m, member.flown.flown_m, member.energy.used_s = 20.0, 5.0, 7.0
    team.leave("a", LEAVES_AT)
    assert (member.left_at, member.ordered, member.ahead, member.engaged) == (LEAVES_AT, False, [], False)
    assert member.flown.phase is Phase.STOPPED
    back = team.join(member.spec, 0)
    assert (back.legs, back.committed.way_m, back.flown.flown_m, back.energy.used_s) == (2, 20.0, 5.0, 7.0)
    assert (back.report, back.ahead, back.engaged, back.left_at) == (member.report, [], False, None)
    back.committed.spare(1, 10.0)
    assert (member.committed.way_m, member.committed.spared) == (20.0, 0), "who left has its own count"
