"""Requests of operators to the running monitor: waiting for them, and their outcome."""

import time
from collections.abc import Callable

from sprung.errors import DataError, ParameterError
from sprung.online.monitor.histories import ROLL_BACK
from sprung.online.monitor.site import Site
from sprung.online.store import CommandRow, Store
from sprung.results.tables.wording import format_span, format_time

#: Time between checks of a request [s].
_LOOK = 0.2


def wait_for_samples(
    store: Store, number: int, *, timeout: float, on_progress: Callable[[str, float], None] = lambda step, share: None
) -> str:
    """Wait for the samples of a request, and return a sentence about them.

    Parameters
    ----------
    store
        Store of the monitor.
    number
        Number of the request, from `sprung.online.monitor.operations.request_samples`.
    timeout
        Longest wait [s]; 0: none, the request stays open.
    on_progress
        Callback that receives the current step and the share that is done (0: unknown).

    Raises
    ------
    DataError
        If the box has no such samples, or none arrived in time; the request then stays open.
    ParameterError
        If the request is no longer in the store.
    """
    end = time.monotonic() + timeout
    while (row := _request(store, number)).done is None and time.monotonic() < end:
        on_progress(f"waiting for samples of {row.vehicle}", 0.0)
        time.sleep(_LOOK)
    if row.done is None and not timeout:
        return describe_request(row)
    if row.done is None:
        known = store.inbox.vehicle(row.vehicle)
        seen = "never" if known is None else f"at {format_time(known.last_seen)} UTC"
        raise DataError(
            f"no samples {_span(row.detail)} of {row.vehicle} within {timeout:g} s (last seen {seen}): check that its"
            " box and the monitor run; the request stays open and is sent again when the vehicle is next seen"
        )
    if not row.detail["frames"]:
        raise DataError(f"no samples {_span(row.detail['asked'])} of {row.vehicle}: {row.detail['reason']}")
    return f"received samples {_span(row.detail)} of {row.vehicle}, {row.detail['frames']} frames"


def describe_relearning(vehicle: str, reason: str) -> str:
    """Return the sentence about a request for a new baseline."""
    return (
        f"{vehicle} will relearn its baseline ({reason.strip()!r}) from its next usable windows (learning_windows of"
        f" the site file, default {Site().watch.learning_windows}); change detection resumes after that"
    )


def describe_rollback(vehicle: str, version: int, reason: str) -> str:
    """Return the sentence about a request to return to an earlier baseline."""
    return (
        f"{vehicle} will return to its baseline {version} ({reason.strip()!r}): change detection restarts with its"
        " next window"
    )


def describe_request(row: CommandRow) -> str:
    """Return the sentence about a request that is not yet done."""
    if row.act == "raw":
        what = f"samples {_span(row.detail)}"
    elif row.act == ROLL_BACK:
        what = f"return to baseline {row.detail['version']} ({row.detail['reason']!r})"
    else:
        what = f"new baseline ({row.detail!r})"
    return f"{row.vehicle}: {what} requested at {format_time(row.created)} UTC, not yet done"


def _request(store: Store, number: int) -> CommandRow:
    """Return a request that is still in the store."""
    row = store.requests.command(number)
    if row is None:
        raise ParameterError(f"request {number} is no longer in the store: repeat it")
    return row


def _span(times: dict[str, int]) -> str:
    """Return begin and end of samples in words."""
    return format_span(times["from"], times["to"])
