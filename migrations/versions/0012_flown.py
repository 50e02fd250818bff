"""Keep what every vehicle has flown, so that a restart goes on counting."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0012"
down_revision: str | None = "0011"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("mission_vehicles", sa.Column("flown", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("mission_vehicles", "flown")
