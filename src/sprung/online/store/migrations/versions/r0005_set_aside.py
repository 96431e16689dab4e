"""Frames and states that could not be used are set aside, and not deleted."""

from alembic import op
from sqlalchemy import BigInteger, Column, Integer, LargeBinary, PrimaryKeyConstraint, Text

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")


def upgrade() -> None:
    """Create the table."""
    op.create_table(
        "set_aside",
        Column("vehicle", Text(), nullable=False),
        Column("boot", INTEGER, nullable=False),
        Column("seq", INTEGER, nullable=False),
        Column("kind", Text(), nullable=False),
        Column("t0", INTEGER, nullable=False),
        Column("payload", LargeBinary(), nullable=False),
        Column("reason", Text(), nullable=False),
        Column("stored", INTEGER, nullable=False),
        PrimaryKeyConstraint("vehicle", "boot", "seq", "kind"),
    )


def downgrade() -> None:
    """Drop it."""
    op.drop_table("set_aside")
