"""Index of active alerts with all that the order of a fleet needs: their rows are not read for it."""

from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Put severity and cause into the index of active alerts."""
    op.drop_index("alerts_active", "alerts")
    op.create_index("alerts_active", "alerts", ["is_active", "vehicle", "severity", "cause"])


def downgrade() -> None:
    """Take them out of it."""
    op.drop_index("alerts_active", "alerts")
    op.create_index("alerts_active", "alerts", ["is_active", "vehicle"])
