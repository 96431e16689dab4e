"""Deliveries by sender, notifications that were given up, and what the retention of every table needs."""

from alembic import op
from sqlalchemy import BigInteger, Column, ForeignKeyConstraint, Integer, PrimaryKeyConstraint, Text

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")
ENTRIES = ("observations", "modes", "findings")


def upgrade() -> None:
    """Create the tables of deliveries and forgotten boots, add the time of giving up, and index the time of storing."""
    op.add_column("notifications", Column("given_up", INTEGER))
    op.create_table(
        "deliveries",
        Column("notification", INTEGER, nullable=False),
        Column("sender", Text(), nullable=False),
        Column("attempts", INTEGER, nullable=False),
        Column("next_attempt", INTEGER),
        Column("sent", INTEGER),
        Column("given_up", INTEGER),
        Column("last_error", Text()),
        PrimaryKeyConstraint("notification", "sender"),
        ForeignKeyConstraint(["notification"], ["notifications.id"], ondelete="CASCADE"),
    )
    op.create_table(
        "forgotten",
        Column("vehicle", Text(), nullable=False),
        Column("boot", INTEGER, nullable=False),
        PrimaryKeyConstraint("vehicle"),
    )
    for name in ENTRIES:
        op.create_index(f"{name}_stored", name, ["stored"])


def downgrade() -> None:
    """Drop what `upgrade` created."""
    for name in ENTRIES:
        op.drop_index(f"{name}_stored", name)
    op.drop_table("forgotten")
    op.drop_table("deliveries")
    op.drop_column("notifications", "given_up")
