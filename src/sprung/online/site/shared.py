"""What requests share: the store, the settings and the running monitor, and types of what routes take and return."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from math import isfinite
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Path, Query, Request
from pydantic import BaseModel, ConfigDict, Field

from sprung.errors import ParameterError
from sprung.online.monitor import Site, histories
from sprung.online.store import Entry, Store, VehicleRow
from sprung.online.store.schema import LARGEST


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the server and of its answers."""

    #: Requests of one address: in the long run [1/s], and at once; and number of addresses that are remembered.
    rate: float = 50.0
    burst: float = 300.0
    max_addresses: int = 10_000
    #: Largest head and body of a request [bytes], and number of fields of a form.
    max_head: int = 16_384
    max_body: int = 65_536
    max_fields: int = 50
    #: Longest times for the head and the body of a request, and for a client to take what waits for it [s].
    head_timeout: float = 10.0
    body_timeout: float = 10.0
    write_timeout: float = 20.0
    #: Longest time between requests of a connection, and for requests to end when the server stops [s].
    keep_alive: int = 5
    grace: int = 2
    max_connections: int = 600
    #: Lengths of names, of passwords, and of the secrets of browsers without an account.
    max_name: int = 64
    min_password: int = 10
    max_password: int = 200
    min_secret: int = 20
    max_secret: int = 64
    #: Time between polls of the store for live events, and between signs of life [s].
    poll: float = 1.0
    heartbeat: float = 15.0
    #: Events that wait for a listener, which is cut off beyond, and largest number of one poll.
    max_waiting: int = 500
    max_events: int = 1000
    #: Longest time for an answer of the store to /metrics, and for which results of a run are not looked up again [s].
    store_timeout: float = 2.0
    fresh: float = 10.0
    #: Longest time that the diagrams of a window may take [s], their size [bytes], and number of windows kept.
    diagrams_timeout: float = 180.0
    max_diagrams: int = 67_108_864
    max_kept_diagrams: int = 8
    #: Times after which diagrams, and a report, that are being computed may be asked for again [s].
    retry: int = 5
    retry_report: int = 10
    #: Windows of an answer about trends, on a page of the list, in a short list, and of the data quality (8 h).
    max_windows: int = 1000
    page_windows: int = 50
    few_windows: int = 6
    quality_windows: int = 48
    #: Windows, identifications, findings and tests of senders among which the last of a kind is sought.
    max_sought: int = 200
    max_identifications: int = 12
    max_findings: int = 20
    max_tests: int = 200
    #: Length of a window that is not known [s], and lengths of a window after which the next one begins after a gap.
    usual_window: float = 600.0
    gap: float = 1.5
    #: Entries of the audit trail on a page.
    page_entries: int = 100
    #: Digits of a version of a baseline, less than which a number needs.
    max_digits: int = 10
    #: Period of the false alarms that are counted [days].
    false_alarm_days: int = 90


LIMITS = Limits()
Value = TypeVar("Value")
#: Texts of people, short enough for a table.
Line = Annotated[str, Field(max_length=200)]
Text = Annotated[str, Field(max_length=4000)]
Mileage = Annotated[float, Field(ge=0, le=1e7)]
#: Numbers of rows, boots and windows, and times, as columns hold them.
Number = Annotated[int, Path(ge=1, le=LARGEST)]
Place = Annotated[int, Path(ge=0, le=LARGEST)]
Time = Annotated[int | None, Query(ge=0, le=LARGEST, description="UTC ns")]
Limit = Annotated[int, Query(ge=1, le=200)]
VehicleName = Annotated[str, Path(min_length=1, max_length=64)]
#: Name of an account or of a sender.
Name = Annotated[str, Path(max_length=64)]
#: Outcome of an action, by a word in the address of the page that follows.
Outcome = Annotated[str, Query(max_length=20)]


@dataclass(frozen=True, eq=False)
class Context:
    """Context that requests share.

    Parameters
    ----------
    store
        Store of the monitor.
    site
        Settings of the monitor.
    figures
        Function that returns those figures of the running monitor that need no store.
    problems
        Function that returns a sentence about each problem of the monitor; it needs no store.
    advice
        Function that returns a sentence on each type of which a vehicle is to be inspected.
    clock
        Present time, UTC ns.
    timer
        Present time [s] of a monotonic clock.
    """

    store: Store
    site: Site
    figures: Callable[[], Mapping[str, float]]
    problems: Callable[[], list[str]]
    advice: Callable[[], tuple[str, ...]] = tuple
    clock: Callable[[], int] = time.time_ns
    timer: Callable[[], float] = time.monotonic

    @property
    def is_secure(self) -> bool:
        """Whether browsers reach this server by TLS."""
        return self.site.web.certificate is not None or self.site.web.behind_proxy

    @property
    def is_private(self) -> bool:
        """Whether only programs of this machine reach this server."""
        return is_loopback(self.site.http_address[0]) and not self.site.web.behind_proxy

    @property
    def is_open(self) -> bool:
        """Whether no log-in is needed: this machine alone is served, and there are no accounts."""
        return is_loopback(self.site.http_address[0]) and not self.store.accounts.n_accounts()

    @property
    def silent_before(self) -> int:
        """Time, UTC ns, before which the last message of a silent vehicle came."""
        return self.clock() - round(60e9 * self.site.alerts.silent_after_minutes)


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine alone."""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def context_of(request: Request) -> Context:
    """Return the context that requests share."""
    context: Context = request.app.state.context
    return context


Shared = Annotated[Context, Depends(context_of)]


class Answer(BaseModel):
    """A part of an answer."""

    model_config = ConfigDict(frozen=True, from_attributes=True)


class Given(BaseModel):
    """The body of a request: closed to unknown keys."""

    model_config = ConfigDict(extra="forbid", str_strip_whitespace=True)


class Wanted(BaseModel):
    """A filter of a list; the address of its page states it."""

    model_config = ConfigDict(frozen=True)


class Done(Answer):
    """Outcome of an action."""

    sentence: str
    number: int | None = None


def describe_faults(faults: Iterable[Mapping[str, Any]]) -> str:
    """Return what is wrong with values, each with its name."""
    return "; ".join(f"{'.'.join(map(str, fault['loc'])) or 'body'}: {fault['msg']}" for fault in faults)


def column_number(text: str) -> int:
    """Return a number that a column can hold.

    Raises
    ------
    ValueError
        If it is none.
    """
    number = int(text)
    if not 0 <= number <= LARGEST:
        raise ValueError(f"{number} is not the number of a column")
    return number


def parse_cursor(cursor: str, *kinds: Callable[[str], Any]) -> tuple[Any, ...]:
    """Return the values in a cursor, the last of which may contain its separator.

    Raises
    ------
    ParameterError
        If it is no cursor.

    Examples
    --------
    >>> parse_cursor("700~tram~1", column_number, str)
    (700, 'tram~1')
    """
    parts = cursor.split("~", len(kinds) - 1)
    try:
        return tuple(kind(part) for kind, part in zip(kinds, parts, strict=True))
    except ValueError:
        raise ParameterError(f"cursor {cursor!r} is not one of this list: omit it for the first page") from None


def finite(value: Any) -> float | None:
    """Return a number of a document; None for anything else.

    Examples
    --------
    >>> [finite(value) for value in (1, float("nan"), True, "fast")]
    [1.0, None, None, None]
    """
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and isfinite(value) else None


def require_vehicle(context: Shared, vehicle: VehicleName) -> VehicleRow:
    """Return a vehicle as it described itself.

    Raises
    ------
    ParameterError
        If it is unknown.
    """
    return histories.require_vehicle(context.store, vehicle)


KnownVehicle = Annotated[VehicleRow, Depends(require_vehicle)]


def require_window(context: Shared, row: KnownVehicle, boot: Place, number: Place) -> Entry:
    """Return a stored window.

    Raises
    ------
    ParameterError
        If the vehicle or the window is unknown.
    """
    vehicle = row.vehicle
    entry = context.store.results.observation(vehicle, boot, number)
    if entry is None:
        raise ParameterError(f"unknown window {boot}/{number} of {vehicle}: it was never analysed or is no longer kept")
    return entry


KnownWindow = Annotated[Entry, Depends(require_window)]
