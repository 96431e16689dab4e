"""What a fit of the corners is expected to determine, before anything is recorded."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, freeze, settings_of
from sprung.errors import ParameterError
from sprung.likelihood.coordinates import TYPICAL_NOISE, rigid_layout
from sprung.likelihood.corners import IDENTIFIABLE
from sprung.likelihood.fitting import FitSetup
from sprung.likelihood.search import minimised
from sprung.likelihood.spectra import CLASS_WIDTH, OVERCOUNT, OVERLAP, SLOWEST, ClassSpectra
from sprung.likelihood.uncertainty import expected_covariance
from sprung.likelihood.vehicle import CornerSettings, default_choices
from sprung.likelihood.whittle import Model
from sprung.vehicles import Component, Vehicle, structure

#: Error of a sum of shares, and of a number of cycles, that is rounding.
_WHOLE = 1e-3


@dataclass(frozen=True, slots=True)
class ExpectedDrive:
    """Conditions of drives that are planned.

    Parameters
    ----------
    minutes
        Duration of a window [min], above 0.
    speed
        Lowest and highest speed [m/s]; all speeds between are as frequent.
    roughness
        Roughness of the road G(n0) [m^3], or of the track; above 0. Of a mix of roads a pair for each: roughness, and
        share of the time.
    sampling_rate
        Sampling rate [Hz], above 0.
    steady
        Share of the segments whose speed is steady enough, above 0 and at most 1.
    driving
        Density of the accelerations by braking and cornering at 1 Hz [(m/s^2)^2/Hz], above 0.
    has_speed
        Whether the speed is recorded. Without it, the delay between the axles is unknown.
    accelerometer_noise
        Noise density of the accelerometers [m/s^2 per root of Hz], above 0.

    Raises
    ------
    ParameterError
        If a number is out of its range.
    """

    minutes: float = 10.0
    speed: tuple[float, float] = (8.0, 25.0)
    roughness: float | tuple[tuple[float, float], ...] = 64e-6
    sampling_rate: float = 200.0
    steady: float = 0.8
    driving: float = 1e-3
    has_speed: bool = True
    accelerometer_noise: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("minutes", "sampling_rate", "driving", "accelerometer_noise"):
            check_number(name, getattr(self, name), above=0)
        for roughness, share in self.roads:
            check_number("roughness", roughness, above=0)
            check_number("share of a road", share, above=0, at_most=1)
        if abs(sum(share for _, share in self.roads) - 1) > _WHOLE:
            total = sum(share for _, share in self.roads)
            raise ParameterError(f"the shares of the roads add up to {total:g}, not to 1: correct them")
        check_number("steady", self.steady, above=0, at_most=1)
        if not SLOWEST <= self.speed[0] < self.speed[1]:
            raise ParameterError(
                f"speed {self.speed[0]:g} to {self.speed[1]:g} m/s must rise from {SLOWEST:g} m/s: correct it"
            )

    @property
    def roads(self) -> tuple[tuple[float, float], ...]:
        """Roughness of each road, and its share of the time."""
        return self.roughness if isinstance(self.roughness, tuple) else ((self.roughness, 1.0),)

    @property
    def on_mean_road(self) -> "ExpectedDrive":
        """The same drive on one road, whose roughness is the geometric mean of the mix."""
        return replace(self, roughness=float(np.exp(sum(share * np.log(roughness) for roughness, share in self.roads))))


@dataclass(frozen=True, eq=False, slots=True)
class ExpectedFit:
    """Expected precision of the corners fitted to one window.

    Parameters
    ----------
    components
        Springs, dampers and tyres.
    covariance
        Expected covariance of ln(value / nominal value), shape (components, components).
    prior_std
        Standard deviation of each before any data.
    """

    components: tuple[Component, ...]
    covariance: Real
    prior_std: float

    def __post_init__(self) -> None:
        freeze(self, covariance=2)

    @property
    def std(self) -> dict[Component, float]:
        """Expected standard deviation of each component, relative."""
        return dict(zip(self.components, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def contrast_std(self) -> dict[Component, float]:
        """Expected standard deviation of the ratio of each component to that on the other side of its axle."""
        rows = {component: row for row, component in enumerate(self.components)}
        stds, swap = {}, {"left": "right", "right": "left"}
        for component, row in rows.items():
            words = [swap.get(word, word) for word in component.corner.split("_")]
            other = rows.get(replace(component, corner="_".join(words)))
            if other is not None and other != row:
                contrast = np.zeros(len(rows))
                contrast[[row, other]] = 1.0, -1.0
                stds[component] = float(np.sqrt(contrast @ self.covariance @ contrast))
        return stds

    @property
    def axle_std(self) -> dict[Component, float]:
        """Expected standard deviation of the mean of each component's axle over that of the same kind on all others."""
        stds = {}
        for component in self.std:
            alike = np.array([other.kind == component.kind for other in self.components])
            own = alike & np.array([other.axle == component.axle for other in self.components])
            others = alike & ~own
            if others.any():
                contrast = own / own.sum() - others / others.sum()
                stds[component] = float(np.sqrt(contrast @ self.covariance @ contrast))
        return stds

    @property
    def is_identifiable(self) -> dict[Component, bool]:
        """Whether the drives determine each component, as `CornerFit.is_identifiable`."""
        return {component: std < IDENTIFIABLE * self.prior_std for component, std in self.std.items()}


#: Noise densities of sensors by quantity, per root of Hz: accelerometers of 100 ug, gyroscopes of 0.005 degrees/s.
NOISE = MappingProxyType({"acceleration": 1e-3, "angular_velocity": 1e-4, "displacement": 1e-5})
#: Quantities by the order of the time derivative of the motion that they are.
QUANTITIES = ("displacement", "angular_velocity", "acceleration")
#: Standard deviation of ln of the delay between the axles without a speed.
_UNKNOWN_DELAY = 0.3


def expected_fit(
    vehicle: Vehicle,
    drive: ExpectedDrive | None = None,
    *,
    settings: CornerSettings | None = None,
    noise: Mapping[str, float] | None = None,
    n_pairs: int = 0,
) -> ExpectedFit:
    """Return what a fit of the corners to a window is expected to determine.

    Parameters
    ----------
    vehicle
        Vehicle with the sensors that are planned.
    drive
        Conditions of the window; None: ten minutes at 8 to 25 m/s on a road of class B to C.
    settings
        Choices of the fit.
    noise
        Noise density of the sensors by quantity, in SI units per root of Hz; None: of usual MEMS sensors.
    n_pairs
        Number of pairs of estimates about those of data that are as expected, at which fits report their covariance;
        0: at the nominal vehicle alone. Of weak kits, whose estimates scatter, fits report from half of that to 1.2
        times.

    Raises
    ------
    ParameterError
        If the vehicle has no sensor of its motion, or a number is out of range.

    Notes
    -----
    The covariance is that of `parameter_covariance` at the nominal vehicle, A (c I + P) A with the Fisher information
    I of the likelihood that the fit uses, A = (I + P)^-1, the prior P, and c = 19/9 for overlapping windows. Segments
    are spread evenly over the speeds. The information of a mix of roads is the mean of theirs, weighted by their
    shares. An error of the model, friction above all, adds to it on a real vehicle. Pairs of estimates scatter as those
    of fits, by A c I A, about the fit to the expected spectra, which leaves braking and cornering that they do not show
    at what the prior allows; the mean of their covariances is that of the logarithms of the matrices.

    References
    ----------
    V. Arsigny et al., Log-Euclidean metrics for fast and simple calculus on diffusion tensors, Magnetic Resonance in
    Medicine 56 (2006) 411-421 (mean of matrices by their logarithms).
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953)
    125-139.

    Examples
    --------
    A quarter of the time doubles the standard deviations of left against right:

    >>> from sprung.vehicles import read_vehicle
    >>> car = read_vehicle("zafira")
    >>> short, long = (expected_fit(car, ExpectedDrive(minutes=minutes)).contrast_std for minutes in (10.0, 40.0))
    >>> spring = next(iter(short))
    >>> str(spring), round(short[spring] / long[spring], 1)
    ('front_left.spring', 2.0)
    """
    drive, settings = drive or ExpectedDrive(), settings_of(CornerSettings, settings)
    model, parameters = _model(
        vehicle, drive, settings, {**NOISE, "acceleration": drive.accelerometer_noise, **(noise or {})}
    )
    std = model.prior_std.copy()
    if not drive.has_speed and "delay" in model.names:
        std[model.names.index("delay")] = _UNKNOWN_DELAY
    rows, size = model.rows("components"), std.size

    def information(step: Real) -> Real:
        return np.sum([share * model.information(values + step) for share, values in parameters], axis=0)

    def logarithm(step: Real) -> Real:
        variances, axes = np.linalg.eigh(expected_covariance(information(step), std)[np.ix_(rows, rows)])
        return (axes * np.log(variances)) @ axes.T

    if n_pairs:
        parameters = [(share, _estimated(model, values)) for share, values in parameters]
    nominal = information(np.zeros(size))
    if not n_pairs:
        return ExpectedFit(model.components, expected_covariance(nominal, std)[np.ix_(rows, rows)], settings.prior_std)
    bread = np.linalg.inv(nominal + np.diag(1 / std**2))
    scatter = np.linalg.cholesky(bread @ (OVERCOUNT * nominal + 1e-9 * np.diag(1 / std**2)) @ bread)
    steps = np.random.default_rng(0).standard_normal((n_pairs, size)) @ scatter.T
    variances, axes = np.linalg.eigh(np.mean([logarithm(step) for step in (*steps, *-steps)], axis=0))
    return ExpectedFit(model.components, (axes * np.exp(variances)) @ axes.T, settings.prior_std)


def _estimated(model: Model, parameters: Real) -> Real:
    """Return what a fit makes of data that are as expected: what they do not show stays where the prior has it."""
    data = replace(model, spectra=replace(model.spectra, matrices=model.matrix(parameters)))
    start = parameters.copy()
    hidden = model.rows("driving")
    start[hidden] = model.start[hidden]
    return minimised(data, start, powers=model.powers)


def _model(
    vehicle: Vehicle, drive: ExpectedDrive, settings: CornerSettings, noise: Mapping[str, float]
) -> tuple[Model, list[tuple[float, Real]]]:
    """Return the model of a vehicle with classes of planned speeds and no data, and its parameters on each road."""
    nominal = structure(vehicle, speed=sum(drive.speed) / 2)
    if not any(sensor.quantity in QUANTITIES for sensor in vehicle.sensor):
        raise ParameterError(
            f"vehicle {vehicle.name!r} has no sensor of its motion, an accelerometer or a gyroscope: state one or a kit"
        )
    layout = rigid_layout(nominal)
    kind = settings.kind or vehicle.kind
    (low, high), length = default_choices(vehicle, nominal, settings, drive.sampling_rate)
    # The ends of the default band are whole numbers of cycles of a segment, but for the rounding of eigenvalues.
    first, last = np.ceil(low * length - _WHOLE), np.floor(high * length + _WHOLE)
    frequencies = np.arange(first, last + 1) / length
    n_classes = max(1, int(np.log(drive.speed[1] / drive.speed[0]) / np.log1p(CLASS_WIDTH)))
    edges = np.geomspace(*drive.speed, n_classes + 1)
    n_segments = drive.steady * 60 * drive.minutes / ((1 - OVERLAP) * length)
    counts = n_segments * np.diff(edges) / (edges[-1] - edges[0])
    size = len(layout.rows)
    spectra = ClassSpectra(
        frequencies=frequencies,
        counts=counts,
        speeds=(edges[1:] + edges[:-1]) / 2,
        spreads=np.full(n_classes, CLASS_WIDTH / np.sqrt(12)),
        matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (n_classes, frequencies.size, size, size)),
        segment_length=length,
        weights=np.broadcast_to(counts[:, None], (n_classes, frequencies.size)),
    )
    model = FitSetup(vehicle, nominal, layout, settings, kind).model(spectra)
    parameters = model.start.copy()
    names = {name: row for row, name in enumerate(model.names)}
    expected = {"braking": drive.driving, "cornering": drive.driving}
    expected |= {
        f"noise_{name}": (noise[QUANTITIES[order]] / TYPICAL_NOISE[order]) ** 2
        for name, order in zip(layout.names, layout.orders, strict=True)
    }
    for name, value in expected.items():
        if name in names:
            parameters[names[name]] = np.log(value)
    on_roads = []
    for roughness, share in drive.roads:
        values = parameters.copy()
        if "roughness" in names:
            values[names["roughness"]] = np.log(roughness)
        on_roads.append((share, values))
    return model, on_roads
