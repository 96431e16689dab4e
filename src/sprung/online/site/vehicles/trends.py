"""Parts and modes of a vehicle over time, with gaps and events, and the motion of the body as last identified."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from math import isfinite
from typing import Any, Literal, TypeVar

import numpy as np
from fastapi import APIRouter
from pydantic import Field

from sprung.diagnosis import Observation
from sprung.errors import FormatError, SprungError
from sprung.modal import Modes
from sprung.online.monitor.histories import observations_of, reference_of
from sprung.online.site.accounts import Viewer
from sprung.online.site.rendering import path_of
from sprung.online.site.shared import LIMITS, Answer, KnownVehicle, Shared, Time, finite
from sprung.online.store import Entry, Store, VehicleRow
from sprung.recording import Channel
from sprung.results.documents.document import Pair
from sprung.results.documents.modes import IdentifiedMode, modes_from_documents
from sprung.state import Reference, interval_95
from sprung.vehicles import vehicle_from_text
from sprung.vehicles.labels import MOTIONS

T = TypeVar("T")

api = APIRouter(tags=["vehicles"])


_MODE_FIELDS = ("natural_frequency", "natural_frequency_std", "damping_ratio", "damping_ratio_std")


class ModeValue(Answer):
    """A mode in a window."""

    label: str
    natural_frequency: float
    natural_frequency_std: float | None = None
    damping_ratio: float
    damping_ratio_std: float | None = None


class PartTrend(Answer):
    """A part over time; null if there is no value."""

    part: str
    change: tuple[float | None, ...]
    low: tuple[float | None, ...]
    high: tuple[float | None, ...]
    band: Pair | None = Field(description="range of 95 % of usual single windows; null without a baseline")


class ModeTrend(Answer):
    """Natural frequency [Hz] and damping ratio of a mode over time; null if it was not identified."""

    label: str
    natural_frequency: tuple[float | None, ...]
    natural_frequency_std: tuple[float | None, ...]
    damping_ratio: tuple[float | None, ...]
    damping_ratio_std: tuple[float | None, ...]


class TimeMark(Answer):
    """An event on the time axis."""

    time: int
    kind: Literal["baseline", "verdict", "alert"]
    text: str
    link: str


class Trends(Answer):
    """Parts and modes over time, oldest first; null values are inconclusive windows, and gaps without samples."""

    reference: str
    since: int | None = Field(description="beginning of the range; null: the first window")
    until: int
    times: tuple[int, ...] = Field(description="starts of the windows of `parts`")
    windows: tuple[str | None, ...] = Field(description="BOOT/NUMBER of each; null: a gap")
    remarks: tuple[str | None, ...] = Field(description="why a window has no value; null where it has one")
    parts: tuple[PartTrend, ...]
    mode_times: tuple[int, ...]
    modes: tuple[ModeTrend, ...]
    marks: tuple[TimeMark, ...]
    is_cut: bool = Field(description="whether older windows of the range are omitted")


class BodyMode(ModeValue):
    """A mode of the body: how its four corners move, as complex numbers of any common scale."""

    real: tuple[float, ...] = Field(description="vertical motion of each of the corners, real part")
    imag: tuple[float, ...]
    explained: float = Field(description="share of the shape that a rigid body explains")


class BodyModes(Answer):
    """The modes of the body that were identified last."""

    time: int | None = Field(description="start of their window")
    corners: tuple[tuple[float, float, float], ...] = Field(
        (), description="front left, front right, rear right, rear left [m]"
    )
    modes: tuple[BodyMode, ...] = ()
    note: str | None = Field(None, description="why there is none; null where there are some")


@api.get("/vehicles/{vehicle}/trends")
def trends(context: Shared, _: Viewer, row: KnownVehicle, *, since: Time = None, until: Time = None) -> Trends:
    """Springs, dampers, tyres and modes of the body over time, at most the last 1000 windows."""
    store = context.store
    vehicle = row.vehicle
    end = context.clock() if until is None else until
    reference = reference_of(store.results.baselines(vehicle))
    length = round(1e9 * float((store.results.status(vehicle) or {}).get("window") or LIMITS.usual_window))
    entries = store.results.observations(vehicle, since=since, until=end, limit=LIMITS.max_windows + 1)
    read = observations_of(entries[-LIMITS.max_windows :])
    rows = list(_with_gaps(read, length))
    windows = [window for _, _, window in rows]
    identified = store.results.last_modes(vehicle, since=since, until=end, limit=LIMITS.max_windows)
    mode_rows = list(_with_gaps([(entry, body_modes_in(entry.document)) for entry in identified], length))
    marks = [mark for mark in _marks(store, vehicle) if (since or 0) <= mark.time <= end]
    return Trends(
        reference=reference.in_words,
        since=since,
        until=end,
        times=tuple(time for time, _, _ in rows),
        windows=tuple(None if entry is None else f"{entry.boot}/{entry.number}" for _, entry, _ in rows),
        remarks=tuple(map(_remark, windows)),
        parts=_parts(reference, windows),
        mode_times=tuple(time for time, _, _ in mode_rows),
        modes=_modes([modes or {} for _, _, modes in mode_rows]),
        marks=tuple(sorted(marks, key=lambda mark: mark.time)),
        is_cut=len(entries) > LIMITS.max_windows,
    )


@api.get("/vehicles/{vehicle}/body-modes")
def body_modes(context: Shared, _: Viewer, row: KnownVehicle) -> BodyModes:
    """Motion of the body in bounce, pitch and roll, as last identified."""
    from sprung.results.figures.shapes import body_shapes

    entry = last_body_modes(context.store, row.vehicle)[0]
    if entry is None:
        return BodyModes(time=None, note="no mode of the body has been identified yet")
    try:
        modes, channels = _modes_on_sensors(row, entry)
        shapes = body_shapes(modes, channels)
    except (SprungError, ValueError) as error:
        return BodyModes(time=entry.t0, note=f"the shapes cannot be drawn: {error}")
    if shapes is None or not np.isfinite(shapes.corner_motions).all():
        return BodyModes(time=entry.t0, note="the sensors do not determine the motion of the body")
    return BodyModes(
        time=entry.t0,
        corners=tuple((float(x), float(y), float(z)) for x, y, z in shapes.corners),
        modes=tuple(
            BodyMode(
                label=str(modes.labels[k]),
                **{name: finite(float(getattr(modes, name)[k])) for name in _MODE_FIELDS},
                real=shapes.corner_motions[k].real.tolist(),
                imag=shapes.corner_motions[k].imag.tolist(),
                explained=float(shapes.explained[k]),
            )
            for k in range(len(modes))
        ),
    )


def last_body_modes(store: Store, vehicle: str) -> tuple[Entry | None, tuple[ModeValue, ...]]:
    """Return bounce, pitch and roll as they were identified last, and where; None and no mode if they never were."""
    for entry in reversed(store.results.last_modes(vehicle, limit=LIMITS.max_identifications)):
        found = body_modes_in(entry.document)
        if found:
            return entry, tuple(found[label] for label in MOTIONS if label in found)
    return None, ()


def body_modes_in(document: Mapping[str, Any]) -> dict[str, ModeValue]:
    """Return bounce, pitch and roll in the modes of a window, by label; empty if the document has no such modes."""
    found = {}
    for mode in document.get("modes") or ():
        if isinstance(mode, dict) and mode.get("label") in MOTIONS:
            values = {name: finite(mode.get(name)) for name in _MODE_FIELDS}
            if None not in (values["natural_frequency"], values["damping_ratio"]):
                found[mode["label"]] = ModeValue.model_validate({"label": mode["label"], **values})
    return found


def _parts(reference: Reference, windows: Sequence[Observation | None]) -> tuple[PartTrend, ...]:
    """Return every part in windows; those that cannot be compared have no value."""
    accepted = {k: each for k, each in enumerate(windows) if each is not None and reference.accepts(each)}
    if not accepted:
        return ()
    components = list(accepted.values())[-1].components
    values = np.full((3, len(windows), len(components)), np.nan)
    for row, window in accepted.items():
        if window.components == components:
            middle = window.log_ratios if reference.baseline is None else reference.baseline.residual(window)
            ends = interval_95(middle, np.sqrt(np.diag(window.covariance)))
            values[:, row] = np.vstack([np.expm1(middle), ends])
    band = reference.band()
    return tuple(
        PartTrend(
            part=str(component),
            **{
                name: [value if isfinite(value) else None for value in values[k, :, column].tolist()]
                for k, name in enumerate(("change", "low", "high"))
            },
            band=None if band is None else (float(band[0, column]), float(band[1, column])),
        )
        for column, component in enumerate(components)
    )


def _modes(found: Sequence[Mapping[str, ModeValue]]) -> tuple[ModeTrend, ...]:
    """Return bounce, pitch and roll over windows, as far as any has them."""
    return tuple(
        ModeTrend(
            label=label, **{name: [getattr(modes.get(label), name, None) for modes in found] for name in _MODE_FIELDS}
        )
        for label in MOTIONS
        if any(label in modes for modes in found)
    )


def _with_gaps(windows: Sequence[tuple[Entry, T]], length: int) -> Iterator[tuple[int, Entry | None, T | None]]:
    """Yield time, entry and result of each window, and a time alone where the next one begins after a gap."""
    for (entry, result), following in zip_longest(windows, windows[1:]):
        yield entry.t0, entry, result
        if following is not None and following[0].t0 - entry.t0 > LIMITS.gap * length:
            yield entry.t0 + length, None, None


def _remark(window: Observation | None) -> str | None:
    """Return why a window has no value, or what is wrong with its sensors; None if nothing is."""
    if window is None:
        return "no data"
    faults = (f"{fault.channel} {fault.kind.replace('_', ' ')}" for fault in window.sensor_faults)
    return window.reason or "; ".join(faults) or None


def _marks(store: Store, vehicle: str) -> Iterator[TimeMark]:
    """Yield new baselines, verdicts and alerts."""
    for row in store.results.baselines(vehicle):
        text = f"baseline {row.version}: {row.reason}"
        yield TimeMark(time=row.created, kind="baseline", text=text, link=f"{path_of(vehicle)}/baseline")
    alerts = {alert.number: alert for alert in store.alerts.find(vehicle=vehicle) if alert.count}
    for verdict in store.verdicts.all(alerts=list(alerts)):
        text = ": ".join(filter(None, (verdict.verdict, verdict.part, verdict.action)))
        yield TimeMark(time=verdict.time, kind="verdict", text=text, link=f"/alerts/{verdict.alert}")
    for number, alert in alerts.items():
        yield TimeMark(time=alert.raised, kind="alert", text=alert.text, link=f"/alerts/{number}")


def _modes_on_sensors(row: VehicleRow, entry: Entry) -> tuple[Modes, list[Channel]]:
    """Return bounce, pitch and roll of an entry on the sensors of the body.

    Raises
    ------
    FormatError
        If the shapes have another number of values than the vehicle has sensors of motion.
    """
    vehicle = vehicle_from_text(row.description, source=f"the vehicle file of {row.vehicle}")
    sent = dict(row.channels)
    sensors = [sensor for sensor in vehicle.sensor if not sensor.is_condition and sensor.channel in sent]
    stated = [mode for mode in entry.document["modes"] if isinstance(mode, dict) and mode.get("label") in MOTIONS]
    documents = [IdentifiedMode.model_validate(mode) for mode in stated]
    size = documents[0].mode_shape.size
    if size != len(sensors):
        raise FormatError(f"they have {size} channels, and the vehicle has {len(sensors)} sensors of motion")
    on_body = [k for k, sensor in enumerate(sensors) if sensor.on == "body" and sensor.between is None]
    channels = [sensors[k].as_channel() for k in on_body]
    shapes = [{"mode_shape": mode.mode_shape[on_body], "mode_shape_std": None} for mode in documents]
    reduced = [mode.model_copy(update=shape) for mode, shape in zip(documents, shapes, strict=True)]
    return modes_from_documents(reduced, tuple(channel.name for channel in channels)), channels
