"""Tables of the store.

Times are UTC nanoseconds. `boot` counts the starts of a box, `seq` its frames since then, from 0.
"""

import json
import zlib
from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    TypeDecorator,
    UniqueConstraint,
    false,
)

from sprung.errors import SprungError


class StoreError(SprungError):
    """A store that cannot be opened, read or written."""


class RefusedError(StoreError):
    """Values that no row can hold: the store itself is sound, and stores others."""


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


def _key(name: str, kind: type[Text] | BigInteger) -> Column[object]:
    """Return a column of a primary key that is always given."""
    return Column(name, kind, primary_key=True, autoincrement=False)


def _identity() -> Column[object]:
    """Return the column that numbers the rows."""
    return Column("id", _INTEGER, primary_key=True, autoincrement=True)


def _of_alert() -> Column[object]:
    """Return the column with the alert that a row belongs to."""
    return Column("alert", _INTEGER, ForeignKey("alerts.id"), nullable=False)


VEHICLES = Table(
    "vehicles",
    METADATA,
    _key("vehicle", Text),
    Column("configuration", Text, nullable=False),
    Column("description", Text, nullable=False),
    Column("channels", Json, nullable=False),
    Column("first_seen", _INTEGER, nullable=False),
    Column("last_seen", _INTEGER, nullable=False),
    Column("is_parked", Boolean, nullable=False, server_default=false()),
)

#: Frames that arrived and are not yet analysed.
FRAMES = Table(
    "frames",
    METADATA,
    _key("vehicle", Text),
    _key("boot", _INTEGER),
    _key("seq", _INTEGER),
    Column("t0", _INTEGER, nullable=False),
    Column("kind", Text, nullable=False),
    Column("payload", LargeBinary, nullable=False),
)

CURSORS = Table(
    "cursors",
    METADATA,
    _key("vehicle", Text),
    _key("boot", _INTEGER),
    Column("contiguous", _INTEGER, nullable=False),
    Column("done", _INTEGER, nullable=False),
    Column("lost", _INTEGER, nullable=False),
    Column("updated", _INTEGER, nullable=False),
)


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

BASELINES = Table(
    "baselines",
    METADATA,
    _key("vehicle", Text),
    _key("version", _INTEGER),
    Column("created", _INTEGER, nullable=False),
    Column("reason", Text, nullable=False),
    Column("document", Json, nullable=False),
)

SNAPSHOTS = Table(
    "snapshots",
    METADATA,
    _key("vehicle", Text),
    Column("boot", _INTEGER, nullable=False),
    Column("seq", _INTEGER, nullable=False),
    Column("document", LargeBinary, nullable=False),
)

#: Frames whose analysis fails, and states that cannot be read (kind "state"), with the reason.
QUARANTINE = Table(
    "quarantine",
    METADATA,
    _key("vehicle", Text),
    _key("boot", _INTEGER),
    _key("seq", _INTEGER),
    _key("kind", Text),
    Column("t0", _INTEGER, nullable=False),
    Column("payload", LargeBinary, nullable=False),
    Column("reason", Text, nullable=False),
    Column("stored", _INTEGER, nullable=False),
)

#: Progress of the analysis of each vehicle, for people.
STATUSES = Table(
    "statuses",
    METADATA,
    _key("vehicle", Text),
    Column("document", Json, nullable=False),
    Column("is_learning", Boolean, nullable=False, server_default=false()),
)

ALERTS = Table(
    "alerts",
    METADATA,
    _identity(),
    Column("vehicle", Text, nullable=False),
    Column("cause", Text, nullable=False),
    Column("severity", Integer, nullable=False),
    Column("text", Text, nullable=False),
    Column("is_active", Boolean, nullable=False),
    Column("is_acknowledged", Boolean, nullable=False),
    Column("shelved_until", _INTEGER),
    Column("raised", _INTEGER, nullable=False),
    Column("updated", _INTEGER, nullable=False),
    Column("cleared", _INTEGER),
    Column("count", _INTEGER, nullable=False),
    Column("assignee", Text),
    Column("document", Json, nullable=False),
    UniqueConstraint("vehicle", "cause", name="alerts_by_cause"),
    Index("alerts_active", "is_active", "vehicle", "severity", "cause"),
)

ALERT_HISTORY = Table(
    "alert_history",
    METADATA,
    _identity(),
    _of_alert(),
    Column("time", _INTEGER, nullable=False),
    Column("what", Text, nullable=False),
    Column("who", Text, nullable=False),
    Column("comment", Text, nullable=False),
    Column("assignee", Text),
    Column("shelved_until", _INTEGER),
    Index("alert_history_of_alert", "alert"),
)

#: Notifications: `sent` when every sender had passed them on, `given_up` when the last one settled and any gave up;
#: `attempts` and `last_error` are those of all senders.
NOTIFICATIONS = Table(
    "notifications",
    METADATA,
    _identity(),
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
DELIVERIES = Table(
    "deliveries",
    METADATA,
    Column(
        "notification",
        _INTEGER,
        ForeignKey("notifications.id", ondelete="CASCADE"),
        primary_key=True,
        autoincrement=False,
    ),
    _key("sender", Text),
    Column("attempts", _INTEGER, nullable=False),
    Column("next_attempt", _INTEGER),
    Column("sent", _INTEGER),
    Column("given_up", _INTEGER),
    Column("last_error", Text),
)

AUDIT = Table(
    "audit",
    METADATA,
    _identity(),
    Column("time", _INTEGER, nullable=False),
    Column("who", Text, nullable=False),
    Column("act", Text, nullable=False),
    Column("subject", Text, nullable=False),
    Column("detail", Json),
)

#: Requests of operators to the running monitor.
COMMANDS = Table(
    "commands",
    METADATA,
    _identity(),
    Column("created", _INTEGER, nullable=False),
    Column("who", Text, nullable=False),
    Column("vehicle", Text, nullable=False),
    Column("act", Text, nullable=False),
    Column("detail", Json),
    Column("done", _INTEGER),
    Index("commands_done", "done"),
)

#: Verdicts of the workshop on alerts, and the work that was done.
VERDICTS = Table(
    "verdicts",
    METADATA,
    _identity(),
    _of_alert(),
    Column("time", _INTEGER, nullable=False),
    Column("who", Text, nullable=False),
    Column("verdict", Text, nullable=False),
    Column("part", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("raised", _INTEGER, nullable=False),
    Column("request", _INTEGER),
    Index("verdicts_of_alert", "alert"),
)

#: People who may log in; the password only as a salted hash.
ACCOUNTS = Table(
    "accounts",
    METADATA,
    _key("name", Text),
    Column("role", Text, nullable=False),
    Column("password", Text, nullable=False),
    Column("created", _INTEGER, nullable=False),
)

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
TOKENS = Table(
    "tokens",
    METADATA,
    _identity(),
    Column("digest", Text, nullable=False, unique=True),
    Column("name", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("created", _INTEGER, nullable=False),
    Column("created_by", Text, nullable=False),
    Column("expires", _INTEGER),
)

#: Version of these tables in a store, one row: `SCHEMA_VERSION` of the program that made it.
SCHEMA = Table("schema_version", METADATA, Column("version", Integer, primary_key=True, autoincrement=False))
SCHEMA_VERSION = 1
