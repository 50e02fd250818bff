"""The states of a mission and the one table of moves between them."""

from enum import StrEnum

from app.missions.errors import MissionError


class MissionState(StrEnum):
    """Where a mission is in its life."""

    DRAFT = "draft"
    """Described, but something that it needs is missing (no vehicle yet)."""
    READY = "ready"
    RUNNING = "running"
    PAUSED = "paused"
    FINISHED = "finished"
    ABORTED = "aborted"
    FAILED = "failed"


class Action(StrEnum):
    """What operators and consoles may ask of a mission."""

    START = "start"
    PAUSE = "pause"
    RESUME = "resume"
    ABORT = "abort"
    FINISH = "finish"


NOT_STARTED = (MissionState.DRAFT, MissionState.READY)
AT_SEA = (MissionState.RUNNING, MissionState.PAUSED)
"""States in which its vehicles are out there."""

ENDED = frozenset({MissionState.FINISHED, MissionState.ABORTED, MissionState.FAILED})

_S = MissionState
MOVES: dict[str, dict[MissionState, MissionState]] = {
    "complete_draft": {_S.DRAFT: _S.READY},
    "reopen_draft": {_S.READY: _S.DRAFT},
    "start": {_S.READY: _S.RUNNING},
    "pause": {_S.RUNNING: _S.PAUSED},
    "resume": {_S.PAUSED: _S.RUNNING},
    "finish": {_S.RUNNING: _S.FINISHED, _S.PAUSED: _S.FINISHED},
    "abort": {_S.DRAFT: _S.ABORTED, _S.READY: _S.ABORTED, _S.RUNNING: _S.ABORTED, _S.PAUSED: _S.ABORTED},
    "fail": {_S.READY: _S.FAILED, _S.RUNNING: _S.FAILED, _S.PAUSED: _S.FAILED},
}
"""For every action the states it may be taken in and the state it leads to."""

_REMEDIES: dict[MissionState, str] = {
    _S.DRAFT: "Add at least one vehicle first: POST /api/v1/missions/{id}/vehicles",
    _S.READY: "Start it first: POST /api/v1/missions/{id}/start",
    _S.RUNNING: "It is running: pause, finish or abort it",
    _S.PAUSED: "It is paused: resume, finish or abort it",
    _S.FINISHED: "It has finished; create a new mission to go on",
    _S.ABORTED: "It was aborted; create a new mission to go on",
    _S.FAILED: "It failed; its events say why. Create a new mission to go on",
}


class MoveRefusedError(MissionError):
    """An action is not allowed in the state a mission is in."""

    def __init__(self, action: str, state: MissionState) -> None:
        allowed = ", ".join(MOVES[action])
        words = f"cannot {action.replace('_', ' ')} a mission that is {state}; allowed from: {allowed}"
        super().__init__(words, remedy(state))
        self.action = action
        self.state = state


def remedy(state: MissionState) -> str:
    """Return what can be done with a mission in this state, for who asked for something else."""
    return _REMEDIES[state]


def allowed_actions(state: MissionState) -> list[Action]:
    """Return what may be asked of a mission in this state."""
    return [action for action in Action if state in MOVES[action]]


def move(state: MissionState, action: str) -> MissionState:
    """Return the state that ``action`` leads to. Raises MoveRefusedError when it is not allowed."""
    try:
        return MOVES[action][state]
    except KeyError:
        raise MoveRefusedError(action, state) from None
