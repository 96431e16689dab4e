"""Indices for reading in order of time and for what is still to be done."""

from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

INDICES = (
    ("observations_in_time", "observations", ["vehicle", "t0"]),
    ("modes_in_time", "modes", ["vehicle", "t0"]),
    ("findings_in_time", "findings", ["vehicle", "t0"]),
    ("alert_history_of_alert", "alert_history", ["alert"]),
    ("notifications_sent", "notifications", ["sent"]),
    ("commands_done", "commands", ["done"]),
)


def upgrade() -> None:
    """Add the indices."""
    for name, table, columns in INDICES:
        op.create_index(name, table, columns)


def downgrade() -> None:
    """Drop the indices."""
    for name, table, _ in INDICES:
        op.drop_index(name, table_name=table)
