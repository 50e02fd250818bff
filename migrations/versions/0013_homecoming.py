"""Keep which vehicles go home, and what a mission becomes once all are there, so that a restart goes on with it."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0013"
down_revision: str | None = "0012"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("mission_vehicles", sa.Column("withdrawal", sa.JSON(), nullable=True))
    op.add_column("missions", sa.Column("ending", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("missions", "ending")
    op.drop_column("mission_vehicles", "withdrawal")
