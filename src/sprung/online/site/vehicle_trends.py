"""Corner values and modes of a vehicle over time, with gaps and events, from the store."""

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from math import isfinite
from typing import Any
from urllib.parse import quote

import numpy as np

from sprung.diagnosis import Observation
from sprung.online.monitor.histories import observations_of, reference_of
from sprung.online.site.vehicle_models import ModeTrend, ModeValue, PartTrend, TimeMark, Trends
from sprung.online.store import Entry, Store
from sprung.state import Reference, interval_95
from sprung.vehicles.labels import MOTIONS

#: Largest number of windows in an answer.
MOST_WINDOWS = 1000
#: Length of a window that is not known [s], and lengths of a window after which the next one begins after a gap.
_WINDOW, _GAP = 600.0, 1.5
_MODE_FIELDS = ("natural_frequency", "natural_frequency_std", "damping_ratio", "damping_ratio_std")


def trends(store: Store, vehicle: str, *, since: int | None, until: int) -> Trends:
    """Return parts and modes of a vehicle over time.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    since, until
        Range of the starts of windows, UTC ns; since None: from the first one.
    """
    reference = reference_of(store.results.baselines(vehicle))
    length = round(1e9 * float((store.results.status(vehicle) or {}).get("window") or _WINDOW))
    entries = store.results.observations(vehicle, since=since, until=until, limit=MOST_WINDOWS + 1)
    identified = store.results.last_modes(vehicle, since=since, until=until, limit=MOST_WINDOWS)
    read = observations_of(entries[-MOST_WINDOWS:])
    by_place = {(entry.boot, entry.number): window for entry, window in read}
    rows = list(_with_gaps([entry for entry, _ in read], length))
    windows = [None if entry is None else by_place[entry.boot, entry.number] for _, entry in rows]
    mode_rows = list(_with_gaps(identified, length))
    limits = reference.limits(max(reference.detectable, default=0))
    return Trends(
        reference=reference.in_words,
        since=since,
        until=until,
        times=tuple(time for time, _ in rows),
        windows=tuple(None if entry is None else f"{entry.boot}/{entry.number}" for _, entry in rows),
        remarks=tuple(map(_remark, windows)),
        parts=_parts(reference, windows, limits),
        mode_times=tuple(time for time, _ in mode_rows),
        modes=_modes([entry for _, entry in mode_rows]),
        marks=tuple(_marks(store, vehicle, since or 0, until)),
        is_cut=len(entries) > MOST_WINDOWS,
    )


def body_modes_in(document: dict[str, Any]) -> dict[str, ModeValue]:
    """Return bounce, pitch and roll in the modes of a window, by label; empty if the document has no such modes."""
    found: dict[str, ModeValue] = {}
    for mode in document.get("modes") or ():
        if isinstance(mode, dict) and mode.get("label") in MOTIONS:
            values = [mode.get(name) for name in _MODE_FIELDS]
            if _is_number(values[0]) and _is_number(values[2]):
                found[mode["label"]] = ModeValue(
                    label=mode["label"],
                    **{
                        name: value if _is_number(value) else None
                        for name, value in zip(_MODE_FIELDS, values, strict=True)
                    },
                )
    return found


def _parts(
    reference: Reference, windows: Sequence[Observation | None], limits: dict[str, float]
) -> tuple[PartTrend, ...]:
    """Return every part in windows; those that cannot be compared have no value."""
    accepted = [window for window in windows if window is not None and reference.accepts(window)]
    if not accepted:
        return ()
    components = accepted[-1].components
    values = np.full((3, len(windows), len(components)), np.nan)
    for row, window in enumerate(windows):
        if window is not None and window.components == components and reference.accepts(window):
            middle = _deviation(reference, window)
            ends = interval_95(middle, np.sqrt(np.diag(window.covariance)))
            values[:, row] = np.vstack([np.expm1(middle), ends])
    band = reference.band()
    return tuple(
        PartTrend(
            part=str(component),
            **{name: _nullable(values[k, :, column]) for k, name in enumerate(("change", "low", "high"))},
            band=None if band is None else (float(band[0, column]), float(band[1, column])),
            detectable=limits.get(str(component)),
        )
        for column, component in enumerate(components)
    )


def _deviation(reference: Reference, window: Observation) -> Any:
    """Return the deviation of one window, ln values, shape (components,)."""
    return window.log_ratios if reference.baseline is None else reference.baseline.residual(window)


def _modes(entries: Sequence[Entry | None]) -> tuple[ModeTrend, ...]:
    """Return bounce, pitch and roll over windows, as far as any has them."""
    found = [{} if entry is None else body_modes_in(entry.document) for entry in entries]
    return tuple(
        ModeTrend(
            label=label,
            **{
                name: tuple(getattr(modes[label], name) if label in modes else None for modes in found)
                for name in _MODE_FIELDS
            },
        )
        for label in MOTIONS
        if any(label in modes for modes in found)
    )


def _with_gaps(entries: Sequence[Entry], length: int) -> Iterator[tuple[int, Entry | None]]:
    """Yield time and entry of each window, and a time without an entry where the next one begins after a gap."""
    for entry, following in zip_longest(entries, entries[1:]):
        yield entry.t0, entry
        if following is not None and following.t0 - entry.t0 > _GAP * length:
            yield entry.t0 + length, None


def _remark(window: Observation | None) -> str:
    """Return why a window has no value, or what is wrong with its sensors; empty for a sound one."""
    if window is None:
        return "no data"
    return window.reason or "; ".join(
        f"{fault.channel} {fault.kind.replace('_', ' ')}" for fault in window.sensor_faults
    )


def _marks(store: Store, vehicle: str, since: int, until: int) -> Iterator[TimeMark]:
    """Yield new baselines, verdicts and alerts within a range, in order of time."""
    alerts = [row for row in store.alerts.find(vehicle=vehicle) if row.count and row.id is not None]
    marks = [
        *(
            TimeMark(
                time=row.created,
                kind="baseline",
                text=f"baseline {row.version}: {row.reason}",
                link=f"/vehicles/{quote(vehicle, safe='')}/baseline",
            )
            for row in store.results.baselines(vehicle)
        ),
        *(
            TimeMark(
                time=row.time,
                kind="verdict",
                text=": ".join(text for text in (row.verdict, row.part, row.action) if text),
                link=f"/alerts/{row.alert}",
            )
            for row in store.verdicts.all(alerts=[row.id for row in alerts if row.id is not None])
        ),
        *(TimeMark(time=row.raised, kind="alert", text=row.text, link=f"/alerts/{row.id}") for row in alerts),
    ]
    yield from sorted((mark for mark in marks if since <= mark.time <= until), key=lambda mark: mark.time)


def _nullable(values: Any) -> tuple[float | None, ...]:
    """Return numbers; None for those that are not finite."""
    return tuple(float(value) if isfinite(value) else None for value in values)


def _is_number(value: Any) -> bool:
    """Return whether a value of a document is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
