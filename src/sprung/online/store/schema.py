"""Rows of the store, and the tables that hold them.

Times are UTC nanoseconds. `boot` counts the starts of a box, `seq` its frames since then, from 0.
"""

import json
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from types import UnionType
from typing import Any, NamedTuple, TypeAlias, get_args, get_type_hints

import sqlalchemy as sa
from sqlalchemy.schema import SchemaItem

from sprung.errors import ParameterError, SprungError
from sprung.state import STEP_SIZE, AlertState

#: Values that JSON can hold, without NaN and infinities.
Document: TypeAlias = dict[str, Any]
#: Number of a window, its t0, its document.
Numbered: TypeAlias = tuple[int, int, Document]


#: Largest number of a column, and a day [ns].
LARGEST = 2**63 - 1
DAY = 86_400_000_000_000


class StoreError(SprungError):
    """A store that cannot be opened, read or written."""


class RefusedError(StoreError):
    """Values that no row can hold: the store itself works, and stores others."""


class ReservationLostError(SprungError):
    """The store is no longer reserved for this monitor, which must stop; nothing was written."""


class Json(sa.TypeDecorator[Any]):
    """JSON values as text, so that both databases refuse NaN and infinities, and keep the order of names."""

    impl = sa.Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Any) -> str | None:
        """Return the text to store; NULL for None."""
        return None if value is None else json.dumps(value, allow_nan=False, separators=(",", ":"))

    def process_result_value(self, value: str | None, dialect: Any) -> Any:
        """Return what the text holds."""
        return None if value is None else json.loads(value)


class Packed(sa.TypeDecorator[Any]):
    """JSON values as compressed text: a mark, and deflate with the words of most documents."""

    impl = sa.LargeBinary
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


def check_count(name: str, value: int, *, at_least: int = 0) -> int:
    """Return `value` if it is a whole number that a column holds.

    Raises
    ------
    ParameterError
        If the value is not a whole number of that range.
    """
    if not isinstance(value, int) or not at_least <= value <= LARGEST:
        raise ParameterError(f"{name}={value!r} must be a whole number from {at_least} to 2^63 - 1")
    return value


class StoredFrame(NamedTuple):
    """A frame, or a report of a box that identifies on board, as it waits in the inbox.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    boot, seq
        Number of the box's start, and of the frame since then.
    t0
        Time of the first sample.
    payload
        Bytes as they came.
    kind
        "raw", "corr" or "modes".
    """

    vehicle: str
    boot: int
    seq: int
    t0: int
    payload: bytes
    kind: str = "raw"


@dataclass(frozen=True, slots=True)
class Cursor:
    """Progress of the frames of one boot of a vehicle.

    Parameters
    ----------
    contiguous
        Sequence number up to which every frame arrived or is lost; -1 before the first.
    done
        Sequence number up to which they are analysed; -1 before the first.
    lost
        Number of frames declared lost.
    updated
        Time when `contiguous` last changed.
    """

    contiguous: int = -1
    done: int = -1
    lost: int = 0
    updated: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class VehicleRow:
    """A vehicle as it described itself: hash and text of its configuration, names of its channels.

    It is parked if it was shut down properly.
    """

    vehicle: str
    configuration: str
    description: str
    channels: list[Any]
    first_seen: int
    last_seen: int
    is_parked: bool = False


@dataclass(frozen=True, slots=True)
class Entry:
    """An observation, modes or a finding: the document about the window `number` that begins at `t0`."""

    vehicle: str
    boot: int
    number: int
    t0: int
    document: Document


@dataclass(frozen=True, slots=True)
class BaselineRow:
    """One version of the baseline of a vehicle."""

    vehicle: str
    version: int
    created: int
    reason: str
    document: Document


@dataclass(frozen=True, slots=True)
class Snapshot:
    """State of the analysis of a vehicle after the frame `seq`, from which it continues after a restart."""

    vehicle: str
    boot: int
    seq: int
    document: bytes


@dataclass(frozen=True, slots=True)
class QuarantineRow:
    """A frame whose analysis fails, or a state that cannot be read (kind "state"), and the reason."""

    vehicle: str
    boot: int
    seq: int
    kind: str
    t0: int
    payload: bytes
    reason: str
    stored: int


@dataclass(frozen=True, slots=True)
class Progress:
    """Results of the analysis of frames of one boot; stored as a whole or not at all.

    Parameters
    ----------
    vehicle, boot
        Vehicle and boot of the frames.
    done_seq
        Sequence number up to which they are analysed.
    delete_through_seq
        Sequence number up to which they are deleted, at most `done_seq`; -1 keeps all.
    observations, modes, findings
        Documents, each with the number of its window and t0. The findings of one window belong in one progress.
    baselines
        Version, time, reason and document of each new baseline.
    snapshot
        State after `done_seq`; None: not stored.
    status
        Progress of the analysis for people, any JSON; None: not stored.
    now
        Present time, from which the age of the results counts; 0: from their t0 on.
    modes_from
        Number from which stored modes are of an attempt before a restart, and are removed; None: none are.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    vehicle: str
    boot: int
    done_seq: int
    delete_through_seq: int = -1
    observations: tuple[Numbered, ...] = ()
    modes: tuple[Numbered, ...] = ()
    findings: tuple[Numbered, ...] = ()
    baselines: tuple[tuple[int, int, str, Document], ...] = ()
    snapshot: bytes | None = None
    status: Document | None = None
    now: int = 0
    modes_from: int | None = None

    def __post_init__(self) -> None:
        check_count("boot", self.boot)
        check_count("done_seq", self.done_seq, at_least=-1)
        check_count("delete_through_seq", self.delete_through_seq, at_least=-1)
        if self.delete_through_seq > self.done_seq:
            raise ParameterError(
                f"delete_through_seq={self.delete_through_seq} is beyond done_seq={self.done_seq}: "
                f"frames stay until they are analysed"
            )


@dataclass(frozen=True, slots=True)
class AlertFilter:
    """Which alerts are listed.

    Parameters
    ----------
    states
        Names of states in the terms of ISA-18.2; none: all.
    steps
        Steps of severity, 0 to 4; none: all.
    vehicle
        Part of the vehicle's name.
    assignee
        Name of the assignee; None: any.
    """

    states: tuple[str, ...] = ()
    steps: tuple[int, ...] = ()
    vehicle: str = ""
    assignee: str | None = None


class AlertPlace(NamedTuple):
    """Place of an alert in lists."""

    severity: int
    raised: int
    id: int


@dataclass(frozen=True, slots=True)
class HistoryRow:
    """Event of an alert: what, by whom, and assignee and end of the shelving after it."""

    id: int
    alert: int
    time: int
    what: str
    who: str
    comment: str
    assignee: str | None = None
    shelved_until: int | None = None


@dataclass(frozen=True, slots=True)
class Delivery:
    """Progress of one sender with a notification; it is settled once `sent` or `given_up` is a time.

    Parameters
    ----------
    attempts
        Number of attempts.
    next_attempt
        Time of the next attempt; None: at once.
    sent, given_up
        Time when the sender passed it on, or gave it up.
    last_error
        Reason of the last failure; None after a success.
    """

    attempts: int = 0
    next_attempt: int | None = None
    sent: int | None = None
    given_up: int | None = None
    last_error: str | None = None


@dataclass(frozen=True, slots=True)
class NotificationRow:
    """Notification about an alert, and the progress of the sender for which it was looked up."""

    id: int
    alert: int
    created: int
    document: Document
    delivery: Delivery


@dataclass(frozen=True, slots=True)
class AuditRow:
    """Who did what to what."""

    id: int
    time: int
    who: str
    act: str
    subject: str
    detail: Any


@dataclass(frozen=True, slots=True)
class CommandRow:
    """Request of an operator to the running monitor; `done` is None until it is completed."""

    id: int
    created: int
    who: str
    vehicle: str
    act: str
    detail: Any
    done: int | None


@dataclass(frozen=True, slots=True)
class AccountRow:
    """A person: name, role and salted hash of the password."""

    name: str
    role: str
    password: str = field(repr=False)
    created: int


@dataclass(frozen=True, slots=True)
class TokenRow:
    """A program that may use the interface until `expires`; `digest` is the hash of its secret."""

    digest: str = field(repr=False)
    name: str
    role: str
    created: int
    created_by: str
    expires: int | None = None
    id: int | None = None


@dataclass(frozen=True, slots=True)
class VerdictRow:
    """Verdict of the workshop on an alert.

    Parameters
    ----------
    alert
        Number of the alert.
    time, who
        Time of the verdict [UTC ns], and person who stated it.
    verdict
        "confirmed", "another part", "nothing found" or "not looked at".
    part
        Part that was found instead; empty for none.
    action
        Work that was done; empty: none.
    raised
        Time when the alert was raised.
    request
        Number of the request for a new baseline; None: none.
    id
        Number of the row; None before it is stored.
    """

    alert: int
    time: int
    who: str
    verdict: str
    part: str
    action: str
    raised: int
    request: int | None = None
    id: int | None = None


METADATA = sa.MetaData()

# SQLite counts up only what is called INTEGER; that has 64 bits there.
_INTEGER = sa.BigInteger().with_variant(sa.Integer, "sqlite")


#: Type of the column for a field of some type; what is in none of them is JSON.
_TYPES: dict[Any, Any] = {int: _INTEGER, str: sa.Text, bool: sa.Boolean, bytes: sa.LargeBinary}


def _key(name: str, kind: type[sa.Text] | sa.BigInteger) -> sa.Column[object]:
    """Return a column of a primary key that is always given."""
    return sa.Column(name, kind, primary_key=True, autoincrement=False)


def _identity(name: str = "id") -> sa.Column[object]:
    """Return the column that numbers the rows."""
    return sa.Column(name, _INTEGER, primary_key=True, autoincrement=True)


def _of_alert() -> sa.ForeignKeyConstraint:
    """Return the condition that the alert of a row exists."""
    return sa.ForeignKeyConstraint(["alert"], ["alerts.number"])


def _table(name: str, row: type, *more: SchemaItem, keys: tuple[str, ...] = ()) -> sa.Table:
    """Return a table whose columns are the fields of a kind of rows; without keys `id` or `number` numbers them."""
    columns: list[sa.Column[Any]] = []
    for name_of, hint in get_type_hints(row).items():
        kind = get_args(hint)[0] if isinstance(hint, UnionType) else hint
        if name_of in keys:
            columns.append(_key(name_of, _TYPES[kind]))
        elif name_of in {"id", "number"}:
            columns.append(_identity(name_of))
        else:
            is_optional = isinstance(hint, UnionType) or hint is Any
            columns.append(sa.Column(name_of, _TYPES.get(kind, Json), nullable=is_optional))
    return sa.Table(name, METADATA, *columns, *more)


VEHICLES = _table("vehicles", VehicleRow, keys=("vehicle",))
#: Frames that arrived and are not yet analysed.
FRAMES = _table("frames", StoredFrame, keys=("vehicle", "boot", "seq"))
CURSORS = _table("cursors", Cursor, _key("vehicle", sa.Text), _key("boot", _INTEGER))
#: Newest boot of a vehicle whose progress was deleted: frames of it and of earlier boots are repeats.
FORGOTTEN = sa.Table("forgotten", METADATA, _key("vehicle", sa.Text), sa.Column("boot", _INTEGER, nullable=False))


def _entries(name: str, *more: sa.Column[object]) -> sa.Table:
    """Return a table of documents, each about a numbered stretch of time."""
    return sa.Table(
        name,
        METADATA,
        _key("vehicle", sa.Text),
        _key("boot", _INTEGER),
        _key("number", _INTEGER),
        *more,
        sa.Column("t0", _INTEGER, nullable=False),
        sa.Column("document", Packed, nullable=False),
        sa.Column("stored", _INTEGER, nullable=False),
        sa.Index(f"{name}_in_time", "vehicle", "t0"),
        sa.Index(f"{name}_stored", "stored"),
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
STATUSES = sa.Table(
    "statuses",
    METADATA,
    _key("vehicle", sa.Text),
    sa.Column("document", Json, nullable=False),
    sa.Column("is_learning", sa.Boolean, nullable=False, server_default=sa.false()),
)
ALERTS = _table(
    "alerts",
    AlertState,
    sa.UniqueConstraint("vehicle", "cause", name="alerts_by_cause"),
    sa.Index("alerts_active", "is_active", "vehicle", "severity", "cause"),
)
ALERT_HISTORY = _table("alert_history", HistoryRow, _of_alert(), sa.Index("alert_history_of_alert", "alert"))
#: Notifications: `sent` when every sender had passed them on, `given_up` when the last one settled and any gave up;
#: `attempts` and `last_error` are those of all senders.
NOTIFICATIONS = sa.Table(
    "notifications",
    METADATA,
    _identity(),
    sa.Column("alert", _INTEGER, nullable=False),
    _of_alert(),
    sa.Column("created", _INTEGER, nullable=False),
    sa.Column("document", Json, nullable=False),
    sa.Column("sent", _INTEGER),
    sa.Column("attempts", _INTEGER, nullable=False),
    sa.Column("last_error", sa.Text),
    sa.Column("given_up", _INTEGER),
    sa.Index("notifications_sent", "sent"),
)
#: Progress of each sender with a notification: what one has passed on it does not send again after a restart.
DELIVERIES = _table(
    "deliveries",
    Delivery,
    _key("notification", _INTEGER),
    _key("sender", sa.Text),
    sa.ForeignKeyConstraint(["notification"], ["notifications.id"], ondelete="CASCADE"),
)
AUDIT = _table("audit", AuditRow)
#: Requests of operators to the running monitor.
COMMANDS = _table("commands", CommandRow, sa.Index("commands_done", "done"))
#: Verdicts of the workshop on alerts, and the work that was done.
VERDICTS = _table("verdicts", VerdictRow, _of_alert(), sa.Index("verdicts_of_alert", "alert"))
#: People who may log in; the password only as a salted hash.
ACCOUNTS = _table("accounts", AccountRow, keys=("name",))
#: Browsers that are logged in, by the hash of their secret.
SESSIONS = sa.Table(
    "sessions",
    METADATA,
    _key("digest", sa.Text),
    sa.Column("account", sa.Text, sa.ForeignKey("accounts.name", ondelete="CASCADE"), nullable=False),
    sa.Column("created", _INTEGER, nullable=False),
    sa.Column("expires", _INTEGER, nullable=False),
)
#: Programs that may use the interface, by the hash of their secret.
TOKENS = _table("tokens", TokenRow, sa.UniqueConstraint("digest"))
#: Version of these tables in a store, one row: `SCHEMA_VERSION` of the program that made it.
SCHEMA = sa.Table("schema_version", METADATA, sa.Column("version", sa.Integer, primary_key=True, autoincrement=False))
SCHEMA_VERSION = 1


def in_steps(severity: sa.ColumnElement[int], steps: Iterable[int]) -> sa.ColumnElement[bool]:
    """Return the condition for severities of some steps, 0 to 4; -1 for a severity of 0."""
    ranges = ((STEP_SIZE * step, STEP_SIZE * (step + 1)) for step in steps)
    return sa.or_(sa.false(), *(sa.and_(severity > low, severity <= high) for low, high in ranges))
