"""Accounts, sessions, tokens and verdicts, and what the pages of a fleet look up."""

from alembic import op
from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ForeignKeyConstraint,
    Integer,
    PrimaryKeyConstraint,
    Text,
    UniqueConstraint,
    false,
)

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")


def upgrade() -> None:
    """Create the tables of people, and the columns and indices by which pages look vehicles up."""
    op.add_column("statuses", Column("is_learning", Boolean(), nullable=False, server_default=false()))
    op.execute("""UPDATE statuses SET is_learning = true WHERE document LIKE '%"is_learning"\\:true%'""")
    op.create_index("alerts_active", "alerts", ["is_active", "vehicle"])
    op.create_table(
        "verdicts",
        Column("id", INTEGER, nullable=False, autoincrement=True),
        Column("alert", INTEGER, nullable=False),
        Column("time", INTEGER, nullable=False),
        Column("who", Text(), nullable=False),
        Column("verdict", Text(), nullable=False),
        Column("part", Text(), nullable=False),
        Column("action", Text(), nullable=False),
        Column("raised", INTEGER, nullable=False),
        Column("request", INTEGER),
        PrimaryKeyConstraint("id"),
        ForeignKeyConstraint(["alert"], ["alerts.id"]),
    )
    op.create_index("verdicts_of_alert", "verdicts", ["alert"])
    op.create_table(
        "accounts",
        Column("name", Text(), nullable=False),
        Column("role", Text(), nullable=False),
        Column("password", Text(), nullable=False),
        Column("created", INTEGER, nullable=False),
        PrimaryKeyConstraint("name"),
    )
    op.create_table(
        "sessions",
        Column("digest", Text(), nullable=False),
        Column("account", Text(), nullable=False),
        Column("created", INTEGER, nullable=False),
        Column("expires", INTEGER, nullable=False),
        PrimaryKeyConstraint("digest"),
        ForeignKeyConstraint(["account"], ["accounts.name"], ondelete="CASCADE"),
    )
    op.create_table(
        "tokens",
        Column("id", INTEGER, nullable=False, autoincrement=True),
        Column("digest", Text(), nullable=False),
        Column("name", Text(), nullable=False),
        Column("role", Text(), nullable=False),
        Column("created", INTEGER, nullable=False),
        Column("created_by", Text(), nullable=False),
        Column("expires", INTEGER),
        PrimaryKeyConstraint("id"),
        UniqueConstraint("digest"),
    )


def downgrade() -> None:
    """Drop what `upgrade` created."""
    for name in ("tokens", "sessions", "accounts", "verdicts"):
        op.drop_table(name)
    op.drop_index("alerts_active", "alerts")
    op.drop_column("statuses", "is_learning")
