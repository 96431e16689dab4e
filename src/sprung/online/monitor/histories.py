"""Stored results of a vehicle whose state is lost."""

from dataclasses import replace

from sprung.diagnosis import Baseline
from sprung.errors import FormatError, ParameterError
from sprung.online.monitor.states import History
from sprung.online.store import Store
from sprung.results.documents import baseline_from_document

#: Requests that change the baseline of a vehicle: learn a new one, and return to an earlier one.
LEARN, ROLL_BACK = "learn", "roll back"


def history_of(store: Store, vehicle: str, *, most_windows: int) -> History:
    """Return the stored results of a vehicle, with a limited number of last windows since its baseline.

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
    learning_times = max(baseline.get("learning_times") or [float("inf")])
    documents = [entry.document for entry in results.observations(vehicle, limit=most_windows)]
    status = results.status(vehicle) or {}
    return History(
        baseline,
        tuple(document for document in documents if document["time"] > learning_times),
        n_windows,
        n_identified,
        _last_reason(store, vehicle) if status.get("is_learning") else "",
    )


def restored_baseline(store: Store, vehicle: str, *, version: int, reason: str) -> Baseline:
    """Return an earlier baseline of a vehicle as its next version.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    version
        Version of the earlier baseline.
    reason
        Reason for using it again.

    Raises
    ------
    ParameterError
        If the vehicle has no such baseline, or it cannot be read.
    """
    rows = store.results.baselines(vehicle)
    document = next((row.document for row in rows if row.version == version), None)
    if document is None:
        known = ", ".join(str(row.version) for row in rows) or "none"
        raise ParameterError(f"{vehicle} has no baseline {version}: it has {known}")
    try:
        baseline = baseline_from_document(document)
    except FormatError as error:
        raise ParameterError(f"baseline {version} of {vehicle} cannot be read ({error}): learn a new one") from None
    return replace(baseline, version=rows[-1].version + 1, reason=f"baseline {version} again: {reason}")


def _last_reason(store: Store, vehicle: str) -> str:
    """Return the reason of the last request for a new baseline."""
    requests = reversed(store.requests.audited(limit=1000))
    reasons = (row.detail for row in requests if (row.act, row.subject) == (LEARN, vehicle))
    return str(next(reasons, None) or "maintenance")
