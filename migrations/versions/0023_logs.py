"""Number vehicles' logs, and tell what each brought: so that one can be taken back."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0023"
down_revision: str | None = "0022"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

BIG_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")

BROUGHT = ("soundings", "positions", "ping_blocks", "ping_chunks")


def upgrade() -> None:
    op.create_table(
        "logs",
        sa.Column("id", BIG_ID, autoincrement=True, nullable=False),
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("vehicle", sa.String(length=64), nullable=False),
        sa.Column("digest", sa.String(length=64), nullable=False),
        sa.Column("altimeter", sa.String(length=64), nullable=False),
        sa.Column("file", sa.String(length=200), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("taken_back_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("taken_back_by", sa.String(length=200), nullable=True),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_logs_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_logs")),
        # The number of a log that went with its mission must never be another one's.
        sqlite_autoincrement=True,
    )
    op.create_index("ix_logs_mission", "logs", ["mission_id", "digest"])
    for table in BROUGHT:
        op.add_column(table, sa.Column("log", BIG_ID, nullable=True))


def downgrade() -> None:
    for table in BROUGHT:
        op.drop_column(table, "log")
    op.drop_table("logs")
