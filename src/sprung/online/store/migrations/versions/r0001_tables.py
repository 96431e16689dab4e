"""The tables and indices of the first release."""

from typing import Any

from alembic import op
from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ForeignKey,
    Integer,
    LargeBinary,
    PrimaryKeyConstraint,
    Text,
    UniqueConstraint,
)

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")
DOCUMENT = Text()
#: Name, table and columns: for reading in order of time, and for what is still to be done.
INDICES = (
    ("observations_in_time", "observations", ["vehicle", "t0"]),
    ("modes_in_time", "modes", ["vehicle", "t0"]),
    ("findings_in_time", "findings", ["vehicle", "t0"]),
    ("alert_history_of_alert", "alert_history", ["alert"]),
    ("notifications_sent", "notifications", ["sent"]),
    ("commands_done", "commands", ["done"]),
)


def upgrade() -> None:
    """Create the tables and indices."""
    _create_inbox()
    _create_results()
    _create_alerts()
    op.create_table(
        "audit",
        Column("id", INTEGER, primary_key=True, autoincrement=True),
        *_filled(INTEGER, "time"),
        *_filled(Text(), "who", "act", "subject"),
        Column("detail", DOCUMENT),
    )
    op.create_table(
        "commands",
        Column("id", INTEGER, primary_key=True, autoincrement=True),
        *_filled(INTEGER, "created"),
        *_filled(Text(), "who", "vehicle", "act"),
        Column("detail", DOCUMENT),
        Column("done", INTEGER),
    )
    for name, table, columns in INDICES:
        op.create_index(name, table, columns)


def downgrade() -> None:
    """Drop the tables with their indices, those that refer to others first."""
    for name in ("commands", "audit", "notifications", "alert_history", "alerts", "snapshots", "baselines"):
        op.drop_table(name)
    for name in ("findings", "modes", "observations", "cursors", "frames", "vehicles"):
        op.drop_table(name)


def _filled(kind: Any, *names: str) -> list[Column[object]]:
    """Return columns that always have a value."""
    return [Column(name, kind, nullable=False) for name in names]


def _create_inbox() -> None:
    """Create the tables of vehicles and frames."""
    op.create_table(
        "vehicles",
        *_filled(Text(), "vehicle", "configuration", "description"),
        *_filled(DOCUMENT, "channels"),
        *_filled(INTEGER, "first_seen", "last_seen"),
        PrimaryKeyConstraint("vehicle"),
    )
    op.create_table(
        "frames",
        *_filled(Text(), "vehicle"),
        *_filled(INTEGER, "boot", "seq", "t0"),
        *_filled(Text(), "kind"),
        *_filled(LargeBinary(), "payload"),
        PrimaryKeyConstraint("vehicle", "boot", "seq"),
    )
    op.create_table(
        "cursors",
        *_filled(Text(), "vehicle"),
        *_filled(INTEGER, "boot", "contiguous", "done", "lost", "updated"),
        PrimaryKeyConstraint("vehicle", "boot"),
    )


def _create_results() -> None:
    """Create the tables of results."""
    for name, more in (("observations", ()), ("modes", ()), ("findings", ("place",))):
        op.create_table(
            name,
            *_filled(Text(), "vehicle"),
            *_filled(INTEGER, "boot", "number", *more, "t0"),
            *_filled(DOCUMENT, "document"),
            PrimaryKeyConstraint("vehicle", "boot", "number", *more),
        )
    op.create_table(
        "baselines",
        *_filled(Text(), "vehicle"),
        *_filled(INTEGER, "version", "created"),
        *_filled(Text(), "reason"),
        *_filled(DOCUMENT, "document"),
        PrimaryKeyConstraint("vehicle", "version"),
    )
    op.create_table(
        "snapshots",
        *_filled(Text(), "vehicle"),
        *_filled(INTEGER, "boot", "seq"),
        *_filled(LargeBinary(), "document"),
        PrimaryKeyConstraint("vehicle"),
    )


def _create_alerts() -> None:
    """Create the tables of alerts and notifications."""
    op.create_table(
        "alerts",
        Column("id", INTEGER, primary_key=True, autoincrement=True),
        *_filled(Text(), "vehicle", "cause"),
        *_filled(Integer(), "severity"),
        *_filled(Text(), "text"),
        *_filled(Boolean(), "is_active", "is_acknowledged"),
        Column("shelved_until", INTEGER),
        *_filled(INTEGER, "raised", "updated"),
        Column("cleared", INTEGER),
        *_filled(INTEGER, "count"),
        Column("assignee", Text()),
        *_filled(DOCUMENT, "document"),
        UniqueConstraint("vehicle", "cause", name="alerts_by_cause"),
    )
    op.create_table(
        "alert_history",
        Column("id", INTEGER, primary_key=True, autoincrement=True),
        Column("alert", INTEGER, ForeignKey("alerts.id"), nullable=False),
        *_filled(INTEGER, "time"),
        *_filled(Text(), "what", "who", "comment"),
        Column("assignee", Text()),
        Column("shelved_until", INTEGER),
    )
    op.create_table(
        "notifications",
        Column("id", INTEGER, primary_key=True, autoincrement=True),
        Column("alert", INTEGER, ForeignKey("alerts.id"), nullable=False),
        *_filled(INTEGER, "created"),
        *_filled(DOCUMENT, "document"),
        Column("sent", INTEGER),
        *_filled(INTEGER, "attempts"),
        Column("last_error", Text()),
    )
