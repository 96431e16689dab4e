"""Diagrams of the windows of a vehicle, as far as their samples are kept."""

from pathlib import Path
from typing import Any

from sprung.errors import ParameterError
from sprung.link.archive import archive_path
from sprung.online.monitor.histories import reference_of
from sprung.online.site.context import Context
from sprung.online.site.diagram_models import WindowDiagrams
from sprung.online.site.diagrams import Computed, NoSamplesError
from sprung.online.site.vehicle_data import require_vehicle, require_window
from sprung.online.store import Entry
from sprung.results.tables import time_in_words

#: Windows among which the last one with samples is sought.
_SOUGHT = 200


def computed_diagrams(context: Context, vehicle: str, boot: int, number: int, *, again: bool = False) -> Computed:
    """Return the diagrams of a window, or why they cannot be computed; begin to compute them if they are not kept.

    Parameters
    ----------
    context
        Context of the requests.
    vehicle
        Name of the vehicle.
    boot, number
        Boot and number of the window.
    again
        Whether diagrams that could not be computed are tried again.

    Raises
    ------
    ParameterError
        If the vehicle or the window is unknown.
    NoSamplesError
        If its samples are not kept.
    BusyError
        If these diagrams, or others, are being computed.
    """
    entry = require_window(context.store, vehicle, boot, number)
    return context.diagrams.take(_request(context, entry), again=again)


def window_diagrams(context: Context, vehicle: str, boot: int, number: int) -> WindowDiagrams:
    """Return the values of the diagrams of a window; errors as for `computed_diagrams`.

    Raises
    ------
    NoSamplesError
        Also if they cannot be computed from its samples.
    """
    entry = require_window(context.store, vehicle, boot, number)
    return shown_diagrams(entry, computed_diagrams(context, vehicle, boot, number))


def shown_diagrams(entry: Entry, computed: Computed) -> WindowDiagrams:
    """Return the values of diagrams with their place.

    Raises
    ------
    NoSamplesError
        If they could not be computed.
    """
    if computed.error:
        raise NoSamplesError(f"The diagrams cannot be computed from the samples of this window: {computed.error}")
    place = {"vehicle": entry.vehicle, "boot": entry.boot, "number": entry.number, "t0": entry.t0}
    return WindowDiagrams.model_validate({**place, **computed.values})


def last_window_with_samples(context: Context, vehicle: str) -> Entry | None:
    """Return the last window of a vehicle whose samples are kept; None if there is none.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    require_vehicle(context.store, vehicle)
    entries = context.store.results.observations(vehicle, limit=_SOUGHT)
    return next((entry for entry in reversed(entries) if _samples(context, entry) is not None), None)


def _samples(context: Context, entry: Entry) -> Path | None:
    """Return the file of the samples of a window; None if they are not kept."""
    if context.site.archive is None:
        return None
    try:
        path = archive_path(context.site.archive, entry.vehicle, entry.boot, entry.number, entry.t0)
    except ParameterError:  # a name that cannot be that of a folder
        return None
    return path if path.exists() else None


def _request(context: Context, entry: Entry) -> dict[str, Any]:
    """Return the request for the diagrams of a window: with the vehicle file that its baseline is in terms of."""
    path, keep = _samples(context, entry), context.site.keep
    if context.site.archive is None:
        raise NoSamplesError(
            "Diagrams are computed from samples, and this monitor keeps none: set keep.raw_days in the site file to "
            "the number of days"
        )
    if path is None:
        raise NoSamplesError(
            f"The samples of this window are no longer kept: the site file keeps them for {keep.raw_days:g} days "
            f"(keep.raw_days) and up to {keep.raw_gigabytes:g} GB of all vehicles (keep.raw_gigabytes); larger values "
            "keep those of later windows longer"
        )
    row = require_vehicle(context.store, entry.vehicle)
    baseline = reference_of(context.store.results.baselines(entry.vehicle)).baseline
    completed = "" if baseline is None else baseline.vehicle_file
    return {
        "samples": str(path),
        "quantities": dict(row.channels),
        "description": completed or row.description,
        "method": context.site.watch.method,
        "source": f"{entry.vehicle}, {time_in_words(entry.t0)} UTC",
    }
