"""What the store holds of a vehicle whose state is lost."""

from sprung.monitor.states import History
from sprung.storage import Store


def history_of(store: Store, vehicle: str, *, most_windows: int) -> History:
    """Return what the store holds of a vehicle, with at most the last windows since its baseline.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    most_windows
        Largest number of windows.

    Raises
    ------
    StoreError
        If the store cannot be read.
    """
    results = store.results
    n_windows, n_identified = results.n_numbered(vehicle)
    if not n_windows:  # modes before the first window are identified again, with the same numbers
        return History()
    baselines = results.baselines(vehicle)
    if not baselines:
        return History(n_windows=n_windows, n_identified=n_identified)
    baseline = baselines[-1].document
    taught = max(baseline.get("taught") or [float("inf")])
    documents = [entry.document for entry in results.observations(vehicle, limit=most_windows)]
    status = results.status(vehicle) or {}
    return History(
        baseline,
        tuple(document for document in documents if document["time"] > taught),
        n_windows,
        n_identified,
        _last_reason(store, vehicle) if status.get("is_learning") else "",
    )


def _last_reason(store: Store, vehicle: str) -> str:
    """Return the reason of the last request for a new baseline."""
    requests = reversed(store.requests.audited(limit=1000))
    reasons = (row.detail for row in requests if (row.act, row.subject) == ("learn", vehicle))
    return str(next(reasons, None) or "maintenance")
