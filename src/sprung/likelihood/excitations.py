"""Inputs that are not the height of the road as parameters: braking and cornering, and the alignment of a track."""

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung.errors import ParameterError
from sprung.likelihood.blocks import ParameterBlock, powers
from sprung.likelihood.hermitian import real_coordinates
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer, classes_times, times_classes
from sprung.vehicles import Structure, Vehicle
from sprung.vehicles.lateral import rolling_on_rails


@dataclass(frozen=True, slots=True)
class DriverPrior:
    """What is known of a driver before any data."""

    #: ln of the density of an acceleration at 1 Hz for a calm driver [(m/s^2)^2/Hz].
    level: float = float(np.log(1e-2))
    #: Its standard deviation: large, so that the data decide.
    level_std: float = 4.0
    #: Exponent of the density: between a step of the acceleration (2) and a ramp (4).
    exponent: float = 3.0
    #: Its standard deviation.
    exponent_std: float = 1.0
    #: Height of the centre of gravity above the ground, over the wheelbase.
    height: float = 0.2


PRIOR = DriverPrior()


@dataclass(frozen=True, eq=False, slots=True)
class Driving(ParameterBlock):
    """Longitudinal and lateral accelerations by the driver, not measured, which pitch and roll the body.

    Parameters
    ----------
    structure
        Nominal vehicle with pitch and roll of a body.
    height
        Height of the centre of gravity above the ground [m].

    Notes
    -----
    By d'Alembert's principle an acceleration (a_x, a_y) of a body of mass m, whose tyres hold it on the ground, acts as
    the moments -m h a_x in pitch (positive nose down) and m h a_y in roll (positive left side up), at the height h of
    the centre of gravity. Both accelerations are random, independent of the road and of each other, with the one-sided
    density e^level (f / 1 Hz)^-exponent: steps of an acceleration would have the exponent 2, its ramps 4 above the
    inverse of their duration. A level far below the motion by the road has no effect. The accelerations are the last
    two inputs of the model, `Terms.measured_inputs`, so that tilted sensors can read them, too.

    References
    ----------
    ISO 8855:2011, Road vehicles - Vehicle dynamics and road-holding ability - Vocabulary (axes).
    T. D. Gillespie, Fundamentals of Vehicle Dynamics, SAE International, 1992, chapter 1 (dynamic axle loads).
    """

    structure: Structure
    height: float

    group: ClassVar[str] = "driving"

    def __post_init__(self) -> None:
        if not {"pitch", "roll"} <= set(self.structure.coordinates):
            raise ParameterError("braking and cornering need a body with pitch and roll: leave them out")

    @property
    def names(self) -> tuple[str, ...]:
        """Levels and exponents of both accelerations."""
        return ("braking", "cornering", "braking_exponent", "cornering_exponent")

    @property
    def start(self) -> Real:
        """A calm driver."""
        return np.array([PRIOR.level, PRIOR.level, PRIOR.exponent, PRIOR.exponent])

    @property
    def prior_std(self) -> Real:
        """Large for the levels, so that the data decide."""
        return np.array([PRIOR.level_std, PRIOR.level_std, PRIOR.exponent_std, PRIOR.exponent_std])

    @property
    def is_log_power(self) -> Booleans:
        """True for the levels."""
        return np.array([True, True, False, False])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with both accelerations as further inputs."""
        densities = self._densities(parameters, terms)
        spectral_matrix = densities.T[:, :, None] * np.eye(2)
        n_classes = terms.inputs.shape[0]
        return replace(
            terms,
            forces=np.hstack([terms.forces, self._moments()]),
            feet=np.hstack([terms.feet, np.zeros((len(terms.feet), 2))]),
            feedthrough=np.hstack([terms.feedthrough, np.zeros((len(terms.feedthrough), 2))]),
            measured_inputs=np.broadcast_to(spectral_matrix, (n_classes, *spectral_matrix.shape)).astype(np.complex128),
        )

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective: Re (Q H)_kk is that with respect to ln of the density of input k."""
        response = gradients.transfer
        by_log = np.einsum("fkc,fck->kf", gradients.driven[:, -2:], response.matrix[..., -2:]).real
        return np.append(by_log.sum(axis=1), -by_log @ self._log_frequencies(response.terms))

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        responses = response.matrix[..., -2:]
        driven = real_coordinates(
            np.einsum("kf,fik,fjk->kfij", self._densities(parameters, response.terms), responses, responses.conj())
        )
        return [*driven, *(-self._log_frequencies(response.terms)[:, None] * driven)]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the densities of both accelerations at 1 Hz [(m/s^2)^2/Hz], and the exponents."""
        return dict(zip(self.names, (*np.exp(parameters[:2]).tolist(), *parameters[2:].tolist()), strict=True))

    def _moments(self) -> Real:
        """Generalised forces of both accelerations, shape (n, 2)."""
        moments = np.zeros((len(self.structure.coordinates), 2))
        mass = self.structure.mass[0, 0]
        moments[self.structure.coordinates.index("pitch"), 0] = -mass * self.height
        moments[self.structure.coordinates.index("roll"), 1] = mass * self.height
        return moments

    def _densities(self, parameters: Real, terms: Terms) -> Real:
        """Densities of both accelerations, shape (2, grid)."""
        levels = powers(parameters[:2])
        colours = np.exp(-parameters[2:, None] * self._log_frequencies(terms))
        return np.asarray(levels[:, None] * colours, dtype=np.float64)

    def _log_frequencies(self, terms: Terms) -> Real:
        """Ln of the frequency over 1 Hz, shape (grid,)."""
        return np.asarray(np.log(terms.frequencies), dtype=np.float64)


def driving(structure: Structure, wheelbase: float) -> Driving:
    """Return braking and cornering of a vehicle whose height of the centre of gravity is not known.

    Parameters
    ----------
    structure
        Nominal vehicle with pitch and roll of a body.
    wheelbase
        Distance of the first axle from the last one [m]; the centre of gravity is a fifth of it above the ground. An
        error of the height is one of the levels.

    Examples
    --------
    The centre of gravity is a fifth of the wheelbase of 2.8 m above the ground:

    >>> from sprung.vehicles import read_vehicle, structure
    >>> block = driving(structure(read_vehicle("zafira")), 2.8)
    >>> round(block.height, 2), block.names[:2]
    (0.56, ('braking', 'cornering'))
    """
    return Driving(structure, PRIOR.height * wheelbase)


@dataclass(frozen=True, eq=False, slots=True)
class Alignment(ParameterBlock):
    """Alignment of the track, not measured, which the wheelsets meet one after another.

    Parameters
    ----------
    spectra
        Data whose frequencies, speeds and spreads the track is seen at.
    vehicle, structure
        Vehicle with lateral tables, and its nominal structure.

    Notes
    -----
    Lateral displacement of the centre line, independent of the height of the rails, with the spectrum of ERRI B176
    times e^level (f / 1 Hz)^-exponent; delays and their blur as in `SurfaceInputs`. The displacements under the
    wheelsets are the last inputs of the model, `Terms.measured_inputs`.

    References
    ----------
    ERRI B176, Bogies with steered or steering wheelsets (1989).
    """

    spectra: ClassSpectra
    vehicle: Vehicle
    structure: Structure
    _forces: Real = field(init=False, repr=False)
    _track: Complex = field(init=False, repr=False)

    group: ClassVar[str] = "driving"
    #: Standard deviations of the level, large so that the data decide, and of the exponent.
    stds: ClassVar[tuple[float, float]] = (4.0, 0.5)

    def __post_init__(self) -> None:
        forces = rolling_on_rails(self.vehicle, self.structure.coordinates, speed=1.0)[2]
        behind, speeds = np.array([-wheel.x for wheel in self.vehicle.wheels[::2]]), self.spectra.speeds[:, None]
        lags = 2 * np.pi * (self.spectra.grid / speeds)[..., None, None] * np.subtract.outer(behind, behind)
        blur = (lags * self.spectra.spreads[:, None, None, None]) ** 2
        density = track_densities(self.spectra.grid / speeds)[0] / speeds
        object.__setattr__(self, "_forces", forces)
        object.__setattr__(self, "_track", density[..., None, None] * np.exp(-1j * lags - blur / 2))

    @property
    def names(self) -> tuple[str, ...]:
        """Level and exponent."""
        return ("alignment", "alignment_exponent")

    @property
    def prior_std(self) -> Real:
        """Large for the level, so that the data decide."""
        return np.array(self.stds)

    @property
    def is_log_power(self) -> Booleans:
        """True for the level."""
        return np.array([True, False])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the alignment under each wheelset as further inputs."""
        n = self._forces.shape[1]
        return replace(
            terms,
            forces=np.hstack([terms.forces, self._forces]),
            feet=np.hstack([terms.feet, np.zeros((len(terms.feet), n))]),
            feedthrough=np.hstack([terms.feedthrough, np.zeros((len(terms.feedthrough), n))]),
            measured_inputs=self._inputs(parameters, terms),
        )

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective: Re tr(Q H) over these inputs is that with respect to ln density."""
        n, response = self._forces.shape[1], gradients.transfer
        by_log = np.einsum("fkc,fck->f", gradients.driven[:, -n:], response.matrix[..., -n:]).real
        return np.array([by_log.sum(), -by_log @ np.log(response.terms.frequencies)])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        H, inputs = response.matrix[..., -self._forces.shape[1] :], response.terms.measured_inputs
        driven = real_coordinates(times_classes(H, classes_times(inputs, H.conj().swapaxes(-1, -2))))
        return [driven, -np.log(response.terms.frequencies)[:, None] * driven]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the density over that of ERRI B176 low at 1 Hz, and the exponent."""
        return dict(zip(self.names, (float(powers(parameters[:1])[0]), float(parameters[1])), strict=True))

    def _inputs(self, parameters: Real, terms: Terms) -> Complex:
        """Spectral matrix of the displacements, shape (classes, grid, wheelsets, wheelsets)."""
        level = powers(parameters[0] - parameters[1] * np.log(terms.frequencies))
        return np.asarray(level[:, None, None] * self._track, dtype=np.complex128)


def track_densities(spatial_frequency: Real) -> tuple[Real, Real]:
    """Return the densities of alignment [m^3] and roll of the track [m rad^2] of ERRI B176 but for their levels."""
    squared = (2 * np.pi * spatial_frequency) ** 2
    form = 1e-7 / ((squared + 0.0206**2) * (squared + 0.8246**2))
    return form, form * squared / (squared + 0.4380**2)
