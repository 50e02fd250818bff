"""Sites: places that are surveyed again and again, and what each mission found of its own."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0016"
down_revision: str | None = "0015"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

BIG_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "sites",
        sa.Column("id", sa.String(length=36), nullable=False),
        sa.Column("name", sa.String(length=120), nullable=False),
        sa.Column("spec", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("updated_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_sites")),
    )
    op.create_table(
        "site_missions",
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("site_id", sa.String(length=36), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f("fk_site_missions_mission_id_missions"), ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(["site_id"], ["sites.id"], name=op.f("fk_site_missions_site_id_sites")),
        sa.PrimaryKeyConstraint("mission_id", name=op.f("pk_site_missions")),
    )
    op.create_index(op.f("ix_site_missions_site_id"), "site_missions", ["site_id"])
    op.create_table(
        "site_surveys",
        sa.Column("mission_id", sa.String(length=36), nullable=False),
        sa.Column("site_id", sa.String(length=36), nullable=False),
        sa.Column("mission_name", sa.String(length=120), nullable=False),
        sa.Column("made_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("first_time_s", sa.Double(), nullable=False),
        sa.Column("last_time_s", sa.Double(), nullable=False),
        sa.Column("last_sounding", BIG_ID, nullable=False),
        sa.Column("last_import", BIG_ID, nullable=False),
        sa.Column("last_block", BIG_ID, nullable=False),
        sa.Column("summary", sa.JSON(), nullable=False),
        sa.Column("digest", sa.String(length=64), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["site_id"], ["sites.id"], name=op.f("fk_site_surveys_site_id_sites")),
        sa.PrimaryKeyConstraint("mission_id", name=op.f("pk_site_surveys")),
    )
    op.create_index(op.f("ix_site_surveys_site_id"), "site_surveys", ["site_id"])


def downgrade() -> None:
    op.drop_table("site_surveys")
    op.drop_table("site_missions")
    op.drop_table("sites")
