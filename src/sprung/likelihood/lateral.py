"""Fit of lateral suspension and wheel-rail contact of a rail vehicle to the lateral spectra of its drives."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung._threads import one_thread
from sprung.errors import DataError
from sprung.likelihood.coordinates import TYPICAL_NOISE, RigidLayout
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.excitations import track_densities
from sprung.likelihood.fitting import RULES
from sprung.likelihood.hermitian import real_coordinates
from sprung.likelihood.search import TOO_FAR, minimised
from sprung.likelihood.spectra import (
    ClassSpectra,
    SegmentSpectra,
    class_spectra,
    onto_grid,
    segment_spectra,
    through_window,
)
from sprung.likelihood.uncertainty import parameter_covariance, power_misfit, segment_weights, tempering
from sprung.likelihood.whittle import minus_log_likelihood
from sprung.modal import INTERVAL_95
from sprung.recording import Recording, each_recording
from sprung.signals.conditioning import without_missing
from sprung.vehicles import Vehicle
from sprung.vehicles.lateral import (
    critical_speed,
    has_lateral_sensors,
    lateral_components,
    lateral_modes,
    lateral_outputs,
    lateral_systems,
    with_lateral,
    with_load,
)
from sprung.vehicles.structure import MOTIONS
from sprung.vehicles.system import MechanicalSystem, Outputs
from sprung.vehicles.window import Window, window_of


@dataclass(frozen=True, slots=True)
class LateralSettings:
    """Settings of the fit of lateral motion."""

    #: Lowest and highest frequency [Hz].
    band: tuple[float, float] = (0.4, 12.0)
    #: Length of a segment [s].
    segment: float = 10.24
    #: Width of a speed class, relative to its speed: at 5 Hz and 33 m/s the delay of the last wheelset of a coach then
    #: varies by 0.06 rad; where by 0.3 rad, scores of segments follow their speeds, and look like chance.
    class_width: float = 0.01
    #: Standard deviations of ln(value / value of the file): of conicity, of creep, of springs and dampers.
    conicity_std: float = 1.0
    creep_std: float = 0.3
    part_std: float = 0.5
    #: Standard deviation of ln of the levels of the track, and of the noise of a channel.
    level_std: float = 30.0
    #: Number of speeds of the curve of the least damping.
    n_speeds: int = 9
    #: Step of the derivatives of the matrices with respect to a parameter.
    step: float = 1e-4


SETTINGS = LateralSettings()


@dataclass(frozen=True, eq=False, slots=True)
class LateralModel:
    """A rail vehicle on a track of irregular alignment, and the data.

    Parameters
    ----------
    vehicle
        Vehicle with lateral tables, whose values are those of the prior.
    outputs
        Its lateral sensors.
    spectra
        Mean spectral matrices of the data by speed class, differentiated to accelerations.

    Notes
    -----
    The wheelsets meet the same irregular track one after another: at the speed V the sensors have the spectral matrix
    sum (g g^H) G(f / V) / V + noise over alignment and cross level, which are independent, with
    g = H(f) (exp(-2 pi i f d_j / V))_j, d_j the distance of wheelset j behind the first one and G the spectrum of ERRI
    B176 times a free level; the spread of a class's speeds blurs the delays. Parameters are logarithms of ratios to the
    file's values. Derivatives of M, C and K with respect to them come from central differences, those of g from
    dg = Y (dB a - dZ q), with the readings Y for unit forces, the phases a, the dynamic stiffness Z and the motion q.
    """

    vehicle: Vehicle
    outputs: Outputs
    spectra: ClassSpectra
    components: tuple[str, ...] = field(init=False)
    prior_std: Real = field(init=False)

    def __post_init__(self) -> None:
        stds = {"conicity": SETTINGS.conicity_std, "creep": SETTINGS.creep_std}
        components = tuple(lateral_components(self.vehicle))
        n_free = 2 + len(self.outputs.channels)
        object.__setattr__(self, "components", components)
        prior = [stds.get(name, SETTINGS.part_std) for name in components] + n_free * [SETTINGS.level_std]
        object.__setattr__(self, "prior_std", np.array(prior))
        freeze(self, prior_std=1)

    def start(self) -> Real:
        """Return the parameters of the file, with the level of the track and the noise from the power of the data."""
        start = np.zeros(self.prior_std.size)
        fitted = np.einsum("cfii->i", self.matrix(start)).real / self.spectra.matrices[..., 0, 0].size
        measured = np.einsum("cfii->i", self.spectra.matrices).real / self.spectra.matrices[..., 0, 0].size
        n = len(self.components)
        start[n : n + 2] = np.log(np.median(measured / fitted))
        start[n + 2 :] = np.log(1e-2 * measured / TYPICAL_NOISE[2] ** 2)
        return start

    def changed(self, parameters: Real) -> Vehicle:
        """Return the vehicle of the parameters."""
        n = len(self.components)
        return with_lateral(self.vehicle, dict(zip(self.components, parameters[:n].tolist(), strict=True)))

    def _noise(self, parameters: Real) -> Real:
        return TYPICAL_NOISE[2] ** 2 * np.exp(parameters[-len(self.outputs.channels) :])

    def _systems(self, parameters: Real) -> list[MechanicalSystem]:
        """Return the lateral motion at the speed of each class."""
        return list(map(lateral_systems(self.changed(parameters)), self.spectra.speeds.tolist()))

    def _responses(self, parameters: Real) -> Iterator[tuple[Complex, list["_Input"]]]:
        """Yield the readings for unit forces and the responses to both irregularities of each class."""
        omega, n = 2 * np.pi * self.spectra.grid, len(self.components)
        behind = np.array([self.vehicle.wheels[0].x - wheel.x for wheel in self.vehicle.wheels[::2]])
        observed = _observed(self.outputs, omega)
        nodes, shares = hermegauss(3)  # the mean over normally distributed speeds
        nodes_and_shares = list(zip(nodes.tolist(), (shares / shares.sum()).tolist(), strict=True))
        classes = zip(self.spectra.speeds.tolist(), self.spectra.spreads.tolist(), strict=True)
        for system, (speed, spread) in zip(self._systems(parameters), classes, strict=True):
            flexibility = np.linalg.inv(_dynamic_stiffness(system, omega))
            densities, inputs = list(enumerate(track_densities(self.spectra.grid / speed))), []
            for (node, share), (kind, density) in product(nodes_and_shares, densities):
                phases = np.exp(-1j * np.outer(omega, behind) / (speed * (1 + node * spread)))
                columns = slice(kind * behind.size, (kind + 1) * behind.size)
                motion = (flexibility @ (phases @ system.input_matrix[:, columns].T)[..., None])[..., 0]
                readings = (observed @ motion[..., None])[..., 0]
                level = share * np.exp(parameters[n + kind]) * density / speed
                inputs.append(_Input(kind, phases, columns, motion, readings, level))
            yield observed @ flexibility, inputs

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrices of the model, shape of the data's."""
        return through_window(self.of_alignment(parameters)[0])

    def of_alignment(self, parameters: Real) -> tuple[Complex, Complex, Real]:
        """Return spectra of the readings and of the alignment under the first wheelset, before the window.

        Returns
        -------
        ndarray, ndarray, ndarray
            Spectral matrices of the readings, shape (classes, grid, m, m), cross spectra of the alignment with them,
            (classes, grid, 1, m), and its spectrum [m^2/Hz], (classes, grid).
        """
        noise, found = np.diag(self._noise(parameters)), []
        for _, inputs in self._responses(parameters):
            aligned = [each for each in inputs if each.kind == 0]
            crossed = sum(each.level[:, None] * each.readings.conj() for each in aligned)
            own = sum(each.level for each in aligned)
            found.append((sum((each.matrix for each in inputs), noise), crossed, own))
        spectra, crossed_spectra, density = (np.array(part) for part in zip(*found, strict=True))
        return spectra, crossed_spectra[:, :, None], density

    def _derivatives(self, parameters: Real) -> Complex:
        """Return the derivatives of the spectral matrices on the grid, shape (parameters, classes, grid, m, m)."""
        omega, n = 2 * np.pi * self.spectra.grid, len(self.components)
        noise, rows = self._noise(parameters), SETTINGS.step * np.eye(n, parameters.size)
        shape = (parameters.size, self.spectra.speeds.size, omega.size, noise.size, noise.size)
        result = np.zeros(shape, dtype=np.complex128)
        ends = [[self._systems(parameters + sign * row) for sign in (1, -1)] for row in rows]
        for number, (to_sensors, inputs) in enumerate(self._responses(parameters)):
            for row, systems in enumerate(ends):
                high, low = (of_classes[number] for of_classes in systems)
                springs, dampers = (high.stiffness - low.stiffness).T, (high.damping - low.damping).T
                for each in inputs:
                    forces = each.phases @ (high.input_matrix - low.input_matrix)[:, each.columns].T
                    forces -= each.motion @ springs + 1j * omega[:, None] * (each.motion @ dampers)
                    readings = (to_sensors @ forces[..., None])[..., 0] / (2 * SETTINGS.step)
                    outer = readings[:, :, None] * each.readings[:, None, :].conj() * each.level[:, None, None]
                    result[row, number] += outer + outer.conj().swapaxes(1, 2)
            for each in inputs:
                result[n + each.kind, number] += each.matrix
        for row, value in enumerate(noise):
            result[n + 2 + row, ..., row, row] = value
        return result

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient; `TOO_FAR` where it does not exist."""
        too_far = TOO_FAR, np.zeros_like(parameters)
        if np.abs(parameters).max() > np.log(np.finfo(np.float32).max):
            return too_far
        try:
            value, weight = minus_log_likelihood(self.matrix(parameters), self.spectra)
        except np.linalg.LinAlgError:
            return too_far
        if not np.isfinite(value):
            return too_far
        gradient = np.einsum("cfij,pcfji->p", onto_grid(weight), self._derivatives(parameters)).real
        deviation = parameters / self.prior_std
        return value + float(deviation @ deviation) / 2, gradient + deviation / self.prior_std

    def whitened_derivatives(self, parameters: Real) -> Real:
        """Return sqrt(n) L^-1 (dS/dp) L^-H for each parameter, as `Model.whitened_derivatives`."""
        factors = np.linalg.inv(np.linalg.cholesky(self.matrix(parameters)))
        derivatives = through_window(self._derivatives(parameters))
        whitened = factors @ derivatives @ factors.conj().swapaxes(-1, -2)
        return real_coordinates(whitened) * np.sqrt(self.spectra.weights)[None, :, :, None]

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information without the prior."""
        rows = self.whitened_derivatives(parameters).reshape(parameters.size, -1)
        return rows @ rows.T


class _Input(NamedTuple):
    """An irregularity of the track, alignment or cross level: phases and columns of the wheelsets, motion, readings."""

    kind: int
    phases: Complex
    columns: slice
    motion: Complex
    readings: Complex
    level: Real

    @property
    def matrix(self) -> Complex:
        """Spectral matrix of the readings."""
        return self.readings[:, :, None] * self.readings[:, None, :].conj() * self.level[:, None, None]


def _dynamic_stiffness(system: MechanicalSystem, omega: Real) -> Complex:
    """Return -w^2 M + i w C + K, shape (frequencies, n, n)."""
    w = omega[:, None, None]
    return np.asarray(system.stiffness - w**2 * system.mass + 1j * w * system.damping, dtype=np.complex128)


def _observed(outputs: Outputs, omega: Real) -> Complex:
    """Return the readings, differentiated to accelerations, for one unit of each coordinate at angular frequencies."""
    s = 1j * omega[:, None, None]
    readings = outputs.displacement + s * outputs.velocity + s**2 * outputs.acceleration
    return np.asarray(readings * s ** (2 - _orders(outputs)[:, None]), dtype=np.complex128)


def lateral_layout(outputs: Outputs) -> RigidLayout:
    """Return the layout whose coordinates are the channels of lateral motion."""
    size = len(outputs.names)
    return RigidLayout(
        outputs.names, outputs.names, _orders(outputs), np.eye(size), np.zeros((size, 1)), np.zeros((size, size, size))
    )


def _orders(outputs: Outputs) -> Indices:
    """Return the order of the time derivative that each channel measures."""
    return np.array([MOTIONS[channel.quantity][0] for channel in outputs.channels])


class LateralEstimate(NamedTuple):
    """Value of a lateral component, its 95 % interval, and the value of the file [N/m, N s/m, N]."""

    value: float
    interval: tuple[float, float]
    nominal: float


class LeastDamping(NamedTuple):
    """Damping ratio of the least damped lateral mode at a speed [m/s], and its standard deviation."""

    speed: float
    damping_ratio: float
    damping_ratio_std: float


@dataclass(frozen=True, eq=False)
class LateralFit:
    """Lateral suspension and contact of a rail vehicle, and its running stability.

    Parameters
    ----------
    model
        Model with the data.
    parameters, covariance
        Fitted parameters, shape (parameters,), and their covariance.
    model_error
        Relative error of the model's spectra beyond chance.
    n_segments
        Number of segments that were used.
    notes
        Reservations, one sentence each.
    """

    model: LateralModel
    parameters: Real
    covariance: Real
    model_error: float
    n_segments: int
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, parameters=1, covariance=2)

    @property
    def components(self) -> tuple[str, ...]:
        """Names of what was fitted, as by `lateral_components`."""
        return self.model.components

    @property
    def log_ratios(self) -> Real:
        """Return ln(value / value of the file), shape (components,)."""
        return self.parameters[: len(self.components)]

    @property
    def log_ratios_std(self) -> Real:
        """Return their standard deviations."""
        return np.sqrt(np.diag(self.covariance)[: len(self.components)])

    @property
    def estimates(self) -> dict[str, LateralEstimate]:
        """Return value, 95 % interval and value of the file of each component, by name."""
        nominal, half = lateral_components(self.model.vehicle), INTERVAL_95 * self.log_ratios_std
        ends = np.exp([self.log_ratios, self.log_ratios - half, self.log_ratios + half]).T.tolist()
        return {
            name: LateralEstimate(nominal[name] * value, (nominal[name] * low, nominal[name] * high), nominal[name])
            for name, (value, low, high) in zip(self.components, ends, strict=True)
        }

    @property
    def vehicle(self) -> Vehicle:
        """Return the vehicle with the fitted values."""
        return self.model.changed(self.parameters)

    @property
    def speeds(self) -> tuple[float, float]:
        """Return the lowest and highest speed of the data [m/s]."""
        speeds = self.model.spectra.speeds
        return float(speeds.min()), float(speeds.max())

    def damping_at(self, speeds: Real) -> tuple[Real, Real]:
        """Return the damping ratio of the least damped lateral mode at speeds [m/s], and its standard deviation."""

        def least(vehicle: Vehicle) -> Real:
            return np.array([lateral_modes(vehicle, speed=speed).damping_ratio.min() for speed in speeds.tolist()])

        slopes = self._slopes(least)
        return least(self.vehicle), np.sqrt(np.einsum("pi,pq,qi->i", slopes, self._of_components, slopes))

    @cached_property
    def critical_speed(self) -> tuple[float, float, float] | None:
        """Return the critical speed and its 95 % interval [m/s]; None: none up to the highest speed of the search."""
        speed = critical_speed(self.vehicle)
        if speed is None:
            return None
        slopes = self._slopes(lambda vehicle: np.array([np.log(critical_speed(vehicle) or np.nan)]))[:, 0]
        half = INTERVAL_95 * float(np.sqrt(slopes @ self._of_components @ slopes))
        return speed, speed * float(np.exp(-half)), speed * float(np.exp(half))

    @cached_property
    def least_damping(self) -> tuple[LeastDamping, ...]:
        """Return the least damped lateral mode from the lowest speed driven to beyond the highest or critical one."""
        low, high = self.speeds
        critical = self.critical_speed
        speeds = np.linspace(low, max(1.2 * high, 1.05 * critical[0] if critical else 0.0), SETTINGS.n_speeds)
        return tuple(LeastDamping(*values) for values in zip(speeds.tolist(), *self.damping_at(speeds), strict=True))

    @property
    def margin(self) -> float | None:
        """Return the critical speed over the highest speed driven, less 1; None without a critical speed."""
        return None if self.critical_speed is None else self.critical_speed[0] / self.speeds[1] - 1

    @property
    def _of_components(self) -> Real:
        return self.covariance[: len(self.components), : len(self.components)]

    def _slopes(self, function: Callable[[Vehicle], Real]) -> Real:
        """Return the derivatives of a function of the vehicle with respect to the components, (components, values)."""
        step, n = 1e-3, len(self.components)
        rows = step * np.eye(n, self.parameters.size)
        ends = [[function(self.model.changed(self.parameters + sign * row)) for sign in (1, -1)] for row in rows]
        return np.array([(above - below) / (2 * step) for above, below in ends])


@one_thread
def fit_lateral(recordings: Recording | Iterable[Recording], vehicle: Vehicle) -> LateralFit:
    """Fit conicity, creep and lateral suspension of a rail vehicle to drives on straight track.

    Parameters
    ----------
    recordings
        Drives at steady speeds with lateral accelerometers or gyroscopes on frames or body, and the speed channel.
    vehicle
        Vehicle with bogies, lateral tables and the lateral sensors; its values are the prior.

    Returns
    -------
    LateralFit

    Raises
    ------
    ParameterError
        If the vehicle lacks lateral tables or sensors, or a recording lacks a sensor.
    DataError
        If the speed is missing, or no segment is long, fast and steady enough.

    Notes
    -----
    Whittle likelihood of the spectra of lateral sensors by narrow speed class (`LateralModel`), fitted as by
    `fit_segments`: powerful segments are limited, and the likelihood is tempered by the error of the model. Speeds
    beyond those driven are extrapolated by the model: the critical speed is the linear one.

    References
    ----------
    As for `lateral_system` and `fit_segments`.
    """
    return _fit([window_of(record, vehicle, allow_missing=True) for record in each_recording(recordings)], vehicle)


def _fit(windows: Sequence[Window], vehicle: Vehicle) -> LateralFit:
    """Return the fit of a vehicle to its windows."""
    outputs, width = lateral_outputs(vehicle), SETTINGS.class_width
    speed = windows[0].speed
    if speed is None or any(window.speed is None for window in windows):
        raise DataError("a recording has no speed, without which creep is not known: record the speed")
    segments = _segments([window.filled for window in windows], outputs, speed)
    model = LateralModel(vehicle, outputs, class_spectra(segments, width=width))
    parameters, power, limited = model.start(), 0.0, segments
    for _ in range(RULES.max_fits):
        weights = segment_weights(model, parameters, segments, width=width) if power else np.ones(1)
        limited = replace(segments, values=segments.values * np.sqrt(weights)[:, None, None])
        untempered = LateralModel(vehicle, outputs, class_spectra(limited, width=width))
        last, power = power, tempering(untempered, parameters)
        if abs(power - last) < RULES.settled * last:
            break
        spectra = replace(untempered.spectra, weights=power * untempered.spectra.weights)
        model = LateralModel(vehicle, outputs, spectra)
        parameters = minimised(model, parameters)
    error = float(np.sqrt(max(0.0, power_misfit(model, parameters)[1])))
    covariance = parameter_covariance(model, parameters, limited, width=width)
    notes = [
        f"the fitted lateral spectra deviate {100 * error:.0f} % more than chance allows: the vehicle has a part that "
        "its file lacks, or the track is curved"
    ] * (error > RULES.imperfect)
    return LateralFit(model, parameters, covariance, error, model.spectra.n_segments, tuple(notes))


def fit_lateral_under(fit: CornerFit, windows: Sequence[Window]) -> LateralFit | None:
    """Fit the lateral motion of windows of a rail vehicle under the load of its vertical fit, as `fit_lateral`.

    Returns
    -------
    LateralFit or None
        None without lateral tables, the speed, or all lateral sensors.

    Raises
    ------
    DataError
        If no segment is long, fast and steady enough.
    """
    vehicle = windows[0].vehicle
    if not has_lateral_sensors(vehicle):
        return None
    names = set(lateral_outputs(vehicle).names)
    if any(window.speed is None or not names <= set(window.outputs) for window in windows):
        return None
    load = fit.payload["payload_mass"]["value"] if "payload_mass" in fit.payload else 0.0
    return _fit(windows, with_load(vehicle, load))


def _segments(records: Sequence[Recording], outputs: Outputs, speed: str) -> SegmentSpectra:
    """Return the spectra of the lateral channels in segments of steady speed without missing values."""
    missing = [name for name in outputs.names if any(name not in record.names for record in records)]
    if missing:
        raise DataError(
            f"the recording lacks the lateral channels {', '.join(missing)}: give recordings that have them"
        )
    low, high = SETTINGS.band
    band = low, min(high, 0.4 * min(record.sampling_rate for record in records))
    complete = [without_missing(record.select([*outputs.names, speed])) for record in records]
    return segment_spectra(complete, lateral_layout(outputs), speed=speed, band=band, segment_length=SETTINGS.segment)
