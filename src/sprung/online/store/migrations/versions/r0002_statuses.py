"""Progress of each vehicle, and when results were stored: an old recording does not make an old result."""

from alembic import op
from sqlalchemy import BigInteger, Column, Integer, PrimaryKeyConstraint, Text

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")
ENTRIES = ("observations", "modes", "findings")


def upgrade() -> None:
    """Create the table of the progress, and add the time of storing to the results."""
    op.create_table(
        "statuses",
        Column("vehicle", Text(), nullable=False),
        Column("document", Text(), nullable=False),
        PrimaryKeyConstraint("vehicle"),
    )
    for name in ENTRIES:
        op.add_column(name, Column("stored", INTEGER, nullable=False, server_default="0"))


def downgrade() -> None:
    """Drop what `upgrade` created."""
    op.drop_table("statuses")
    for name in ENTRIES:
        op.drop_column(name, "stored")
