"""Keep how beams pointed, water levels, tide tables, imports and reference grids."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0002"
down_revision: str | None = "0001"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

NEW_COLUMNS = (
    "level_m",
    "vehicle_lat_deg",
    "vehicle_lon_deg",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "beam_azimuth_deg",
    "beam_off_nadir_deg",
)


def upgrade() -> None:
    for name in NEW_COLUMNS:
        op.add_column("soundings", sa.Column(name, sa.Double(), nullable=True))
    op.create_table(
        "tide_tables",
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("name", sa.String(length=200), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_tide_tables_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("mission_id", name=op.f("pk_tide_tables")),
    )
    op.create_table(
        "imports",
        sa.Column("id", sa.String(length=36), nullable=False),
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("digest", sa.String(length=64), nullable=False),
        sa.Column("filename", sa.String(length=200), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("count", sa.Integer(), nullable=False),
        sa.Column("summary", sa.JSON(), nullable=False),
        sa.Column("soundings", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_imports_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_imports")),
        sa.UniqueConstraint("mission_id", "digest", name="uq_imports_digest"),
    )
    with op.batch_alter_table("imports", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_imports_mission_id"), ["mission_id"], unique=False)
    op.create_table(
        "reference_grids",
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("filename", sa.String(length=200), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("rows", sa.Integer(), nullable=False),
        sa.Column("cols", sa.Integer(), nullable=False),
        sa.Column("summary", sa.JSON(), nullable=False),
        sa.Column("depths", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_reference_grids_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("mission_id", name=op.f("pk_reference_grids")),
    )


def downgrade() -> None:
    op.drop_table("reference_grids")
    with op.batch_alter_table("imports", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_imports_mission_id"))

    op.drop_table("imports")
    op.drop_table("tide_tables")
    with op.batch_alter_table("soundings", schema=None) as batch_op:
        for name in reversed(NEW_COLUMNS):
            batch_op.drop_column(name)
