"""Figures of alerts, from the stored state of their vehicle."""

import io
import logging

from sprung.diagnosis import Baseline, Diagnosis
from sprung.errors import SprungError
from sprung.online.alerts import is_of_suspension
from sprung.online.monitor.engine import MonitorSettings
from sprung.online.monitor.jobs import Opening, open_monitor
from sprung.online.store import Store

LOG = logging.getLogger("sprung.monitor")

#: Resolution [dots per inch]: 950 pixels wide, which mail programs show whole.
_RESOLUTION = 100


def alert_picture(store: Store, vehicle: str, cause: str) -> bytes:
    """Return the springs, dampers and tyres of a vehicle against its baseline as PNG, since the onset of a finding.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    cause
        Cause of the alert.

    Returns
    -------
    bytes
        The picture; empty for an alert that is not of the suspension, and where the store has no diagnosis. A picture
        that cannot be drawn is only logged: it must not keep the alert from being sent.
    """
    if not is_of_suspension(cause):
        return b""
    try:
        present = assessed(store, vehicle)
        return b"" if present is None else _drawn(*present)
    except (SprungError, ValueError, OSError) as error:
        LOG.warning("an alert is sent without a picture", extra={"vehicle": vehicle, "reason": str(error)})
        return b""


def assessed(store: Store, vehicle: str) -> tuple[Diagnosis, Baseline | None] | None:
    """Return the last diagnosis of a vehicle and its baseline; None without a change test."""
    row, snapshot = store.inbox.vehicle(vehicle), store.results.snapshot(vehicle)
    if row is None or snapshot is None:
        return None
    opening = Opening(vehicle, row.description, dict(row.channels), snapshot.document, MonitorSettings())
    monitor, _ = open_monitor(opening)
    if monitor.diagnosis is None or monitor.diagnosis.detection is None:
        return None
    return monitor.diagnosis, None if monitor.is_learning else monitor.baseline


def _drawn(diagnosis: Diagnosis, baseline: Baseline | None) -> bytes:
    """Return the figure of the corners."""
    from sprung.results.figures import corner_changes_figure

    file = io.BytesIO()
    corner_changes_figure(diagnosis, baseline).savefig(file, format="png", dpi=_RESOLUTION)
    return file.getvalue()
