"""Keep what operators say of single soundings, and how far a mission had come at each step."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0003"
down_revision: str | None = "0002"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("soundings", sa.Column("ruling", sa.String(length=16), nullable=True))
    op.add_column("steps", sa.Column("figures", sa.JSON(), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.drop_column("figures")
    with op.batch_alter_table("soundings", schema=None) as batch_op:
        batch_op.drop_column("ruling")
