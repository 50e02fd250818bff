"""Keep the IMC ids that processes on this database have led vehicles by: plans that vehicles have of them are ours."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0022"
down_revision: str | None = "0021"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "consoles",
        sa.Column("imc_id", sa.Integer(), autoincrement=False, nullable=False),
        sa.PrimaryKeyConstraint("imc_id", name=op.f("pk_consoles")),
    )


def downgrade() -> None:
    op.drop_table("consoles")
