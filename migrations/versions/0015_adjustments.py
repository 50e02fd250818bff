"""Keep the adjustment of a mission's tracks: by how much positions were off, and how that was found."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0015"
down_revision: str | None = "0014"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "adjustments",
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("made_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("actor", sa.String(length=120), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_adjustments_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("mission_id", name=op.f("pk_adjustments")),
    )


def downgrade() -> None:
    op.drop_table("adjustments")
