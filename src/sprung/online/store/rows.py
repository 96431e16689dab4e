"""Values that the store takes and returns. Times are UTC nanoseconds."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

from sprung.errors import ParameterError

#: Values that JSON can hold, without NaN and infinities.
Document: TypeAlias = dict[str, Any]
#: Number of a window, its t0, its document.
Numbered: TypeAlias = tuple[int, int, Document]


def check_count(name: str, value: int, *, at_least: int = 0) -> int:
    """Return `value` if it is a whole number that a column holds.

    Raises
    ------
    ParameterError
        If the value is not a whole number of that range.
    """
    if not isinstance(value, int) or not at_least <= value < 2**63:
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
class AlertRow:
    """Alert of one cause on one vehicle; `id` and `updated` are given by the store."""

    vehicle: str
    cause: str
    severity: int
    text: str
    raised: int
    is_active: bool = True
    is_acknowledged: bool = False
    shelved_until: int | None = None
    cleared: int | None = None
    count: int = 1
    assignee: str | None = None
    document: Document = field(default_factory=dict)
    updated: int = 0
    id: int | None = None


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
