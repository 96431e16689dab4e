"""Whom an alert was assigned to and until when it was shelved, in its history."""

from alembic import op
from sqlalchemy import BigInteger, Column, Integer, Text

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the columns."""
    op.add_column("alert_history", Column("assignee", Text))
    op.add_column("alert_history", Column("shelved_until", BigInteger().with_variant(Integer, "sqlite")))


def downgrade() -> None:
    """Drop the columns."""
    for name in ("shelved_until", "assignee"):
        op.drop_column("alert_history", name)
