"""Spectra of what drives the wheels: a road or track that the rear wheels repeat, or the rollers of a rig."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung.likelihood.spectra import ClassSpectra

#: Standard deviation of ln of the delays over those of speed and geometry.
_DELAY = 0.03
#: Spatial frequency at which the level of a surface is given [1/m], as in ISO 8608.
REFERENCE = 0.1


class InputModel(Protocol):
    """Spectral matrix of the inputs with free parameters."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""

    @property
    def start(self) -> Real:
        """Usual values of the parameters."""

    @property
    def widths(self) -> Real:
        """Standard deviation of the parameters about their usual values, before any data."""

    @property
    def is_level(self) -> Real:
        """1 for parameters whose rise by 1 multiplies all inputs by e, 0 for others."""

    def matrix(self, parameters: Real) -> Complex:
        """Return the one-sided spectral matrix, shape (classes, frequencies, inputs, inputs) [m^2/Hz]."""

    def gradient(self, weight: Complex, matrix: Complex, parameters: Real) -> Real:
        """Return sum of tr(weight dmatrix) for each parameter, weight of the shape of the matrix."""

    def derivatives(self, matrix: Complex, parameters: Real) -> list[Complex]:
        """Return the derivative of the matrix for each parameter."""


@dataclass(frozen=True, eq=False, slots=True)
class SurfaceInputs(ABC):
    """A surface under the wheels: level, shape of its spectrum, coherence of left and right, delay from axle to axle.

    Parameters
    ----------
    spectra
        Gives frequencies, speeds and spreads of the classes.
    positions
        Distance of each input ahead of the centre of gravity [m], shape (inputs,).
    sides
        +1 left, -1 right, shape (inputs,).
    contact_length
        Over which a wheel averages the surface [m].

    Notes
    -----
    With n = f / v: S_ij = level c(n) / v sinc^2(n contact) g_ij(n) e^(-i w (d_i - d_j) / v) b_ij, where d is the
    distance behind the front axle, g_ij the coherence between the sides and 1 on one side, and
    b_ij = exp(-(w (d_i - d_j) / v spread)^2 / 2) blurs the delay by the spread of the speed.
    Parameters: ln level [m^3], those of the form (ln c and ln g), ln of the delays over those of speed and geometry (a
    speedometer and a wheelbase are right to a few per cent), and the ln of each class' level over the common one.
    """

    spectra: ClassSpectra
    positions: Real
    sides: Real
    contact_length: float = 0.1
    _patch: Real = field(init=False, repr=False)
    _lags: Real = field(init=False, repr=False)
    _axles: Indices = field(init=False, repr=False)

    #: Name, usual value and standard deviation of the level and of each parameter of the form.
    usual: ClassVar[dict[str, tuple[float, float]]]

    def __post_init__(self) -> None:
        places, axles = np.unique(-self.positions, return_inverse=True)
        seconds = np.subtract.outer(places, places) / self.spectra.speeds[:, None, None, None]
        object.__setattr__(self, "_axles", axles)
        object.__setattr__(self, "_lags", 2 * np.pi * self.spectra.grid[:, None, None] * seconds)
        object.__setattr__(self, "_patch", np.sinc(self._spatial_frequencies() * self.contact_length) ** 2)

    @abstractmethod
    def form(self, n: Real, parameters: Real) -> tuple[Real, Real, Real, Real]:
        """Return ln c and ln g at wave numbers, and the derivatives of both for each parameter of the form."""

    @property
    def names(self) -> tuple[str, ...]:
        """Level, parameters of the form, delay, and the level of each class."""
        return (*self.usual, "delay", *(f"class_{k}" for k in range(self.spectra.speeds.size)))

    @property
    def start(self) -> Real:
        """A usual surface."""
        return np.concatenate([[value for value, _ in self.usual.values()], np.zeros(1 + self.spectra.speeds.size)])

    @property
    def widths(self) -> Real:
        """Wide, so that the data decide; but for the delays."""
        widths = [width for _, width in self.usual.values()]
        return np.concatenate([widths, [_DELAY], np.full(self.spectra.speeds.size, 0.5)])

    @property
    def is_level(self) -> Real:
        """The level of the surface."""
        return np.eye(len(self.start))[0]

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrix of the surface under the wheels."""
        form, delay, classes = self._split(parameters)
        density, coherence, _, _ = self.form(self._spatial_frequencies(), form)
        level = self._patch * np.exp(parameters[0] + classes)[:, None] / self.spectra.speeds[:, None]
        lags = self._lags * np.exp(delay)
        later = np.exp(-1j * lags - (lags * self.spectra.spreads[:, None, None, None]) ** 2 / 2)
        later *= (level * np.exp(density))[..., None, None]
        across = np.exp(coherence)[..., None, None]
        return later[..., self._axles[:, None], self._axles] * np.where(self._is_across(), across, 1.0)

    def gradient(self, weight: Complex, matrix: Complex, parameters: Real) -> Real:
        """Return the derivatives of sum tr(weight matrix)."""
        products = (weight * matrix.swapaxes(-1, -2)).real
        total = products.sum(axis=(-1, -2))
        across = products[..., self._is_across()].sum(axis=-1)
        _, _, d_density, d_coherence = self.form(self._spatial_frequencies(), self._split(parameters)[0])
        form = np.einsum("pcf,cf->p", d_density, total) + np.einsum("pcf,cf->p", d_coherence, across)
        delayed = (matrix * self._later(parameters)).swapaxes(-1, -2)
        return np.concatenate([[total.sum()], form, [np.sum((weight * delayed).real)], total.sum(axis=1)])

    def derivatives(self, matrix: Complex, parameters: Real) -> list[Complex]:
        """Return the derivative of the spectral matrix for each parameter."""
        classes = np.eye(self.spectra.speeds.size)[:, :, None, None, None]
        _, _, d_density, d_coherence = self.form(self._spatial_frequencies(), self._split(parameters)[0])
        across = np.where(self._is_across(), matrix, 0.0)
        return [
            matrix,
            *(
                density[..., None, None] * matrix + coherence[..., None, None] * across
                for density, coherence in zip(d_density, d_coherence, strict=True)
            ),
            matrix * self._later(parameters),
            *(matrix * member for member in classes),
        ]

    def _later(self, parameters: Real) -> Complex:
        """Return the derivative of ln S for the delay, shape of S."""
        lags = self._lags * np.exp(self._split(parameters)[1])
        found = -1j * lags - (lags * self.spectra.spreads[:, None, None, None]) ** 2
        return found[..., self._axles[:, None], self._axles]

    def _split(self, parameters: Real) -> tuple[Real, float, Real]:
        """Return the parameters of the form, of the delay and of the classes."""
        count = len(self.usual)
        return parameters[1:count], float(parameters[count]), parameters[count + 1 :]

    def _spatial_frequencies(self) -> Real:
        """Spatial frequency of each class and frequency [1/m]."""
        return self.spectra.grid / self.spectra.speeds[:, None]

    def _is_across(self) -> Booleans:
        """Tell which pairs of wheels are on different sides."""
        return np.not_equal.outer(self.sides, self.sides)


@dataclass(frozen=True, eq=False, slots=True)
class RoadInputs(SurfaceInputs):
    """A road: c = (n / n0)^-exponent, g = exp(-coherence length n)."""

    usual = {"level": (np.log(256e-6), 5.0), "exponent": (2.0, 0.3), "coherence_length": (np.log(1.5), 1.0)}  # noqa: RUF012

    def form(self, n: Real, parameters: Real) -> tuple[Real, Real, Real, Real]:
        """Return the form of a road."""
        steep, length = np.log(n / REFERENCE), np.exp(parameters[1])
        nothing = np.zeros_like(n)
        return (
            -parameters[0] * steep,
            -length * n,
            np.stack([-steep, nothing]),
            np.stack([nothing, -length * n]),
        )


@dataclass(frozen=True, eq=False, slots=True)
class RailInputs(SurfaceInputs):
    """A track: c = (n / n0)^-exponent / (1 + (n / bend)^2), g = 1 / (1 + 2 (n / cross)^2).

    Notes
    -----
    The spectra of ERRI B176 (see `sprung.excitation.Rail`) above their lowest bend, which is far longer than a vehicle.
    """

    usual = {  # noqa: RUF012
        "level": (np.log(1e-6), 10.0),
        "exponent": (2.0, 0.5),
        "bend": (np.log(0.8246 / (2 * np.pi)), 0.5),
        "cross": (np.log(0.4380 / (2 * np.pi)), 1.0),
    }

    def form(self, n: Real, parameters: Real) -> tuple[Real, Real, Real, Real]:
        """Return the form of a track."""
        steep, bend, cross = np.log(n / REFERENCE), (n / np.exp(parameters[1])) ** 2, (n / np.exp(parameters[2])) ** 2
        nothing = np.zeros_like(n)
        return (
            -parameters[0] * steep - np.log1p(bend),
            -np.log1p(2 * cross),
            np.stack([-steep, 2 * bend / (1 + bend), nothing]),
            np.stack([nothing, nothing, 4 * cross / (1 + 2 * cross)]),
        )


@dataclass(frozen=True, eq=False, slots=True)
class RigInputs:
    """Rollers: every wheel an input of its own, and parts that all wheels, or both of an axle, have in common.

    Parameters
    ----------
    spectra
        Gives frequencies and classes.
    inputs
        Names, left and right of each axle, front to rear.
    usual_level
        In m^2/Hz.

    Notes
    -----
    S = (f / 10 Hz)^-exponent sum over parts p of level_p e_p e_p^T, e_p = 1 for the wheels of the part and 0 for the
    others. A wheelset that is not driven has levels near 0. Parameters: ln level of each part [m^2/Hz], exponent.
    """

    spectra: ClassSpectra
    inputs: tuple[str, ...]
    usual_level: float = 1e-12

    @property
    def parts(self) -> Real:
        """Wheels of each part, shape (parts, inputs)."""
        each, count = np.eye(len(self.inputs)), len(self.inputs)
        axles = np.kron(np.eye(count // 2), np.ones(2))
        return np.concatenate([each, axles, np.ones((1, count))]) if count > 2 else np.concatenate([each, axles])

    @property
    def names(self) -> tuple[str, ...]:
        """The level of each part, and the exponent."""
        axles = [f"axle_{number + 1}" for number in range(len(self.inputs) // 2)]
        every = ["all"] if len(self.inputs) > 2 else []
        return (*(f"level_{name}" for name in (*self.inputs, *axles, *every)), "exponent")

    @property
    def start(self) -> Real:
        """White inputs, common parts a tenth."""
        levels = np.full(len(self.parts), np.log(self.usual_level))
        levels[len(self.inputs) :] -= np.log(10)
        return np.append(levels, 0.0)

    @property
    def widths(self) -> Real:
        """Wide: the data decide."""
        return np.append(np.full(len(self.parts), 10.0), 1.0)

    @property
    def is_level(self) -> Real:
        """The levels."""
        return np.append(np.ones(len(self.parts)), 0.0)

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrix of the inputs."""
        colour = self._relative() ** -parameters[-1]
        parts = self.parts
        together = np.einsum("p,pu,pv->uv", np.exp(np.minimum(parameters[:-1], 100.0)), parts, parts)
        matrix = colour[:, None, None] * together
        return np.broadcast_to(matrix, (self.spectra.counts.size, *matrix.shape)).astype(np.complex128)

    def gradient(self, weight: Complex, matrix: Complex, parameters: Real) -> Real:
        """Return the derivatives of sum tr(weight matrix)."""
        colour = self._relative() ** -parameters[-1]
        parts = self.parts
        together = np.einsum("cfuv,f->uv", weight, colour).real
        levels = np.exp(np.minimum(parameters[:-1], 100.0)) * np.einsum("pu,uv,pv->p", parts, together, parts)
        steep = np.log(self._relative())
        return np.append(levels, -np.einsum("f,cfuv,cfvu->", steep, weight, matrix).real)

    def derivatives(self, matrix: Complex, parameters: Real) -> list[Complex]:
        """Return the derivative of the spectral matrix for each parameter."""
        colour = (self._relative() ** -parameters[-1])[:, None, None]
        found = [
            np.broadcast_to(np.exp(level) * colour * np.outer(part, part), matrix.shape).astype(np.complex128)
            for level, part in zip(parameters, self.parts, strict=False)
        ]
        return [*found, -np.log(self._relative())[:, None, None] * matrix]

    def _relative(self) -> Real:
        """Frequencies over 10 Hz."""
        return self.spectra.grid / 10.0
