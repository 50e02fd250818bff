"""Keep as values what only words told: which legs were not begun, and what kind of reason ended a vehicle's survey."""

from collections.abc import Callable, Sequence
from typing import Any

import sqlalchemy as sa
from alembic import op

revision: str = "0021"
down_revision: str | None = "0020"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

PART_DONE = ("it has flown its way", "what is left of its way is for going home and for no further line")
"""In these words a vehicle was told to have done its part."""

WAYPOINTS = sa.table("waypoints", sa.column("reason", sa.Text()), sa.column("begun", sa.Boolean()))
VEHICLES = sa.table(
    "mission_vehicles",
    sa.column("mission_id", sa.String()),
    sa.column("name", sa.String()),
    sa.column("withdrawal", sa.JSON(none_as_null=True)),
)


def upgrade() -> None:
    op.add_column("waypoints", sa.Column("begun", sa.Boolean(), nullable=False, server_default=sa.true()))
    op.execute(WAYPOINTS.update().where(WAYPOINTS.c.reason.startswith("given up: ")).values(begun=sa.false()))
    _change_withdrawals(_with_cause)


def downgrade() -> None:
    _change_withdrawals(_without_cause)
    op.drop_column("waypoints", "begun")


def _change_withdrawals(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    connection = op.get_bind()
    withdrawn = VEHICLES.select().where(VEHICLES.c.withdrawal.is_not(None))
    for mission_id, name, withdrawal in connection.execute(withdrawn).all():
        of_it = (VEHICLES.c.mission_id == mission_id, VEHICLES.c.name == name)
        connection.execute(VEHICLES.update().where(*of_it).values(withdrawal=change(withdrawal)))


def _with_cause(withdrawal: dict[str, Any]) -> dict[str, Any]:
    facts = {"asked": False} | withdrawal
    part_done = facts["why"] in PART_DONE
    done = facts.pop("done", part_done)
    return facts | {"cause": "part_done" if done and part_done else "mission_end" if done else "called"}


def _without_cause(withdrawal: dict[str, Any]) -> dict[str, Any]:
    facts = dict(withdrawal)
    return facts | {"done": facts.pop("cause") != "called"}
