"""A vehicle file as a likelihood: free parameters, inputs of the wheels, frequencies."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sprung._checks import check_number, check_one_of
from sprung.errors import ParameterError
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.components import FreeComponents, free_components
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.elements import BarStiffness, CorneringStiffness
from sprung.likelihood.excitations import Alignment, driving
from sprung.likelihood.masses import SeatLoads, payload, unsprung_masses
from sprung.likelihood.noise import SensorNoise
from sprung.likelihood.rig import RigInputs
from sprung.likelihood.sensor_errors import SensorDelays, sensor_positions
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.surface import ClassRoughness, RailInputs, RoadInputs, TrackLevels
from sprung.likelihood.whittle import Model
from sprung.vehicles import Component, Outputs, Structure, Vehicle, wheel_hop_frequencies
from sprung.vehicles.labels import highest_of_body

Kind = Literal["road", "rail", "rig"]


@dataclass(frozen=True, slots=True)
class DefaultChoices:
    """Choices of a fit that follow from the nominal vehicle."""

    #: Lower end of the band over the lowest natural frequency of the nominal vehicle.
    below: float = 0.4
    #: Upper end of the band over the highest wheel hop.
    above: float = 1.7
    #: Largest ratio of the two ends.
    widest: float = 33.0
    #: The same of a vehicle on bogies: frames move at up to ten times the frequencies of the body, and the distance of
    #: rail joints follows from their lines up to 25 Hz.
    widest_on_bogies: float = 65.0
    #: Highest frequency over the sampling rate.
    highest: float = 0.4
    #: Periods of the slowest mode in a segment.
    periods: float = 7.5
    #: Lowest frequency of lines over that of the highest mode of the body.
    lines_over_body: float = 1.5
    #: Standard deviation of an anti-roll bar's stiffness over that of the vehicle file: wide enough for a broken link.
    #: Known exactly, it alone would fix the scale that all masses and stiffnesses have in common.
    anti_roll: float = 0.5
    #: The same of cornering stiffness, which falls with the speed of a drive beyond its mean.
    cornering: float = 0.3
    #: Length over which a wheel averages a rail [m].
    rail_contact: float = 0.01


DEFAULTS = DefaultChoices()


@dataclass(frozen=True, slots=True)
class Expected:
    """What other windows of the vehicle have shown.

    Parameters
    ----------
    log_ratios
        ln(value / nominal value) of components.
    model_error
        Relative error of the fitted spectra, see `CornerFit`.
    """

    log_ratios: Mapping[Component, float]
    model_error: float


@dataclass(frozen=True, slots=True)
class CornerSettings:
    """Settings of a fit of the corners; None: chosen from the vehicle.

    Parameters
    ----------
    band
        Lowest and highest frequency [Hz].
    segment
        Length of a segment [s].
    prior_std
        Standard deviation of ln(value / nominal value) of every component before any data.
    free
        Components to fit, such as ("spring", "rear_left.damper"); the others keep the vehicle file's values. None: all.
    has_payload
        Whether the body's mass, moments and inertias, and on a road the unsprung masses and the anti-roll bars, are
        fitted too: otherwise a payload appears as soft springs. None: not on a rig.
    has_free_sensors
        Whether positions and delays of the sensors are fitted too.
    has_lines_masked
        Whether frequencies at which lines of wheels, engine or mains stand out of a first fit are left out.
    kind
        Excitation of the wheels: "road", "rail" (both repeat the front wheels' input at the rear ones and need the
        speed) or "rig" (rollers); None: that of the vehicle file.
    expected
        Another start of the search, and the error of the vehicle file with which a fit is no local minimum; None: the
        nominal vehicle alone. The estimates stay the same within a twentieth of their standard deviations.

    Raises
    ------
    ParameterError
        If a number is out of range, or the band does not rise from above 0.
    """

    band: tuple[float, float] | None = None
    segment: float | None = None
    prior_std: float = 0.7
    free: tuple[str, ...] | None = None
    has_payload: bool | None = None
    has_free_sensors: bool = False
    has_lines_masked: bool = True
    kind: Kind | None = None
    expected: Expected | None = None

    def __post_init__(self) -> None:
        check_number("prior_std", self.prior_std, above=0)
        if self.kind is not None:
            check_one_of("kind", self.kind, ("road", "rail", "rig"))
        if self.segment is not None:
            check_number("segment", self.segment, above=0)
        if self.band is not None and not 0 < self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from above 0: correct it")


def vehicle_model(
    spectra: ClassSpectra,
    layout: RigidLayout,
    vehicle: Vehicle,
    nominal: Structure,
    *,
    settings: CornerSettings,
    kind: Kind,
    joint_pitch: float | None = None,
    joint_offset: float = 0.0,
) -> Model:
    """Return the model of a vehicle with the components, payload and sensor errors that the settings make free.

    Parameters
    ----------
    spectra
        Mean spectral matrices of the data by speed class.
    layout
        Coordinates of the data.
    vehicle
        Description of the vehicle, for its axles.
    nominal
        Structure of the vehicle with nominal components: `structure(vehicle)`.
    settings
        Free parameters and their priors.
    kind
        Excitation of the wheels: "road", "rail" or "rig".
    joint_pitch
        Distance between the joints of a track [m]; None: there are none.
    joint_offset
        Distance over the pitch by which those of the right rail are ahead of the left one's.

    Raises
    ------
    ParameterError
        If a free component is unknown.

    Examples
    --------
    Only the springs are free; the road, the driving and the noise are always fitted:

    >>> from sprung.likelihood import CornerSettings, class_spectra, rigid_layout, segment_spectra
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle, structure
    >>> vehicle = read_vehicle("zafira")
    >>> nominal, settings = structure(vehicle), CornerSettings(free=("spring",), has_payload=False)
    >>> layout = rigid_layout(nominal)
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0), seed=1).recording
    >>> spectra = class_spectra(segment_spectra([drive], layout, speed="speed", band=(0.5, 20.0)))
    >>> model = vehicle_model(spectra, layout, vehicle, nominal, settings=settings, kind="road")
    >>> model.names[:6]
    ('front_left.spring', 'front_right.spring', 'rear_left.spring', 'rear_right.spring', 'roughness', 'waviness')
    >>> model.matrix(model.start).shape == spectra.matrices.shape
    True
    """
    if vehicle.bogie and kind != "rail":
        raise ParameterError(f'kind={kind!r} of a vehicle on bogies must be "rail": leave it out')
    components = free_components(nominal, vehicle, settings.free, kind=kind)
    blocks: list[ParameterBlock] = [FreeComponents(nominal, components, log_std=settings.prior_std)]
    if kind != "rig" if settings.has_payload is None else settings.has_payload:
        blocks.append(payload(nominal))
        blocks += [SeatLoads(nominal, vehicle.seat)] if vehicle.seat else []
        wheels = unsprung_masses(nominal)
        bars, tyres = BarStiffness(nominal, DEFAULTS.anti_roll), CorneringStiffness(nominal, DEFAULTS.cornering)
        blocks += [wheels] if kind == "road" and wheels.parts else []
        blocks += [bars] if kind == "road" and bars.names else []
        blocks += [tyres] if tyres.names else []
    if settings.has_free_sensors:
        blocks += [sensor_positions(nominal, layout), SensorDelays(layout, layout.names)]
    blocks += _inputs(spectra, vehicle, nominal, kind, (joint_pitch, joint_offset))
    return Model(nominal, layout, spectra, (*blocks, SensorNoise(layout)))


def _inputs(
    spectra: ClassSpectra, vehicle: Vehicle, nominal: Structure, kind: Kind, joints: tuple[float | None, float]
) -> list[ParameterBlock]:
    """Parameter blocks of the wheels' inputs."""
    if kind == "rig":
        return [RigInputs(spectra, nominal.inputs)]
    positions = np.array([wheel.x for wheel in vehicle.wheels])
    sides = np.sign([wheel.y for wheel in vehicle.wheels])
    by_class = ClassRoughness(spectra.speeds.size)
    if kind == "road":
        return [
            RoadInputs(spectra, positions, sides),
            by_class,
            TrackLevels(sides),
            driving(nominal, positions[0] - positions[-1]),
        ]
    rails = [RailInputs(spectra, positions, sides, DEFAULTS.rail_contact, *joints), by_class]
    return [*rails, *(Alignment(spectra, vehicle, nominal) for _ in range(vehicle.sways_on_bogies))]


def default_choices(
    vehicle: Vehicle, nominal: Structure, settings: CornerSettings, sampling_rate: float
) -> tuple[tuple[float, float], float]:
    """Return the band [Hz] and the length of a segment [s].

    Parameters
    ----------
    vehicle, nominal
        Description and nominal structure of the vehicle.
    settings
        Choices of the user, which take precedence.
    sampling_rate
        Sampling rate of the recordings [Hz].

    Raises
    ------
    ParameterError
        If no axle has a tyre stiffness.

    Notes
    -----
    From 0.4 times the lowest natural frequency (of a body that sways, that of its upright motion) to 1.7 times the
    highest wheel hop, at most 33 times the lower end (65 times on bogies) and 0.4 times the sampling rate; 7.5 periods
    of the slowest mode.
    """
    hops = wheel_hop_frequencies(vehicle)
    if np.all(np.isnan(hops)):
        raise ParameterError(
            f"no axle of the vehicle file {vehicle.name!r} has a tyre_stiffness, by which a road or a rig moves the "
            "vehicle: state that of each axle"
        )
    own = nominal.modes()
    upright = ("bounce", "pitch") if vehicle.bogie else ("bounce", "pitch", "roll")
    is_upright = [label in upright or "sway" not in nominal.coordinates for label in own.labels]
    slowest = float(own.natural_frequency[is_upright][0])
    low = DEFAULTS.below * slowest
    widest = DEFAULTS.widest_on_bogies if vehicle.bogie else DEFAULTS.widest
    high = min(DEFAULTS.above * float(np.nanmax(hops)), widest * low, DEFAULTS.highest * sampling_rate)
    return settings.band or (low, high), settings.segment or DEFAULTS.periods / slowest


def with_sensors(nominal: Structure, names: tuple[str, ...]) -> Structure:
    """Return the structure with only those sensors that were recorded, by the names of their channels."""
    outputs = nominal.outputs
    rows = [row for row, name in enumerate(outputs.names) if name in names]
    kept = Outputs(
        tuple(outputs.channels[row] for row in rows),
        outputs.acceleration[rows],
        outputs.velocity[rows],
        outputs.displacement[rows],
    )
    return replace(nominal, outputs=kept)


def lowest_of_lines(nominal: Structure, kind: Kind) -> float:
    """Return the lowest frequency of lines [Hz]: on a road or track, misfit below it may be the body's own motion."""
    return 0.0 if kind == "rig" else DEFAULTS.lines_over_body * highest_of_body(nominal)
