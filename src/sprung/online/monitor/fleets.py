"""Vehicles of one type in the store: the baseline of their type, and how much each deviates from the others.

Vehicles are of one type if their vehicle files are the same, apart from the name: estimates are relative to the nominal
values of the file, and comparable only then.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

from sprung._checks import check_number
from sprung._display import counted
from sprung.diagnosis import LEARNING_WINDOWS, Observation, RankedVehicle, TypeBaseline, learn_type, rank_fleet
from sprung.diagnosis.type_baselines import MIN_VEHICLES
from sprung.errors import DataError, SprungError
from sprung.online.monitor.histories import reference_of
from sprung.online.store import Entry, Store
from sprung.results.documents import observation_from_document
from sprung.vehicles import vehicle_from_text, vehicle_text

#: Act of the audit trail: a vehicle was inspected, with the part that was found as its detail; empty: healthy.
INSPECTED = "inspected"
#: Largest number of vehicles that the baseline of a type is learnt from.
_MAX_VEHICLES = 50


def vehicles_by_type(store: Store) -> dict[str, list[str]]:
    """Return the vehicles of each type, by the text of its vehicle file; vehicles without a valid one are left out."""
    types: dict[str, list[str]] = {}
    for row in store.inbox.vehicles():
        if text := _type_text(row.description):
            types.setdefault(text, []).append(row.vehicle)
    return types


class VehicleTypes:
    """Types of the vehicles of a store, and their normal windows, read again only when they change.

    Parameters
    ----------
    store
        Store of the monitor.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._of_type: dict[str, list[str]] = {}
        self._type_of: dict[str, str] = {}
        self._count: int | None = None
        self._windows: dict[str, tuple[tuple[int, int], list[Observation]]] = {}

    def forget(self) -> None:
        """Read the vehicles again when next needed, as a description has changed."""
        self._count = None

    def others(self, vehicle: str) -> list[str]:
        """Return the other vehicles of the type of a vehicle.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        count = self._store.inbox.n_vehicles()
        if count != self._count:
            self._of_type = vehicles_by_type(self._store)
            self._type_of = {own: text for text, group in self._of_type.items() for own in group}
            self._count = count
        group = self._of_type.get(self._type_of.get(vehicle, ""), [])
        return [other for other in group[: _MAX_VEHICLES + 1] if other != vehicle]

    def has_type(self, vehicle: str) -> bool:
        """Return whether there are enough other vehicles of its type to learn a baseline of the type from.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        return len(self.others(vehicle)) >= MIN_VEHICLES

    def normal_windows(self, vehicles: Sequence[str]) -> dict[str, list[Observation]]:
        """Return the windows with which vehicles take part in the baseline of their type.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        windows = {}
        for vehicle, latest in self._store.results.latest(vehicles).items():
            known = self._windows.get(vehicle)
            if known is None or known[0] != latest:
                known = self._windows[vehicle] = latest, _normal_windows(self._store, vehicle)
            windows[vehicle] = known[1]
        return windows


def type_of_others(store: Store, vehicle: str, *, types: VehicleTypes | None = None) -> TypeBaseline | None:
    """Return the baseline of the type of a vehicle, learnt from the other vehicles; None if there are too few.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    types
        Types of the vehicles of the store; None: read for this call.

    Notes
    -----
    Each vehicle takes part with the windows that its own baseline was learnt from, so that a later change does not
    count as normal, or with its last windows before it has one; after a verdict as `inspections` states.
    """
    types = types or VehicleTypes(store)
    others = types.others(vehicle)[:_MAX_VEHICLES]
    if len(others) < MIN_VEHICLES:
        return None
    found = inspections(store)
    healthy, _, rest = _by_verdict(types.normal_windows(others), found)
    try:
        return learn_type(rest | healthy, name=_name(store, vehicle), healthy=healthy.keys() - rest.keys())
    except DataError:
        return None


def inspections(store: Store) -> dict[str, tuple[int, str]]:
    """Return the time of the last inspection of each vehicle [UTC ns] and the part that was found; empty: healthy.

    Notes
    -----
    From the verdicts on alerts of the suspension ("nothing found": healthy) and from `sprung vehicles inspected`. It
    says what the windows up to its time are: those of a healthy vehicle belong to the type whatever they are, and those
    of a faulty one do not. Later windows are compared again.
    """
    stated = store.requests.audited(act=INSPECTED, limit=1000)
    last = {row.subject: (row.time, str(row.detail or "")) for row in stated}
    judged = [(row, cause) for row, cause in store.verdicts.judged() if "." in cause and row.verdict != "not looked at"]
    alerts = store.alerts.rows({row.alert for row, _ in judged})
    for row, cause in judged:
        vehicle = alerts[row.alert].vehicle
        if row.time > last.get(vehicle, (0, ""))[0]:
            last[vehicle] = row.time, {"confirmed": cause, "another part": row.part}.get(row.verdict, "")
    return last


def _by_verdict(
    windows: Mapping[str, Sequence[Observation]], found: Mapping[str, tuple[int, str]]
) -> tuple[dict[str, list[Observation]], dict[str, str], dict[str, list[Observation]]]:
    """Return windows of vehicles known to be healthy, the part of those known to be faulty, and all other windows."""
    healthy, faulty, rest = {}, {}, {}
    for vehicle, own in windows.items():
        time, part = found.get(vehicle, (0, ""))
        before = [window for window in own if 1e9 * window.time <= time]
        if before and part:
            faulty[vehicle] = part
        elif before:
            healthy[vehicle] = before
        if len(before) < len(own):
            rest[vehicle] = [window for window in own if 1e9 * window.time > time]
    return healthy, faulty, rest


def rankings(store: Store, *, rate: float) -> tuple[list[tuple[str, tuple[RankedVehicle, ...]]], list[str]]:
    """Return the name and the ranking of each type by its vehicles' last windows, and notes on what is not ranked.

    A vehicle with a baseline is compared with itself, one without with its type.

    Parameters
    ----------
    store
        Store of the monitor.
    rate
        Expected share of healthy vehicles among the discoveries, above 0 and up to 1.

    Raises
    ------
    ParameterError
        If the rate is not above 0 and at most 1.
    """
    check_number("rate", rate, above=0, at_most=1)
    ranked, notes, found = [], [], inspections(store)
    for vehicles in vehicles_by_type(store).values():
        name = _name(store, vehicles[0])
        references = {vehicle: reference_of(store.results.baselines(vehicle)) for vehicle in vehicles}
        baselines = {vehicle: own.baseline for vehicle, own in references.items() if own.baseline is not None}
        windows = {
            vehicle: [window for window in _last_windows(store, vehicle) if window.time > own.learnt_until]
            for vehicle, own in references.items()
        }
        lone_windows = {vehicle: own for vehicle, own in windows.items() if vehicle not in baselines}
        healthy, faulty, rest = _by_verdict(lone_windows, found)
        of_baseline = {vehicle: own for vehicle, own in windows.items() if vehicle in baselines}
        try:
            of_type = rank_fleet(of_baseline | rest, baselines=baselines, healthy=healthy, rate=rate)
        except DataError as error:
            notes.append(f"vehicles of the type {name} are not ranked: {error}")
            continue
        ranked.append((name, of_type))
        left = [vehicle for vehicle in vehicles if all(one.vehicle != vehicle for one in of_type)]
        unused = [vehicle for vehicle in left if vehicle in baselines]
        notes += _not_ranked(unused, "no window after the baseline can be compared")
        notes += [f"{vehicle} was inspected and found healthy" for vehicle in healthy.keys() - rest.keys()]
        notes += [f"{vehicle} was inspected: {part}" for vehicle, part in faulty.items() if vehicle not in rest]
        lone = [one for one in left if one not in baselines | healthy | faulty]
        notes += _not_ranked(lone, f"without a baseline, usable windows of {MIN_VEHICLES + 1} of the type are needed")
    return ranked, notes


def _not_ranked(vehicles: Sequence[str], reason: str) -> list[str]:
    """Return a note on vehicles that are not ranked, which names the first of them; none without any."""
    if not vehicles:
        return []
    names = ", ".join(vehicles[:3]) + (f" and {counted(len(vehicles) - 3, 'other')}" if len(vehicles) > 3 else "")
    return [f"{names} {'is' if len(vehicles) == 1 else 'are'} not ranked: {reason}"]


@lru_cache(maxsize=1024)
def _type_text(description: str) -> str:
    """Return the text of a vehicle file without the vehicle's name; empty if it is not valid."""
    try:
        vehicle = vehicle_from_text(description, source="the vehicle file")
    except SprungError:
        return ""
    return vehicle_text(vehicle.model_copy(update={"name": "type"}))


def _name(store: Store, vehicle: str) -> str:
    """Return the name in the file of a vehicle."""
    row = store.inbox.vehicle(vehicle)
    return "" if row is None else vehicle_from_text(row.description, source="the vehicle file").name


def _normal_windows(store: Store, vehicle: str) -> list[Observation]:
    """Return the windows of a vehicle's baseline, or the last ones if it has none."""
    baselines = store.results.baselines(vehicle)
    if baselines and baselines[-1].document.get("vehicle_file"):
        return []  # its windows are in terms of a file that a calibration completed for this vehicle alone
    learning_times = baselines[-1].document.get("learning_times", []) if baselines else []
    if not learning_times:
        return _last_windows(store, vehicle)
    since, until = (round(1e9 * end) for end in (min(learning_times) - 1, max(learning_times) + 1))
    times = set(learning_times)
    every = _observations(store.results.observations(vehicle, since=since, until=until))
    return [observation for observation in every if observation.time in times]


def _last_windows(store: Store, vehicle: str) -> list[Observation]:
    """Return the last windows of a vehicle."""
    return _observations(store.results.observations(vehicle, limit=LEARNING_WINDOWS))


def _observations(entries: list[Entry]) -> list[Observation]:
    """Return the observations in rows of the store, without the statistics of the residual test."""
    return [replace(observation_from_document(entry.document), vehicle="") for entry in entries]
