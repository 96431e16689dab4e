"""Compressed documents of results; those that are there stay as they are."""

from alembic import op
from sqlalchemy import Column, LargeBinary

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

ENTRIES = ("observations", "modes", "findings")


def upgrade() -> None:
    """Add the column of compressed documents."""
    for name in ENTRIES:
        op.add_column(name, Column("packed", LargeBinary()))


def downgrade() -> None:
    """Drop what `upgrade` created."""
    for name in ENTRIES:
        op.drop_column(name, "packed")
