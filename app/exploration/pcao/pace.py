"""Whether a team is done in time as it gets on: what tells that another planner has to lead."""

from collections.abc import Sequence

WINDOW = 40
"""Steps that tell how fast a team gets on."""

MAY_BE_LEFT = 0.005
"""Part of all landmarks that may be left in the end."""


class Pace:
    """How many landmarks were left after each of a team's last steps.

    Attributes
    ----------
    left
        Numbers, the newest last; at most one more than :data:`WINDOW`.
    """

    def __init__(self, left: Sequence[int] = ()) -> None:
        self.left = [int(number) for number in left]

    def note(self, left: int) -> None:
        """Take in how many landmarks are left now."""
        self.left = [*self.left[-WINDOW:], left]

    def is_too_slow(self, landmarks: int, steps_left: int) -> bool:
        """Tell whether more than may be would be left after so many steps, if the team went on as in its last ones.

        Before it made :data:`WINDOW` steps nothing is told of it.
        """
        if len(self.left) <= WINDOW:
            return False
        gain = (self.left[0] - self.left[-1]) / WINDOW
        return self.left[-1] - gain * steps_left > MAY_BE_LEFT * landmarks
