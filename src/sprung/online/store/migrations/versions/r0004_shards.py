"""Monitors and their leases on shards of vehicles, parked vehicles, and which older programs may use a newer store."""

from alembic import op
from sqlalchemy import BigInteger, Boolean, Column, Integer, PrimaryKeyConstraint, Text, column, false, table, text

from sprung.online.store.leases import N_SHARDS, shard_of

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

INTEGER = BigInteger().with_variant(Integer, "sqlite")


def upgrade() -> None:
    """Create the tables, with a free lease for each shard, and put the cursors into their shards."""
    op.create_table(
        "monitors",
        Column("monitor", Text(), nullable=False),
        Column("seen", INTEGER, nullable=False),
        PrimaryKeyConstraint("monitor"),
    )
    leases = op.create_table(
        "leases",
        Column("shard", Integer(), nullable=False),
        Column("holder", Text()),
        Column("epoch", INTEGER, nullable=False),
        PrimaryKeyConstraint("shard"),
    )
    op.bulk_insert(leases, [{"shard": shard, "holder": None, "epoch": 0} for shard in range(N_SHARDS)])
    op.create_table(
        "compatibility",
        Column("revision", Text(), nullable=False),
        Column("since", Text(), nullable=False),
        PrimaryKeyConstraint("revision"),
    )
    op.add_column("cursors", Column("shard", Integer(), nullable=False, server_default="-1"))
    op.create_index("cursors_of_shard", "cursors", ["shard", "updated"])
    op.add_column("vehicles", Column("is_parked", Boolean(), nullable=False, server_default=false()))
    connection = op.get_bind()
    cursors = table("cursors", column("vehicle"), column("shard"))
    for (vehicle,) in connection.execute(text("SELECT DISTINCT vehicle FROM cursors")).all():
        connection.execute(cursors.update().where(cursors.c.vehicle == vehicle).values(shard=shard_of(vehicle)))


def downgrade() -> None:
    """Drop what `upgrade` created."""
    op.drop_index("cursors_of_shard", "cursors")
    op.drop_column("cursors", "shard")
    op.drop_column("vehicles", "is_parked")
    for name in ("compatibility", "leases", "monitors"):
        op.drop_table(name)
