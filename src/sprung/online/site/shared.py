"""What requests share: the store, the settings and the running monitor, and types of what routes take and return."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from math import isfinite
from typing import Annotated, Any

from fastapi import Depends, Path, Query, Request
from pydantic import BaseModel, ConfigDict, Field

from sprung.errors import ParameterError
from sprung.online.monitor import Site
from sprung.online.store import Store

#: Texts of people, short enough for a table.
Line = Annotated[str, Field(max_length=200)]
Text = Annotated[str, Field(max_length=4000)]
#: Numbers of rows, boots and windows, and times, as columns hold them.
Number = Annotated[int, Path(ge=1, lt=2**63)]
Place = Annotated[int, Path(ge=0, lt=2**63)]
Time = Annotated[int | None, Query(ge=0, lt=2**63, description="UTC ns")]
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
    troubles
        Function that returns a sentence about each problem of the monitor; it needs no store.
    clock
        Present time, UTC ns.
    timer
        Present time [s] of a monotonic clock.
    """

    store: Store
    site: Site
    figures: Callable[[], Mapping[str, float]]
    troubles: Callable[[], list[str]]
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
    if not 0 <= number < 2**63:
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
