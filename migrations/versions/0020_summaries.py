"""Keep how missions stood that ended, so that a list after a restart need not take each of them up."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0020"
down_revision: str | None = "0019"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("missions", sa.Column("summary", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("missions", "summary")
