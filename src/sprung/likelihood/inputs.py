"""Spectra of what drives the wheels: a road that the rear wheels repeat, or independent inputs of a rig."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sprung.likelihood.spectra import ClassSpectra

#: Spatial frequency at which the level of a road is given [1/m], as in ISO 8608.
REFERENCE = 0.1


class InputModel(Protocol):
    """Spectral matrix of the inputs with free parameters."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""

    @property
    def start(self) -> NDArray[np.float64]:
        """Usual values of the parameters."""

    @property
    def widths(self) -> NDArray[np.float64]:
        """Standard deviation of the parameters about their usual values, before any data."""

    @property
    def is_level(self) -> NDArray[np.float64]:
        """1 for parameters whose rise by 1 multiplies all inputs by e, 0 for others."""

    def matrix(self, parameters: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the one-sided spectral matrix, shape (classes, frequencies, inputs, inputs) [m^2/Hz]."""

    def gradient(
        self, weight: NDArray[np.complex128], matrix: NDArray[np.complex128], parameters: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return sum of tr(weight dmatrix) for each parameter, weight of the shape of the matrix."""

    def derivatives(
        self, matrix: NDArray[np.complex128], parameters: NDArray[np.float64]
    ) -> list[NDArray[np.complex128]]:
        """Return the derivative of the matrix for each parameter."""


@dataclass(frozen=True, eq=False, slots=True)
class RoadInputs:
    """A road under the wheels: level, exponent, coherence of left and right, delay from axle to axle.

    Parameters
    ----------
    spectra
        Gives frequencies, speeds and spreads of the classes.
    positions
        Distance of each input ahead of the centre of gravity [m], shape (inputs,).
    sides
        +1 left, -1 right, shape (inputs,).
    contact_length
        Over which a tyre averages the road [m].

    Notes
    -----
    With n = f / v: S_ij = level (n / n0)^-exponent / v sinc^2(n contact) g_ij e^(-i w (d_i - d_j) / v) b_ij, where
    d is the distance behind the front axle, g_ij = exp(-coherence length n) between the sides and 1 on one side, and
    b_ij = exp(-(w (d_i - d_j) / v spread)^2 / 2) blurs the delay by the spread of the speed.
    Parameters: ln level [m^3], exponent, ln coherence length [m], and the ln of each class' level over the common one.
    """

    spectra: ClassSpectra
    positions: NDArray[np.float64]
    sides: NDArray[np.float64]
    contact_length: float = 0.1
    _fixed: NDArray[np.complex128] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_fixed", self._pattern())

    @property
    def names(self) -> tuple[str, ...]:
        """Level, exponent, coherence length, and the level of each class."""
        return ("level", "exponent", "coherence_length", *(f"class_{k}" for k in range(self.spectra.speeds.size)))

    @property
    def start(self) -> NDArray[np.float64]:
        """A class C road."""
        return np.concatenate([[np.log(256e-6), 2.0, np.log(1.5)], np.zeros(self.spectra.speeds.size)])

    @property
    def widths(self) -> NDArray[np.float64]:
        """Wide: the data decide."""
        return np.concatenate([[5.0, 0.3, 1.0], np.full(self.spectra.speeds.size, 0.5)])

    @property
    def is_level(self) -> NDArray[np.float64]:
        """The level of the road."""
        return np.concatenate([[1.0, 0.0, 0.0], np.zeros(self.spectra.speeds.size)])

    def matrix(self, parameters: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the spectral matrix of the road under the wheels."""
        n = self._wave_numbers()
        level = np.exp(parameters[0] + parameters[3:])[:, None]
        density = level * (n / REFERENCE) ** -parameters[1] / self.spectra.speeds[:, None]
        coherence = np.exp(-np.exp(parameters[2]) * n)
        return np.asarray(
            density[..., None, None] * self._fixed * np.where(self._is_across(), coherence[..., None, None], 1.0)
        )

    def gradient(
        self, weight: NDArray[np.complex128], matrix: NDArray[np.complex128], parameters: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives of sum tr(weight matrix)."""
        n = self._wave_numbers()
        products = (weight * matrix.swapaxes(-1, -2)).real
        total = products.sum(axis=(-1, -2))
        across = products[..., self._is_across()].sum(axis=-1)
        return np.concatenate(
            [
                [total.sum(), -(np.log(n / REFERENCE) * total).sum(), -(np.exp(parameters[2]) * n * across).sum()],
                total.sum(axis=1),
            ]
        )

    def derivatives(
        self, matrix: NDArray[np.complex128], parameters: NDArray[np.float64]
    ) -> list[NDArray[np.complex128]]:
        """Return the derivative of the spectral matrix for each parameter."""
        n = self._wave_numbers()[..., None, None]
        classes = np.eye(self.spectra.speeds.size)[:, :, None, None, None]
        return [
            matrix,
            -np.log(n / REFERENCE) * matrix,
            -np.exp(parameters[2]) * n * np.where(self._is_across(), matrix, 0.0),
            *(matrix * member for member in classes),
        ]

    def _wave_numbers(self) -> NDArray[np.float64]:
        """Spatial frequency of each class and frequency [1/m]."""
        return self.spectra.grid / self.spectra.speeds[:, None]

    def _is_across(self) -> NDArray[np.bool_]:
        """Tell which pairs of wheels are on different sides."""
        return np.not_equal.outer(self.sides, self.sides)

    def _pattern(self) -> NDArray[np.complex128]:
        """Contact patch, delays and their blur: what does not depend on the parameters."""
        behind = self.positions.max() - self.positions
        delay = np.subtract.outer(behind, behind) / self.spectra.speeds[:, None, None, None]
        pulsation = 2 * np.pi * self.spectra.grid[:, None, None]
        blur = np.exp(-((pulsation * delay * self.spectra.spreads[:, None, None, None]) ** 2) / 2)
        patch = np.sinc(self._wave_numbers() * self.contact_length)[..., None, None] ** 2
        return np.asarray(patch * blur * np.exp(-1j * pulsation * delay))


@dataclass(frozen=True, eq=False, slots=True)
class IndependentInputs:
    """Independent inputs at every wheel, each with a level of its own and one exponent for all.

    Notes
    -----
    S_ii = level_i (f / 10 Hz)^-exponent. Parameters: ln level of each input [m^2/Hz], exponent.
    """

    spectra: ClassSpectra
    inputs: tuple[str, ...]
    usual_level: float = 1e-12

    @property
    def names(self) -> tuple[str, ...]:
        """The level of each input, and the exponent."""
        return (*(f"level_{name}" for name in self.inputs), "exponent")

    @property
    def start(self) -> NDArray[np.float64]:
        """White inputs."""
        return np.array([*[np.log(self.usual_level)] * len(self.inputs), 0.0])

    @property
    def widths(self) -> NDArray[np.float64]:
        """Wide: the data decide."""
        return np.array([*[10.0] * len(self.inputs), 1.0])

    @property
    def is_level(self) -> NDArray[np.float64]:
        """The levels."""
        return np.append(np.ones(len(self.inputs)), 0.0)

    def matrix(self, parameters: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the spectral matrix of the inputs."""
        colour = self._relative() ** -parameters[-1]
        diagonal = np.einsum("f,u,uv->fuv", colour, np.exp(parameters[:-1]), np.eye(len(self.inputs)))
        return np.broadcast_to(diagonal, (self.spectra.counts.size, *diagonal.shape)).astype(np.complex128)

    def gradient(
        self, weight: NDArray[np.complex128], matrix: NDArray[np.complex128], parameters: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives of sum tr(weight matrix)."""
        products = np.einsum("cfuu,cfuu->fu", weight, matrix).real
        return np.append(products.sum(axis=0), -(np.log(self._relative()) @ products.sum(axis=1)))

    def derivatives(
        self, matrix: NDArray[np.complex128], parameters: NDArray[np.float64]
    ) -> list[NDArray[np.complex128]]:
        """Return the derivative of the spectral matrix for each parameter."""
        masks = np.eye(len(self.inputs))
        return [*(matrix * np.diag(mask) for mask in masks), -np.log(self._relative())[:, None, None] * matrix]

    def _relative(self) -> NDArray[np.float64]:
        """Frequencies over 10 Hz."""
        return self.spectra.grid / 10.0
