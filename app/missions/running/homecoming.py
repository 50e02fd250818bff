"""Whether vehicles go home before a mission ends; single ones called home, held where they are, and sent on."""

from app.missions import states
from app.missions.errors import ConflictError
from app.missions.flight.orders import OrderBook
from app.missions.flown import Phase
from app.missions.live.mission import LiveMission
from app.missions.running.supervisor import MissionSupervisor
from app.missions.spec.failsafes import Response
from app.missions.spec.recovery import Homecoming
from app.missions.states import AT_SEA, ENDED, Action, MissionState
from app.missions.team import Member
from app.missions.views.mission import Level
from app.storage.queries import missions as mission_queries


def returns(live: LiveMission, action: Action, asked: bool | None) -> bool:
    """Whether vehicles go home before an action takes effect.

    Raises ConflictError where that was asked for and nobody has a recovery point, and where a mission that is being
    aborted is to be finished.
    """
    if action not in (Action.FINISH, Action.ABORT):
        return False
    if action is Action.FINISH and live.ending is not None and live.ending.state is MissionState.ABORTED:
        raise ConflictError(
            f"it is aborted by {live.ending.actor}, as soon as everybody is home",
            "wait for that, or abort it again to stop them where they are",
        )
    out = [member for member in live.team if member.withdrawal is None or not member.withdrawal.over]
    homes = {member.name: live.spec.recovery_of(member.spec) for member in out}
    able = live.header.state in AT_SEA and any(homes.values())
    if asked:
        if out and not any(homes.values()) and live.header.state in AT_SEA:
            raise ConflictError("no vehicle has a recovery point to return to", "give recovery.point, or stop them")
        return able
    if asked is not None or action is Action.ABORT or live.ending is not None:
        return False
    wanted = any(home is not None and home.on_finish is Homecoming.RETURN for home in homes.values())
    return able and wanted and any(member.legs for member in out)


async def call_home(live: LiveMission, name: str, actor: str) -> None:
    """Send one vehicle home and go on without it. Raises VehicleNotFoundError, ConflictError."""
    member = live.team.named(name)
    if live.header.state is not MissionState.RUNNING:
        raise ConflictError(f"the mission is {live.header.state}: nobody is led", states.remedy(live.header.state))
    if live.spec.recovery_of(member.spec) is None:
        raise ConflictError(f"vehicle {name!r} has no recovery point", "abort it: it stops where it is")
    if not live.withdraw(member, Response.RETURN, f"called home by {actor}"):
        raise ConflictError(f"vehicle {name!r} surveys no more: {_why(member)}", "wait until it is there")
    live.publish_summary()


async def hold(live: LiveMission, name: str, actor: str) -> None:
    """Keep one vehicle where it is until it is sent on. Raises VehicleNotFoundError, ConflictError."""
    member = live.team.named(name)
    if live.header.state is not MissionState.RUNNING or live.ending is not None:
        raise ConflictError(f"the mission is {_what(live)}: nobody is held", "see to the mission first")
    if not live.withdraw(member, Response.HOLD, f"held by {actor}", asked=True):
        raise ConflictError(f"vehicle {name!r} surveys no more: {_why(member)}", "send it on first")
    live.publish_summary()


async def send_on(live: LiveMission, supervisor: MissionSupervisor, name: str, actor: str) -> None:
    """Let a vehicle survey again that went home or was stopped. Raises VehicleNotFoundError, ConflictError."""
    member = live.team.named(name)
    if live.header.state not in AT_SEA:
        raise ConflictError(f"the mission is {live.header.state}: nobody is led", states.remedy(live.header.state))
    if member.withdrawal is None and await live.part(OrderBook).cancel(member, actor):
        return
    if member.withdrawal is None and live.header.state is MissionState.PAUSED:
        raise ConflictError("the mission is paused: nobody is led", states.remedy(live.header.state))
    if member.withdrawal is None:
        raise ConflictError(f"vehicle {name!r} is surveying", "nothing has to be done")
    live.refuse_ending()
    strongest = next((one for one in member.failsafes if one.response is not Response.WARN), None)
    if strongest is not None and not member.withdrawal.over:
        raise ConflictError(f"vehicle {name!r} is not fit to go on: {strongest.message}", "see to that first")
    async with supervisor.acting(live.id):
        async with live.database.writing() as session:
            await mission_queries.keep_withdrawal(session, live.id, name, None)
        if member.is_home:
            member.energy.renew()
        member.survey_again()
        member.flown.phase = Phase.TRANSIT if live.header.state is MissionState.RUNNING else Phase.STOPPED
        member.drop_legs()
    await live.journal.log(Level.INFO, "recovery", f"{name} goes on with the survey", vehicle=name, actor=actor)
    live.changed.set()
    live.publish_summary()


def _what(live: LiveMission) -> str:
    return str(live.header.state) if live.ending is None or live.header.state in ENDED else "ending"


def _why(member: Member) -> str:
    return "" if member.withdrawal is None else member.withdrawal.why
