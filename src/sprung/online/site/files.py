"""Files about a vehicle and period: reports, one at a time, and exports."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import quote

from sprung.online.monitor.exports import FileFormat, What, export
from sprung.online.monitor.vehicle_report import vehicle_report
from sprung.online.site.busy import BusyError
from sprung.online.site.context import Context
from sprung.results.page import render
from sprung.results.periods import Period

#: Time after which a report that could not begin may be tried again [s].
RETRY = 10
_DRAWING = threading.Lock()


def report_page(context: Context, vehicle: str, *, period: Period) -> str:
    """Return the report of a vehicle and period as an HTML page.

    Raises
    ------
    BusyError
        If another report is being written: its figures take memory and a processor.
    ParameterError
        If the vehicle is unknown.
    """
    with _alone():
        return render(vehicle_report(context.store, vehicle, period=period, now=context.clock()))


def export_pieces(
    context: Context, vehicle: str, what: What, *, file_format: FileFormat, period: Period
) -> Iterator[bytes]:
    """Return an iterator over the pieces of an export; parameters and errors as for `exports.export`."""
    return export(context.store, vehicle, what, file_format=file_format, period=period)


def disposition(kind: str, name: str) -> str:
    """Return the header that names a file.

    Parameters
    ----------
    kind
        "attachment", which is saved, or "inline", which is shown.
    name
        Name of the file.
    """
    plain = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
    plain = plain.encode("ascii", "replace").decode().replace("?", "_")
    return f"{kind}; filename=\"{plain}\"; filename*=UTF-8''{quote(name, safe='')}"


@contextmanager
def _alone() -> Iterator[None]:
    """Keep other reports from beginning, or refuse this one."""
    if not _DRAWING.acquire(blocking=False):
        raise BusyError(f"another report is being written: try again in {RETRY} s")
    try:
        yield
    finally:
        _DRAWING.release()
