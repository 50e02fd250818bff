"""Keep the pings of swath sonars: blocks of them, and what is known of the files that blocks are moved to."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0014"
down_revision: str | None = "0013"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

BIG_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "ping_blocks",
        sa.Column("id", BIG_ID, autoincrement=True, nullable=False),
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("vehicle", sa.String(length=64), nullable=False),
        sa.Column("step", sa.Integer(), nullable=False),
        sa.Column("received_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("source", sa.String(length=64), nullable=False),
        sa.Column("first_time_s", sa.Double(), nullable=False),
        sa.Column("last_time_s", sa.Double(), nullable=False),
        sa.Column("pings", sa.Integer(), nullable=False),
        sa.Column("beams", sa.Integer(), nullable=False),
        sa.Column("rejected", sa.Integer(), nullable=False),
        sa.Column("times", sa.LargeBinary(), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_ping_blocks_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_ping_blocks")),
        # The id of a block that was moved to a file must never be another one's.
        sqlite_autoincrement=True,
    )
    op.create_table(
        "ping_chunks",
        sa.Column("id", BIG_ID, autoincrement=True, nullable=False),
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("vehicle", sa.String(length=64), nullable=False),
        sa.Column("name", sa.String(length=200), nullable=False),
        sa.Column("first_block", BIG_ID, nullable=False),
        sa.Column("last_block", BIG_ID, nullable=False),
        sa.Column("first_time_s", sa.Double(), nullable=False),
        sa.Column("last_time_s", sa.Double(), nullable=False),
        sa.Column("pings", sa.Integer(), nullable=False),
        sa.Column("beams", sa.Integer(), nullable=False),
        sa.Column("rejected", sa.Integer(), nullable=False),
        sa.Column("times", sa.LargeBinary(), nullable=False),
        sa.Column("digest", sa.String(length=64), nullable=False),
        sa.Column("size", BIG_ID, nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_ping_chunks_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_ping_chunks")),
        sa.UniqueConstraint("name", name="uq_ping_chunks_name"),
    )
    for table in ("ping_blocks", "ping_chunks"):
        op.create_index(f"ix_{table}_mission", table, ["mission_id", "id"])
        op.create_index(f"ix_{table}_times", table, ["mission_id", "vehicle", "last_time_s"])


def downgrade() -> None:
    op.drop_table("ping_chunks")
    op.drop_table("ping_blocks")
