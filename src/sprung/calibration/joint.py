"""Numbers of a vehicle file as parameters, and their joint fit to the spectra of all channels of several windows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung._threads import one_thread
from sprung.calibration.draft import (
    SENSORS,
    Draft,
    VehicleNumber,
    channel_responses,
    is_in_one_range,
    motion_of,
    moved,
)
from sprung.errors import DataError
from sprung.likelihood import (
    ClassSpectra,
    CornerSettings,
    Model,
    ParameterBlock,
    RigidLayout,
    SegmentSpectra,
    rigid_layout,
    segment_spectra,
    vehicle_model,
)
from sprung.likelihood.fitting import FitSetup
from sprung.likelihood.search import TOO_FAR
from sprung.likelihood.spectra import OVERCOUNT, delayed_speeds, segment_speeds, steady_segments
from sprung.likelihood.speed_delay import DELAYS, speed_delay
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.likelihood.uncertainty import expected_covariance
from sprung.likelihood.vehicle import Kind, default_choices, with_sensors
from sprung.recording import naming
from sprung.vehicles import Element, Structure, Vehicle, structure
from sprung.vehicles.models import ROLLING
from sprung.vehicles.window import Window

#: Step of the numerical derivatives over the standard deviation of the prior.
_STEP = 1e-4
#: Highest speed over lowest one of the segments of a vehicle with rigid axles and side forces of tyres.
_SPEED_RANGE = 1.44
#: Fields of a sensor that leave its reading of motion as it is.
_STILL = frozenset({"scale", "delay"})


class _Change(NamedTuple):
    """Change of dynamic stiffness, drive and readings per unit of a parameter; None where it is 0 throughout.

    Side forces of tyres, whose damping falls with the speed, are apart: elements whose weighted sum is their change.
    """

    stiffness: Complex | None
    drive: Complex | None
    readings: Complex | None
    side_forces: tuple[tuple[float, Element], ...] = ()

    def at_speed(self, speed: float, s: Complex) -> "_Change":
        """Return the change with that of the side forces at a speed [m/s]."""
        if not self.side_forces:
            return self
        rows = np.array([element.elongation for _, element in self.side_forces])
        weighted = [weight * _at_speed(element, speed).dynamic_stiffness(s) for weight, element in self.side_forces]
        stiffness = np.asarray(np.einsum("ef,ei,ej->fij", weighted, rows, rows), dtype=np.complex128)
        return self._replace(stiffness=stiffness if self.stiffness is None else self.stiffness + stiffness)


@dataclass(frozen=True, eq=False, slots=True)
class FileNumbers(ParameterBlock):
    """Numbers of a vehicle file; the parameters are ln(value / given value), or value - given value.

    Parameters
    ----------
    draft
        Vehicle as given.
    numbers
        Numbers to learn.
    layout
        Channels of the data.
    speed
        Mean speed of the window [m/s], which the side forces of tyres depend on.

    Notes
    -----
    The vehicle is rebuilt from the file's numbers, so that whatever a file can state can be learnt. With dynamic
    stiffness D, drive B and readings R (see `Terms`), dD, dB and dR of each number are central differences of these
    smooth functions, exact to about 1e-8; what follows from them, dH = L (dB - dD X) - w^2 dR X, is not approximated.
    """

    draft: Draft
    numbers: tuple[VehicleNumber, ...]
    layout: RigidLayout
    speed: float = ROLLING.speed

    group: ClassVar[str] = "vehicle"

    @property
    def names(self) -> tuple[str, ...]:
        """Places of the numbers in the file."""
        return tuple(number.name for number in self.numbers)

    @property
    def prior_std(self) -> Real:
        """Standard deviations of the numbers."""
        return np.array([number.std for number in self.numbers])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms of the vehicle with the numbers."""
        draft, vehicle = _built(self.draft, self.numbers, parameters.tobytes())
        s = terms.s
        responses = channel_responses(draft, self.draft, self.layout.names, terms.frequencies)
        return replace(
            terms,
            elongations=vehicle.elongations,
            feet=vehicle.feet,
            stiffness=np.array([_at_speed(element, self.speed).dynamic_stiffness(s) for element in vehicle.elements]),
            mass=vehicle.mass,
            forces=vehicle.forces,
            motion=motion_of(self.layout.names, vehicle),
            channel_response=terms.channel_response * responses,
        )

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient: 2 Re sum over frequencies of tr(E dB) - tr(E dD X) - w^2 tr(dR X Q reduction)."""
        terms = gradients.transfer.terms
        X = gradients.transfer.displacements
        sensed = (X @ gradients.driven @ terms.reduction) * terms.squared[:, None, None]
        gradient = np.zeros(len(self.numbers))
        for row, change in enumerate(self._changes(parameters, terms)):
            if change.stiffness is not None:
                gradient[row] -= 2 * np.einsum("fun,fnu->", gradients.forced, change.stiffness @ X).real
            if change.drive is not None:
                wheels = gradients.forced[:, : change.drive.shape[-1]]
                gradient[row] += 2 * np.einsum("fun,fnu->", wheels, change.drive).real
            if change.readings is not None:
                gradient[row] -= 2 * np.einsum("fnk,fkn->", sensed, change.readings).real
        return gradient

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        X, L = response.displacements, response.force_response
        squared = response.terms.squared[:, None, None]
        derivatives = []
        for change in self._changes(parameters, response.terms):
            dH = np.zeros_like(response.matrix)
            if change.stiffness is not None:
                dH -= L @ change.stiffness @ X
            if change.drive is not None:
                dH[..., : change.drive.shape[-1]] += L @ change.drive
            if change.readings is not None:
                dH -= squared * (response.terms.reduction @ change.readings @ X)
            derivatives.append(response.change_by_transfer(dH))
        return derivatives

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the numbers in the units of the file."""
        given = [self.draft.value_at(number.place) for number in self.numbers]
        return {
            number.name: number.value(value, parameter)
            for number, value, parameter in zip(self.numbers, given, parameters.tolist(), strict=True)
        }

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the vehicle with the numbers."""
        return structure_at_speed(_built(self.draft, self.numbers, parameters.tobytes())[1], self.speed)

    def _changes(self, parameters: Real, terms: Terms) -> list[_Change]:
        """Derivatives of the matrices; those of the windows of one evaluation are computed once."""
        frequencies = np.round(terms.frequencies, 9).tobytes()  # those of windows differ in their last digits
        changes = _changes(self.draft, self.numbers, self.layout.names, parameters.tobytes(), frequencies)
        return [change.at_speed(self.speed, terms.s) for change in changes]


def structure_at_speed(vehicle: Structure, speed: float) -> Structure:
    """Return a vehicle, built at the usual speed, at another one [m/s]."""
    damping, stiffness = vehicle.rolling or (None, None)
    turning = None if damping is None or stiffness is None else (damping * speed / ROLLING.speed, stiffness)
    return replace(vehicle, elements=tuple(_at_speed(element, speed) for element in vehicle.elements), rolling=turning)


def _at_speed(element: Element, speed: float) -> Element:
    """Return an element, built at the usual speed, at another one [m/s]."""
    return replace(element, damping=element.damping * ROLLING.speed / speed) if element.part == "cornering" else element


@lru_cache(maxsize=4)
def _built(draft: Draft, numbers: tuple[VehicleNumber, ...], point: bytes) -> tuple[Draft, Structure]:
    """Draft and vehicle at the parameters of which `point` holds the bytes."""
    there = moved(draft, numbers, np.frombuffer(point))
    return there, there.structure()


@lru_cache(maxsize=8)
def _changes(
    draft: Draft, numbers: tuple[VehicleNumber, ...], channels: tuple[str, ...], point: bytes, grid: bytes
) -> list[_Change]:
    """Derivatives of the matrices at the parameters of which `point` holds the bytes."""
    frequencies, (base, vehicle) = np.frombuffer(grid), _built(draft, numbers, point)
    of_sensors = _sensor_changes(base, draft, numbers, channels, frequencies)
    return [
        of_sensors[number.name]
        if number.group == SENSORS
        else _component_change(vehicle, number, frequencies)
        if number.components
        else _structural_change(base, draft, number, channels, frequencies)
        for number in numbers
    ]


def _component_change(vehicle: Structure, number: VehicleNumber, frequencies: Real) -> _Change:
    """Derivatives with respect to ln of the components of a number: those of their elements alone."""
    s = _s(frequencies)
    size, n_inputs = vehicle.elongations.shape[1], vehicle.feet.shape[1]
    stiffness = np.zeros((s.size, size, size), dtype=np.complex128)
    drive = np.zeros((s.size, size, n_inputs), dtype=np.complex128)
    for element, foot in zip(vehicle.elements, vehicle.feet, strict=True):
        of_stiffness, of_damping = (component in number.components for component in element.components)
        if not (of_stiffness or of_damping):
            continue
        above, below = (
            replace(
                element,
                stiffness=element.stiffness * (1 + sign * _STEP * of_stiffness),
                damping=element.damping * (1 + sign * _STEP * of_damping),
            ).dynamic_stiffness(s)
            for sign in (1, -1)
        )
        pulled = ((above - below) / (2 * _STEP))[:, None, None] * element.elongation[:, None]
        stiffness += pulled * element.elongation
        drive += pulled * foot
    return _Change(stiffness, drive if drive.any() else None, None)


def _sensor_changes(
    base: Draft, given: Draft, numbers: Sequence[VehicleNumber], channels: tuple[str, ...], frequencies: Real
) -> dict[str, _Change]:
    """Central differences by name; a field of all sensors is moved at once, as each changes its own channel alone."""
    changes = {}
    of_sensors = [number for number in numbers if number.group == SENSORS]
    vehicle = base.structure()
    for field in sorted({number.field for number in of_sensors}):
        alike = [number for number in of_sensors if number.field == field]
        step = _STEP * np.array([number.std for number in alike])
        ends = [moved(base, alike, sign * step) for sign in (1, -1)]
        above, below = (
            _readings(end, given, vehicle if field in _STILL else end.structure(), channels, frequencies)
            for end in ends
        )
        for number in alike:
            row = channels.index(number.channel)
            change = np.zeros_like(above)
            change[:, row] = (above[:, row] - below[:, row]) / (2 * _STEP * number.std)
            changes[number.name] = _Change(None, None, change)
    return changes


def _structural_change(
    base: Draft, given: Draft, number: VehicleNumber, channels: tuple[str, ...], frequencies: Real
) -> _Change:
    """Central differences of a vehicle that is rebuilt."""
    step = _STEP * number.std
    ends = [number.moved(base, sign * step) for sign in (1, -1)]
    vehicles = [end.structure() for end in ends]
    readings = (
        _readings(end, given, vehicle, channels, frequencies) for end, vehicle in zip(ends, vehicles, strict=True)
    )
    (above, drive_above), (below, drive_below) = (_dynamics(vehicle, frequencies) for vehicle in vehicles)
    return _Change(
        _difference(above, below, step=2 * step),
        _difference(drive_above, drive_below, step=2 * step),
        _difference(*readings, step=2 * step),
        _side_forces(*vehicles, step=2 * step),
    )


def _side_forces(above: Structure, below: Structure, *, step: float) -> tuple[tuple[float, Element], ...]:
    """Return the weighted elements whose sum is the slope of the tyres' side forces; none if it is 0 throughout."""
    ends = [[element for element in vehicle.elements if element.part == "cornering"] for vehicle in (above, below)]
    values = [[(*one.elongation.tolist(), one.damping, one.series_stiffness) for one in end] for end in ends]
    if values[0] == values[1]:
        return ()
    return tuple((sign / step, element) for sign, end in zip((1, -1), ends, strict=True) for element in end)


def _difference(above: Complex, below: Complex, *, step: float) -> Complex | None:
    """Return the slope between two matrices; None if it is 0 throughout."""
    if np.array_equal(above, below):
        return None
    return np.asarray((above - below) / step, dtype=np.complex128)


def _dynamics(vehicle: Structure, frequencies: Real) -> tuple[Complex, Complex]:
    """Dynamic stiffness (grid, n, n) without side forces of tyres, and drive (grid, n, inputs) of a vehicle."""
    squared = ((2 * np.pi * frequencies) ** 2)[:, None, None]
    upright = [row for row, element in enumerate(vehicle.elements) if element.part != "cornering"]
    s, d = _s(frequencies), vehicle.elongations[upright]
    weighted = np.array([vehicle.elements[row].dynamic_stiffness(s) for row in upright]).T[:, None, :] * d.T
    stiffness = weighted @ d - squared * vehicle.mass
    return np.asarray(stiffness, dtype=np.complex128), np.asarray(weighted @ vehicle.feet[upright] + vehicle.forces)


def _readings(draft: Draft, given: Draft, vehicle: Structure, channels: tuple[str, ...], frequencies: Real) -> Complex:
    """Readings (grid, channels, n) of a draft's sensors; `vehicle` is its structure."""
    responses = channel_responses(draft, given, channels, frequencies)
    return np.asarray(responses[:, :, None] * motion_of(channels, vehicle), dtype=np.complex128)


def _s(frequencies: Real) -> Complex:
    """Complex angular frequencies."""
    return np.asarray(2j * np.pi * frequencies, dtype=np.complex128)


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Settings of the search for the joint parameters."""

    #: Largest number of steps.
    max_steps: int = 40
    #: Gain of a Newton step below which the search ends.
    settled: float = 0.03
    #: Damping of the first step.
    damping: float = 1e-3
    #: Factor of the damping after a step that failed.
    more: float = 10.0
    #: Factor of the damping after a step that succeeded.
    less: float = 0.2
    #: Damping at which the search ends.
    stuck: float = 1e8
    #: Longest step in standard deviations of the prior.
    farthest: float = 2.0
    #: Noise of a channel at the start over its power.
    noise: float = 0.01


SEARCH = SearchSettings()


@dataclass(frozen=True, eq=False, slots=True)
class JointModel:
    """Models of several windows with parameters in common.

    Parameters
    ----------
    models
        Model of each window.
    rows
        Number of the joint parameter that each parameter of each model is, shape (parameters of the model,) each.
    names
        Names of the joint parameters.
    start, prior_std
        Centre and standard deviation of their prior, shape (parameters,).

    Notes
    -----
    Windows are independent given the parameters, so that the joint log likelihood is the sum of theirs; the prior of
    a shared parameter counts once.

    References
    ----------
    A. Gelman, J. B. Carlin, H. S. Stern, D. B. Dunson, A. Vehtari and D. B. Rubin, Bayesian Data Analysis, 3rd edition,
    CRC Press, 2013, chapter 5 (hierarchical models: parameters of the population and of the groups).
    """

    models: tuple[Model, ...]
    rows: tuple[Indices, ...]
    names: tuple[str, ...]
    start: Real
    prior_std: Real

    def __post_init__(self) -> None:
        freeze(self, start=1, prior_std=1)

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood of all windows, the prior included once, and its gradient."""
        deviation = (parameters - self.start) / self.prior_std
        value, gradient = float(deviation @ deviation) / 2, deviation / self.prior_std
        for model, rows in zip(self.models, self.rows, strict=True):
            own = parameters[rows]
            of_window, slope = model.objective(own)
            if of_window == TOO_FAR:
                return TOO_FAR, np.zeros_like(parameters)
            apart = (own - model.start) / model.prior_std
            value += of_window - float(apart @ apart) / 2
            np.add.at(gradient, rows, slope - apart / model.prior_std)
        return value, gradient

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information of all windows without the prior, shape (parameters, parameters)."""
        information = np.zeros((parameters.size, parameters.size))
        for model, rows in zip(self.models, self.rows, strict=True):
            information[np.ix_(rows, rows)] += model.information(parameters[rows])
        return information

    def of_window(self, number: int, parameters: Real) -> Real:
        """Return the parameters of one window's model."""
        return np.asarray(parameters[self.rows[number]], dtype=np.float64)

    def covariance(self, parameters: Real) -> Real:
        """Return the covariance of the parameters, as `expected_covariance`."""
        return expected_covariance(self.information(parameters), self.prior_std)

    def log_evidence(self, parameters: Real) -> float:
        """Return ln of the probability of the data, the parameters averaged over their prior; Laplace's approximation.

        Notes
        -----
        With the objective l + p at its minimum, l the data's part, c = 19/9 for the overlap of the segments and
        P = diag(1 / prior_std^2): -l / c - p - 1/2 ln det(I / c + P) + 1/2 ln det P, but for a constant of the data.

        References
        ----------
        D. J. C. MacKay, Bayesian interpolation, Neural Computation 4 (1992), 415-447 (Occam factor).
        """
        deviation = (parameters - self.start) / self.prior_std
        of_prior = float(deviation @ deviation) / 2
        of_data = (self.objective(parameters)[0] - of_prior) / OVERCOUNT
        scale = np.outer(self.prior_std, self.prior_std)
        gain = np.eye(parameters.size) + scale * self.information(parameters) / OVERCOUNT
        return -of_data - of_prior - float(np.linalg.slogdet(gain)[1]) / 2


@one_thread
def fitted(joint: JointModel, start: Real) -> Real:
    """Return the joint parameters at which the likelihood is largest.

    Parameters
    ----------
    joint
        Windows with their data.
    start
        Parameters at which the search starts, shape (parameters,).

    Raises
    ------
    numpy.linalg.LinAlgError
        If the likelihood does not exist at the start.

    Notes
    -----
    Fisher scoring with the damping of Levenberg and Marquardt: each step solves
    (I + P + damping diag(I + P)) step = -gradient. The derivatives of a step serve all windows, which is why few steps
    are worth more here than cheap ones.

    References
    ----------
    D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, Journal of the Society for
    Industrial and Applied Mathematics 11 (1963), 431-441.
    """
    parameters, damping = start, SEARCH.damping
    value, gradient = joint.objective(parameters)
    if value == TOO_FAR:
        raise np.linalg.LinAlgError("the likelihood does not exist at the start of the search")
    for _ in range(SEARCH.max_steps):
        information = joint.information(parameters) + np.diag(1 / joint.prior_std**2)
        while True:
            step = -np.linalg.solve(information + damping * np.diag(np.diag(information)), gradient)
            step *= min(1.0, SEARCH.farthest / np.max(np.abs(step) / joint.prior_std))
            end, slope = joint.objective(parameters + step)
            if end < value:
                break
            damping *= SEARCH.more
            if damping > SEARCH.stuck or -gradient @ step < SEARCH.settled:
                return parameters
        gain = value - end
        parameters, value, gradient, damping = parameters + step, end, slope, damping * SEARCH.less
        if gain < SEARCH.settled:
            break
    return parameters


#: Groups of parameters of a usual fit that the numbers of the file replace.
_REPLACED = frozenset({"components", "elements", "sensors", "unsprung"})
#: Parameters of the road that are the vehicle's: the ratio of the delays between the axles, a matter of wheelbase and
#: speedometer.
DELAY = "delay"


@dataclass(frozen=True, eq=False, slots=True)
class WindowSpectra:
    """Spectra of the segments of a window, in all its channels.

    Parameters
    ----------
    segments
        Spectra of the segments; the coordinates are the channels.
    layout
        Channels.
    rigid
        Combinations of the channels that the vehicle of the file explains.
    kind
        Excitation of the wheels.
    """

    segments: SegmentSpectra
    layout: RigidLayout
    rigid: RigidLayout
    kind: Kind


def window_spectra(window: Window, settings: CornerSettings) -> WindowSpectra:
    """Return the spectra of a window.

    Parameters
    ----------
    window
        Recording with its vehicle file.
    settings
        Band and length of the segments.

    Raises
    ------
    DataError
        If the speed is missing, or no segment is long, fast and steady enough.
    ParameterError
        If no sensor observes a motion of the vehicle.

    Notes
    -----
    A fit of the corners leaves out what a rigid vehicle cannot explain; here it shows where sensors are. A speed
    channel that is late is corrected, as there. With rigid axles on tyres that hold them sideways, the segments are
    those of one range of speed.
    """
    kind: Kind = settings.kind or window.vehicle.kind
    if window.speed is None and kind != "rig":
        with naming(window.recording):
            raise DataError(
                f"calibration needs the speed, but the channel {window.vehicle.speed_channel!r} is missing or wrong: "
                "record it"
            )
    motion = window.motion
    layout, rigid = window_layouts(window.vehicle, motion.names)
    band, length = default_choices(window.vehicle, window.structure, settings, motion.sampling_rate)
    segments = segment_spectra([motion], layout, speed=None, band=band, segment_length=length)
    if kind == "rig" or window.speed is None:
        return WindowSpectra(segments, layout, rigid, kind)
    setup = FitSetup(window.vehicle, window.structure, layout, settings, kind)
    means, variations = delayed_speeds([motion], window.speed, length, DELAYS)
    late = speed_delay(segments, means, variations, lambda speeds: setup.at_speeds(segments, speeds)).value
    speeds = segment_speeds([motion], window.speed, length, delay=late)
    segments = steady_segments(segments, *speeds)
    if is_in_one_range(window.vehicle):
        segments = _of_similar_speed(segments)
    return WindowSpectra(segments, layout, rigid, kind)


def _of_similar_speed(segments: SegmentSpectra) -> SegmentSpectra:
    """Return the segments within the range of speed that holds most of them.

    The damping by side forces of tyres falls with speed, and the model has that of the mean speed alone: over the whole
    range of a drive, the roll inertia of a rigid axle and its places of springs would imitate the difference.
    """
    from_slowest = np.sort(segments.speeds)
    held = np.searchsorted(from_slowest, _SPEED_RANGE * from_slowest, side="right") - np.arange(from_slowest.size)
    lowest = from_slowest[np.argmax(held)]
    kept = (lowest <= segments.speeds) & (segments.speeds <= _SPEED_RANGE * lowest)
    return replace(
        segments,
        values=segments.values[kept],
        speeds=segments.speeds[kept],
        spreads=segments.spreads[kept],
    )


def window_layouts(vehicle: Vehicle, channels: tuple[str, ...]) -> tuple[RigidLayout, RigidLayout]:
    """Return the layouts of all channels, and of what the vehicle of the file explains in them.

    Parameters
    ----------
    vehicle
        Vehicle as its file describes it.
    channels
        Names of the channels that were recorded.

    Raises
    ------
    ParameterError
        If no sensor observes a motion of the vehicle.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> channels, rigid = window_layouts(read_vehicle("zafira"), ("acc_fl", "acc_fr", "acc_rl", "acc_rr"))
    >>> channels.coordinates, rigid.coordinates
    (('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr'), ('bounce', 'pitch', 'roll'))
    """
    rigid = rigid_layout(with_sensors(structure(vehicle), channels))
    return of_all_channels(rigid), rigid


def of_all_channels(layout: RigidLayout) -> RigidLayout:
    """Return a layout whose coordinates are the channels, each over its usual noise; nothing is left out."""
    if len(layout.reduction) == len(layout.names):
        return layout
    weights = np.sqrt(np.einsum("cii->c", layout.noise))
    usual = np.array([np.linalg.norm(column) for column in layout.reduction.T]) / np.where(weights > 0, weights, 1.0)
    unit = np.eye(len(layout.names))
    return replace(
        layout, coordinates=layout.names, reduction=np.diag(usual), noise=np.einsum("ci,cj->cij", unit, unit)
    )


def window_model(
    spectra: ClassSpectra,
    window: WindowSpectra,
    draft: Draft,
    numbers: tuple[VehicleNumber, ...],
    settings: CornerSettings,
) -> Model:
    """Return the model of a window with the numbers of the file, the payload, the road and the noise as parameters.

    Parameters
    ----------
    spectra
        Mean spectral matrices of the window's segments.
    window
        Channels and excitation.
    draft
        Vehicle as given.
    numbers
        Numbers of the file to learn.
    settings
        Further choices.
    """
    speed = ROLLING.speed if window.kind == "rig" else float(np.average(spectra.speeds, weights=spectra.counts))
    vehicle = structure_at_speed(draft.structure(), speed)
    usual = vehicle_model(spectra, window.layout, draft.vehicle, vehicle, settings=settings, kind=window.kind)
    rest = tuple(block for block in usual.blocks if block.group not in _REPLACED)
    return Model(usual.structure, window.layout, spectra, (FileNumbers(draft, numbers, window.layout, speed), *rest))


def joint_of(models: Sequence[Model]) -> JointModel:
    """Return the joint model of windows of one vehicle: the numbers of the file and the delays are shared.

    Parameters
    ----------
    models
        Model of each window, at least one.
    """
    shared = {DELAY, *(name for block in models[0].blocks if isinstance(block, FileNumbers) for name in block.names)}
    priors: dict[str, tuple[float, float]] = {}
    names = []
    for window, model in enumerate(models):
        own = [name if name in shared else f"window_{window}.{name}" for name in model.names]
        names.append(own)
        for name, prior in zip(own, zip(model.start.tolist(), model.prior_std.tolist(), strict=True), strict=True):
            priors.setdefault(name, prior)
    numbers = {name: number for number, name in enumerate(priors)}
    rows = tuple(np.array([numbers[name] for name in own], dtype=np.intp) for own in names)
    start, prior_std = np.array(list(priors.values())).T
    return JointModel(tuple(models), rows, tuple(priors), start, prior_std)


def scaled_start(joint: JointModel) -> Real:
    """Return the start of a search: numbers as given, inputs of each window at the power of its data.

    The noise of every channel starts at a hundredth of the channel's power, so that sensors that are not where the file
    says do not rule the first steps.
    """
    start = joint.start.copy()
    for model, rows in zip(joint.models, joint.rows, strict=True):
        own, layout, spectra = model.scaled_start(), model.layout, model.spectra
        if layout.coordinates == layout.names:
            colours = (2 * np.pi * spectra.frequencies[:, None]) ** (2 * (2 - layout.orders))
            power = np.einsum("cfii->fi", spectra.matrices).real / spectra.counts.size
            own[model.rows("noise")] = np.log(SEARCH.noise * np.median(power / colours, axis=0))
        start[rows] = own
    return start
