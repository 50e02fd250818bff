"""How a limited number is shared out: to each user a share, and some for operators alone."""

from collections import Counter

from app.api.accounts.roles import Role
from app.api.accounts.tokens import LOCAL_OPERATOR, Principal
from app.settings import is_loopback

SHARE = 4
"""One user, or one address of those who are none, gets one part in so many."""
OPERATORS_SHARE = 2
"""One operator gets one part in so many."""
RESERVE = 8
"""One part in so many is for operators alone."""

Holder = Principal | str
"""Who has something: a user, or the network address of somebody who is none."""


def holder_of(principal: Principal | None, network: str) -> Holder:
    """Return to whom something is counted: who came without a token from another machine is his address."""
    if principal is None or (principal == LOCAL_OPERATOR and network and not is_loopback(network)):
        return network
    return principal


class Shares:
    """Who has how many of a limited number.

    Parameters
    ----------
    most
        At the same time.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._share = max(most // SHARE, 1)
        self._operators_share = max(most // OPERATORS_SHARE, 1)
        # Of one or two there is nothing to keep back.
        self._common = most - (max(most // RESERVE, 1) if most >= SHARE else 0)
        self._of: Counter[Holder] = Counter()
        self.held = 0

    def has_room(self, who: Holder) -> bool:
        """Tell whether one more may be had."""
        if who == LOCAL_OPERATOR:
            return self.held < self._most
        if isinstance(who, Principal) and who.role in (Role.OPERATOR, Role.ADMIN):
            return self.held < self._most and self._of[who] < self._operators_share
        return self.held < self._common and self._of[who] < self._share

    def take(self, who: Holder) -> None:
        """Count one more."""
        self.held += 1
        self._of[who] += 1

    def give_back(self, who: Holder) -> None:
        """Count one less."""
        self.held -= 1
        self._of[who] -= 1
        if not self._of[who]:
            del self._of[who]
