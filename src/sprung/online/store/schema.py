"""Tables of the store.

Times are UTC nanoseconds. `boot` counts the starts of a box, `seq` its frames since then, from 0.
"""

import json
import zlib
from collections.abc import Iterable
from types import UnionType
from typing import Any, get_args, get_type_hints

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ColumnElement,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    TypeDecorator,
    UniqueConstraint,
    and_,
    false,
    or_,
)
from sqlalchemy.schema import SchemaItem

from sprung.errors import SprungError
from sprung.online.store.rows import (
    AccountRow,
    AlertRow,
    AuditRow,
    BaselineRow,
    CommandRow,
    Cursor,
    Delivery,
    HistoryRow,
    QuarantineRow,
    Snapshot,
    StoredFrame,
    TokenRow,
    VehicleRow,
    VerdictRow,
)


class StoreError(SprungError):
    """A store that cannot be opened, read or written."""


class RefusedError(StoreError):
    """Values that no row can hold: the store itself works, and stores others."""


class ReservationLostError(SprungError):
    """The store is no longer reserved for this monitor, which must stop; nothing was written."""


class Json(TypeDecorator[Any]):
    """JSON values as text, so that both databases refuse NaN and infinities, and keep the order of names."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Any) -> str | None:
        """Return the text to store; NULL for None."""
        return None if value is None else json.dumps(value, allow_nan=False, separators=(",", ":"))

    def process_result_value(self, value: str | None, dialect: Any) -> Any:
        """Return what the text holds."""
        return None if value is None else json.loads(value)


class Packed(TypeDecorator[Any]):
    """JSON values as compressed text: a mark, and deflate with the words of most documents."""

    impl = LargeBinary
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Any) -> bytes | None:
        """Return the bytes to store; NULL for None."""
        if value is None:
            return None
        text = json.dumps(value, allow_nan=False, separators=(",", ":"))
        packing = zlib.compressobj(9, zlib.DEFLATED, -_WINDOW_BITS, zdict=_WORDS)
        return _MARK + packing.compress(text.encode()) + packing.flush()

    def process_result_value(self, value: bytes | None, dialect: Any) -> Any:
        """Return what the bytes hold."""
        if value is None:
            return None
        if value[:1] != _MARK:
            raise StoreError(f"a document is packed in the form {value[:1]!r}: install the newer sprung that wrote it")
        return json.loads(zlib.decompressobj(-_WINDOW_BITS, zdict=_WORDS).decompress(value[1:]))


_WINDOW_BITS = 13
#: Form of packed documents, and the words that they refer to: for other words, take another mark and read both.
_MARK = b"\x01"
_WORDS = (
    b'{"time":17,"components":["axle2_left.spring","axle2_left.damper","axle2_left.tyre","axle2_right.spring",'
    b'"front_left.spring","front_left.damper","front_left.tyre","front_right.spring","front_right.damper",'
    b'"front_right.tyre","rear_left.spring","rear_left.damper","rear_left.tyre","rear_right.spring",'
    b'"rear_right.damper","rear_right.tyre"],"log_ratios":[0.00,-0.00],"covariance":[[0.00,0.00],[0.00,0.00]],'
    b'"conditions":{"speed":1,"speed_std":0.,"rms":0.,"temperature":,"standing":0.0,"model_error":0.0,"segments":1,'
    b'"roughness":1e-05,"payload":1},"modes":{"bounce":[1.,0.],"pitch":[1.,0.],"roll":[1.,0.]},"sensor_faults":'
    b'[{"channel":"acc_fl","kind":"dead","detail":""}],"reason":"","missing":[],"notes":[]}'
    b'{"modes":[],"reason":"","is_on_board":true}{"modes":[{"natural_frequency":1.5,"natural_frequency_std":0.0,'
    b'"damping_ratio":0.2,"damping_ratio_std":0.0,"mode_shape":{"real":[0.9,1.0,-0.9,-1.0],"imag":[0.0,-0.0,0.0,'
    b'-0.0]},"mode_shape_std":null,"mpc":0.9,"label":"wheel_hop","stable_rate":1.0},{"natural_frequency":1.,'
    b'"mpc":0.99,"label":null,"stable_rate":0.9},{"natural_frequency":1.7,"mpc":0.9,"label":"bounce","stable_rate":'
    b'0.8},{"natural_frequency":1.,"label":"pitch","stable_rate":0.7},{"natural_frequency":2.,"natural_frequency_std":'
    b'0.0,"damping_ratio":0.1,"damping_ratio_std":0.0,"mode_shape":{"real":[1.0,0.9,0.'
    b'],"imag":[0.0,-0.0]},"mode_shape_std":null,"mpc":0.9,"label":"roll","stable_rate":0.6}],"reason":""}'
)

METADATA = MetaData()

# SQLite counts up only what is called INTEGER; that has 64 bits there.
_INTEGER = BigInteger().with_variant(Integer, "sqlite")


#: Type of the column for a field of some type; what is in none of them is JSON.
_TYPES: dict[Any, Any] = {int: _INTEGER, str: Text, bool: Boolean, bytes: LargeBinary}


def _key(name: str, kind: type[Text] | BigInteger) -> Column[object]:
    """Return a column of a primary key that is always given."""
    return Column(name, kind, primary_key=True, autoincrement=False)


def _identity() -> Column[object]:
    """Return the column that numbers the rows."""
    return Column("id", _INTEGER, primary_key=True, autoincrement=True)


def _of_alert() -> ForeignKeyConstraint:
    """Return the condition that the alert of a row exists."""
    return ForeignKeyConstraint(["alert"], ["alerts.id"])


def _table(name: str, row: type, *more: SchemaItem, keys: tuple[str, ...] = ()) -> Table:
    """Return a table whose columns are the fields of a kind of rows; without keys `id` numbers them."""
    columns: list[Column[Any]] = []
    for field, hint in get_type_hints(row).items():
        kind = get_args(hint)[0] if isinstance(hint, UnionType) else hint
        if field in keys:
            columns.append(_key(field, _TYPES[kind]))
        elif field == "id":
            columns.append(_identity())
        else:
            is_optional = isinstance(hint, UnionType) or hint is Any
            columns.append(Column(field, _TYPES.get(kind, Json), nullable=is_optional))
    return Table(name, METADATA, *columns, *more)


VEHICLES = _table("vehicles", VehicleRow, keys=("vehicle",))
#: Frames that arrived and are not yet analysed.
FRAMES = _table("frames", StoredFrame, keys=("vehicle", "boot", "seq"))
CURSORS = _table("cursors", Cursor, _key("vehicle", Text), _key("boot", _INTEGER))
#: Newest boot of a vehicle whose progress was deleted: frames of it and of earlier boots are repeats.
FORGOTTEN = Table("forgotten", METADATA, _key("vehicle", Text), Column("boot", _INTEGER, nullable=False))


def _entries(name: str, *more: Column[object]) -> Table:
    """Return a table of documents, each about a numbered stretch of time."""
    return Table(
        name,
        METADATA,
        _key("vehicle", Text),
        _key("boot", _INTEGER),
        _key("number", _INTEGER),
        *more,
        Column("t0", _INTEGER, nullable=False),
        Column("document", Packed, nullable=False),
        Column("stored", _INTEGER, nullable=False),
        Index(f"{name}_in_time", "vehicle", "t0"),
        Index(f"{name}_stored", "stored"),
    )


OBSERVATIONS = _entries("observations")
MODES = _entries("modes")
#: A window may have several findings, which `place` distinguishes.
FINDINGS = _entries("findings", _key("place", _INTEGER))

BASELINES = _table("baselines", BaselineRow, keys=("vehicle", "version"))
SNAPSHOTS = _table("snapshots", Snapshot, keys=("vehicle",))
#: Frames whose analysis fails, and states that cannot be read (kind "state"), with the reason.
QUARANTINE = _table("quarantine", QuarantineRow, keys=("vehicle", "boot", "seq", "kind"))
#: Progress of the analysis of each vehicle, for people.
STATUSES = Table(
    "statuses",
    METADATA,
    _key("vehicle", Text),
    Column("document", Json, nullable=False),
    Column("is_learning", Boolean, nullable=False, server_default=false()),
)
ALERTS = _table(
    "alerts",
    AlertRow,
    UniqueConstraint("vehicle", "cause", name="alerts_by_cause"),
    Index("alerts_active", "is_active", "vehicle", "severity", "cause"),
)
ALERT_HISTORY = _table("alert_history", HistoryRow, _of_alert(), Index("alert_history_of_alert", "alert"))
#: Notifications: `sent` when every sender had passed them on, `given_up` when the last one settled and any gave up;
#: `attempts` and `last_error` are those of all senders.
NOTIFICATIONS = Table(
    "notifications",
    METADATA,
    _identity(),
    Column("alert", _INTEGER, nullable=False),
    _of_alert(),
    Column("created", _INTEGER, nullable=False),
    Column("document", Json, nullable=False),
    Column("sent", _INTEGER),
    Column("attempts", _INTEGER, nullable=False),
    Column("last_error", Text),
    Column("given_up", _INTEGER),
    Index("notifications_sent", "sent"),
)
#: Progress of each sender with a notification: what one has passed on it does not send again after a restart.
DELIVERIES = _table(
    "deliveries",
    Delivery,
    _key("notification", _INTEGER),
    _key("sender", Text),
    ForeignKeyConstraint(["notification"], ["notifications.id"], ondelete="CASCADE"),
)
AUDIT = _table("audit", AuditRow)
#: Requests of operators to the running monitor.
COMMANDS = _table("commands", CommandRow, Index("commands_done", "done"))
#: Verdicts of the workshop on alerts, and the work that was done.
VERDICTS = _table("verdicts", VerdictRow, _of_alert(), Index("verdicts_of_alert", "alert"))
#: People who may log in; the password only as a salted hash.
ACCOUNTS = _table("accounts", AccountRow, keys=("name",))
#: Browsers that are logged in, by the hash of their secret.
SESSIONS = Table(
    "sessions",
    METADATA,
    _key("digest", Text),
    Column("account", Text, ForeignKey("accounts.name", ondelete="CASCADE"), nullable=False),
    Column("created", _INTEGER, nullable=False),
    Column("expires", _INTEGER, nullable=False),
)
#: Programs that may use the interface, by the hash of their secret.
TOKENS = _table("tokens", TokenRow, UniqueConstraint("digest"))
#: Version of these tables in a store, one row: `SCHEMA_VERSION` of the program that made it.
SCHEMA = Table("schema_version", METADATA, Column("version", Integer, primary_key=True, autoincrement=False))
SCHEMA_VERSION = 1

#: Severities of a step: 1 to 200 are the first, 801 to 1000 the fifth.
STEP_SIZE = 200


def in_steps(severity: ColumnElement[int], steps: Iterable[int]) -> ColumnElement[bool]:
    """Return the condition for severities of some steps, 0 to 4."""
    ranges = ((STEP_SIZE * step, STEP_SIZE * (step + 1)) for step in steps)
    return or_(false(), *(and_(severity > low, severity <= high) for low, high in ranges))
