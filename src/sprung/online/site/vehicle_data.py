"""Data quality, windows, baselines and body modes of a vehicle, from the store."""

from collections import Counter
from collections.abc import Sequence
from math import isfinite

import numpy as np

from sprung.diagnosis import Baseline, Observation
from sprung.diagnosis.baseline import CONDITIONS
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.diagnosis.sensors.faults import MISSING
from sprung.errors import FormatError, ParameterError, SprungError
from sprung.modal import Modes
from sprung.online.monitor import VehicleStatus
from sprung.online.monitor.histories import LEARN, ROLL_BACK
from sprung.online.monitor.operations import BASELINE_ACTS
from sprung.online.monitor.vehicle_states import observations_of, reference_of
from sprung.online.site.models import WindowEntry
from sprung.online.site.vehicle_models import (
    BaselineDetail,
    BaselineVersion,
    BodyMode,
    BodyModes,
    ChannelCheck,
    ChannelQuality,
    Condition,
    ConditionRange,
    DataQuality,
    ModeValue,
    PartChange,
    WindowDetail,
)
from sprung.online.site.vehicle_trends import body_modes_in
from sprung.online.store import Entry, Store, VehicleRow
from sprung.recording import Channel
from sprung.results.documents import baseline_from_document, observation_from_document
from sprung.results.documents.identification import IdentifiedMode, modes_from_documents
from sprung.state import progress_in_words
from sprung.vehicles import vehicle_from_text
from sprung.vehicles.labels import MOTIONS

#: Checks of a channel as a table shows them, with the kinds of faults that each finds.
CHECKS = {
    "signal": ("dead", "stuck", MISSING),
    "clipping": ("clipped",),
    "noise": ("noisy", "spiking", "hum"),
    "offset": ("drifting",),
    "fit to the other sensors": ("inverted", "swapped", "wrong_gain"),
    "time": ("time_shifted",),
}
#: Windows that the data quality is about: eight hours of ten minutes.
_WINDOWS = 48
#: Identifications that are searched for modes of the body.
_IDENTIFICATIONS = 12
#: Conditions without a unit of their own that are shares.
_SHARES = {"standing", "model_error"}


def require_vehicle(store: Store, vehicle: str) -> VehicleRow:
    """Return a vehicle as it described itself.

    Raises
    ------
    ParameterError
        If it is unknown.
    """
    row = store.inbox.vehicle(vehicle)
    if row is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: the fleet lists the known ones")
    return row


def require_window(store: Store, vehicle: str, boot: int, number: int) -> Entry:
    """Return a stored window.

    Raises
    ------
    ParameterError
        If the vehicle or the window is unknown.
    """
    require_vehicle(store, vehicle)
    entry = store.results.observation(vehicle, boot, number)
    if entry is None:
        raise ParameterError(f"unknown window {boot}/{number} of {vehicle}: it was never analysed or is no longer kept")
    return entry


def data_quality(store: Store, vehicle: str) -> DataQuality:
    """Return the data quality of a vehicle over its last windows.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    row = require_vehicle(store, vehicle)
    read = observations_of(store.results.observations(vehicle, limit=_WINDOWS))
    windows = [(entry.t0, window) for entry, window in read]
    names = dict(row.channels)
    absent = {fault.channel: "" for _, window in windows for fault in window.sensor_faults}
    channels = [_channel_quality(name, quantity, windows) for name, quantity in (absent | names).items()]
    cursors = store.inbox.cursors(vehicle=vehicle)
    return DataQuality(
        since=windows[0][0] if windows else None,
        until=windows[-1][0] if windows else None,
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        n_windows=len(windows),
        n_inconclusive=sum(not window.is_conclusive for _, window in windows),
        reasons=tuple(Counter(window.reason for _, window in windows if window.reason).most_common()),
        lost_frames=sum(cursor.lost for cursor in cursors.values()),
        unanalysed_frames=sum(each.kind != "state" for each in store.aside.find(vehicle)),
        channels=tuple(sorted(channels, key=_badness)),
        notes=windows[-1][1].notes if windows else (),
    )


def window_detail(store: Store, vehicle: str, boot: int, number: int) -> WindowDetail:
    """Return a window of a vehicle.

    Raises
    ------
    ParameterError
        If the vehicle or the window is unknown.
    """
    entry = require_window(store, vehicle, boot, number)
    window = WindowEntry(boot=boot, number=number, t0=entry.t0, document=entry.document)
    reference = reference_of(store.results.baselines(vehicle))
    findings = tuple(str(row.document.get("sentence", "")) for row in store.results.findings_of(vehicle, boot, number))
    before, after = _neighbours(store, entry)
    try:
        observation = observation_from_document(entry.document)
    except FormatError as error:
        return WindowDetail(
            vehicle=vehicle,
            window=window,
            reason=f"the stored window cannot be read: {error}",
            conditions=(),
            reference=reference.in_words,
            parts=(),
            modes=(),
            findings=findings,
            sensor_faults=(),
            notes=(),
            before=before,
            after=after,
        )
    is_compared = reference.accepts(observation)
    return WindowDetail(
        vehicle=vehicle,
        window=window,
        reason=observation.reason,
        conditions=_conditions(observation),
        reference=reference.in_words,
        parts=tuple(map(PartChange.model_validate, reference.parts([observation], limits={}))) if is_compared else (),
        modes=_window_modes(store, entry, observation),
        findings=findings,
        sensor_faults=tuple(
            f"{fault.channel} is {fault.kind.replace('_', ' ')}: {fault.detail}" for fault in observation.sensor_faults
        ),
        notes=(*reference.notes, *observation.notes),
        before=before,
        after=after,
    )


def baseline_detail(store: Store, vehicle: str) -> BaselineDetail:
    """Return learning and baselines of a vehicle.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    require_vehicle(store, vehicle)
    stored = store.results.status(vehicle)
    status = VehicleStatus() if stored is None else VehicleStatus(**stored)
    reference = reference_of(store.results.baselines(vehicle))
    is_learning = status.is_learning or reference.baseline is None
    waiting = [each for each in store.requests.open_commands() if each.vehicle == vehicle]
    returns = [each.detail["version"] for each in waiting if each.act == ROLL_BACK]
    return BaselineDetail(
        is_learning=is_learning,
        windows_learnt=status.n_learnt,
        windows_needed=status.n_needed,
        progress=progress_in_words(status) if is_learning else "",
        is_requested=any(each.act == LEARN for each in waiting),
        requested_version=returns[-1] if returns else None,
        versions=baseline_entries(store, vehicle, is_learning=is_learning),
        ranges=() if reference.baseline is None else _condition_ranges(reference.baseline),
        detectable={str(count): losses for count, losses in sorted(reference.detectable.items())},
        notes=reference.notes,
    )


def baseline_entries(store: Store, vehicle: str, *, is_learning: bool) -> tuple[BaselineVersion, ...]:
    """Return the versions of the baseline of a vehicle, the present one first.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    is_learning
        Whether learning is in progress, which a return to the present version ends.
    """
    rows = store.results.baselines(vehicle)
    requests = [each for each in store.requests.commands_of(vehicle) if each.act in BASELINE_ACTS]
    entries, before = [], 0
    for row in rows:
        asked = [each.who for each in requests if before < each.created <= row.created]
        before = row.created
        try:
            baseline = baseline_from_document(row.document)
        except FormatError:
            baseline = None
        entries.append(
            BaselineVersion(
                version=row.version,
                created=row.created,
                reason=row.reason,
                windows=row.document.get("n_windows"),
                who=asked[-1] if asked else None,
                refused=row.document.get("n_refused"),
                ranges=() if baseline is None else _condition_ranges(baseline),
                is_restorable=baseline is not None and (row is not rows[-1] or is_learning),
            )
        )
    return tuple(reversed(entries))


def last_body_modes(store: Store, vehicle: str) -> tuple[Entry | None, tuple[ModeValue, ...]]:
    """Return bounce, pitch and roll as they were identified last, and where; None and no mode if they never were."""
    for entry in reversed(store.results.last_modes(vehicle, limit=_IDENTIFICATIONS)):
        found = body_modes_in(entry.document)
        if found:
            return entry, tuple(found[label] for label in MOTIONS if label in found)
    return None, ()


def body_modes(store: Store, vehicle: str) -> BodyModes:
    """Return how the body moves in bounce, pitch and roll, as they were identified last.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    row = require_vehicle(store, vehicle)
    entry, _ = last_body_modes(store, vehicle)
    if entry is None:
        return BodyModes(time=None, corners=(), modes=(), note="no mode of the body has been identified yet")
    return _moving_body(row, entry)


def _condition_ranges(baseline: Baseline) -> tuple[ConditionRange, ...]:
    """Return the ranges of the conditions that the windows of a baseline met."""
    return tuple(
        ConditionRange(name=name, low=low, high=high, unit=CONDITION_UNITS.get(name, ""))
        for name, (low, high) in baseline.ranges.items()
        if name in CONDITIONS
    )


def _channel_quality(name: str, quantity: str, windows: Sequence[tuple[int, Observation]]) -> ChannelQuality:
    """Return what the checks found on a channel."""
    checks = []
    for check, kinds in CHECKS.items():
        met = [
            (time, fault)
            for time, window in windows
            for fault in window.sensor_faults
            if fault.channel == name and fault.kind in kinds
        ]
        last = met[-1] if met else None
        checks.append(
            ChannelCheck(
                name=check,
                n_faults=len({time for time, _ in met}),
                last=None if last is None else last[0],
                text="" if last is None else f"{last[1].kind.replace('_', ' ')}: {last[1].detail}".rstrip(": "),
                is_present=last is not None and last[0] == windows[-1][0],
            )
        )
    is_good = not any(check.is_present for check in checks)
    return ChannelQuality(channel=name, quantity=quantity, checks=tuple(checks), is_good=is_good)


def _badness(quality: ChannelQuality) -> tuple[bool, int]:
    """Return the place of a channel: those with a present fault first, then by the number of faults."""
    return quality.is_good, -sum(check.n_faults for check in quality.checks)


def _conditions(observation: Observation) -> tuple[Condition, ...]:
    """Return the known conditions of a window."""
    return tuple(
        Condition(
            name=name,
            value=100 * value if name in _SHARES else value,
            unit="%" if name in _SHARES else CONDITION_UNITS.get(name, ""),
        )
        for name, value in observation.conditions.items()
        if isfinite(value)
    )


def _window_modes(store: Store, entry: Entry, observation: Observation) -> tuple[ModeValue, ...]:
    """Return the modes of the body that were identified in a window; those of the fitted vehicle where none were."""
    identified = store.results.last_modes(entry.vehicle, since=entry.t0, until=entry.t0)
    own = [body_modes_in(each.document) for each in identified if each.boot == entry.boot]
    if own and own[-1]:
        return tuple(own[-1][label] for label in MOTIONS if label in own[-1])
    return tuple(
        ModeValue(
            label=label,
            natural_frequency=frequency,
            natural_frequency_std=None,
            damping_ratio=ratio,
            damping_ratio_std=None,
        )
        for label, (frequency, ratio) in observation.modes.items()
    )


def _neighbours(store: Store, entry: Entry) -> tuple[str | None, str | None]:
    """Return BOOT/NUMBER of the windows before and after one."""
    places = [
        None if each is None else f"{each.boot}/{each.number}"
        for each in (
            next(iter(store.results.observations(entry.vehicle, until=entry.t0 - 1, limit=1)), None),
            store.results.first_observation(entry.vehicle, after=entry.t0),
        )
    ]
    return places[0], places[1]


def _moving_body(row: VehicleRow, entry: Entry) -> BodyModes:
    """Return how the body moves in the modes of an entry."""
    from sprung.results.figures.shapes import body_shapes

    try:
        modes, channels = _modes_on_sensors(row, entry)
        shapes = body_shapes(modes, channels)
    except (SprungError, ValueError) as error:
        return BodyModes(time=entry.t0, corners=(), modes=(), note=f"the shapes cannot be drawn: {error}")
    if shapes is None or not np.isfinite(shapes.corner_motions).all():
        return BodyModes(
            time=entry.t0, corners=(), modes=(), note="the sensors do not determine the motion of the body"
        )
    return BodyModes(
        time=entry.t0,
        corners=tuple((float(x), float(y), float(z)) for x, y, z in shapes.corners),
        modes=tuple(
            BodyMode(
                label=str(modes.labels[k]),
                natural_frequency=float(modes.natural_frequency[k]),
                natural_frequency_std=_finite(modes.natural_frequency_std[k]),
                damping_ratio=float(modes.damping_ratio[k]),
                damping_ratio_std=_finite(modes.damping_ratio_std[k]),
                real=tuple(map(float, shapes.corner_motions[k].real)),
                imag=tuple(map(float, shapes.corner_motions[k].imag)),
                explained=float(shapes.explained[k]),
            )
            for k in range(len(modes))
        ),
        note="",
    )


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


def _finite(value: float) -> float | None:
    """Return a number; None if it is not known."""
    return float(value) if isfinite(value) else None
