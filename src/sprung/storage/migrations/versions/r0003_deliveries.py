"""Progress of each sender with each notification, and notifications that were given up."""

from alembic import op
from sqlalchemy import BigInteger, Column, ForeignKeyConstraint, Integer, PrimaryKeyConstraint, Text

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")


def upgrade() -> None:
    """Create the table of deliveries, and add the time of giving up to the notifications."""
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


def downgrade() -> None:
    """Drop what `upgrade` created."""
    op.drop_table("deliveries")
    op.drop_column("notifications", "given_up")
