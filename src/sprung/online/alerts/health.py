"""The health index: one number for planning."""

from collections.abc import Iterable

from sprung.online.alerts.alerts import WATCHING, Alert, is_of_suspension


def health_index(alerts: Iterable[Alert]) -> float:
    """Return the health of a vehicle from 0 (inspect first) to 100 (no active alert).

    Parameters
    ----------
    alerts
        Alerts of one vehicle.

    Notes
    -----
    100 - max(w severity / 10) over the active alerts, with w = 1 for the suspension, 1/3 for sensors, and 0 for what
    only concerns monitoring ("silent", "lost", "monitor"). A critical change (900) gives 10, a dead sensor of severity
    600 gives 80.

    The index ranks vehicles for planning only: it neither raises nor clears alerts. A shelved or acknowledged alert
    counts like any other, as neither repairs the vehicle. For a vehicle that is silent or could not be assessed, 100
    means an unknown state, not a sound one.

    Examples
    --------
    >>> health_index([])
    100.0
    """
    return 100.0 - max((_weight(alert.cause) * alert.severity / 10 for alert in alerts if alert.is_active), default=0.0)


def _weight(cause: str) -> float:
    """Return the weight of a cause."""
    if is_of_suspension(cause):
        return 1.0
    return 0.0 if cause.partition(":")[0] in WATCHING else 1 / 3
