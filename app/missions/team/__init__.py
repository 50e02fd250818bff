"""The vehicles of one mission as its flight sees them.

``Team`` holds its members. A ``Member`` says of each group of its fields who changes them, and has methods for what
several of these do; its legs, its withdrawal and what it reports have modules of their own.
"""

from app.missions.team.legs import CommittedLeg, CommittedWay, OperatorOrder, OrderedLeg
from app.missions.team.member import OUT_OF_REACH, SETTLED, Member
from app.missions.team.reported import FixTimes, Swath
from app.missions.team.team import Team
from app.missions.team.withdrawal import WayHome, Withdrawal, WithdrawalCause

__all__ = [
    "OUT_OF_REACH",
    "SETTLED",
    "CommittedLeg",
    "CommittedWay",
    "FixTimes",
    "Member",
    "OperatorOrder",
    "OrderedLeg",
    "Swath",
    "Team",
    "WayHome",
    "Withdrawal",
    "WithdrawalCause",
]
