"""Noise of the sensors as parameters."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.likelihood.blocks import ParameterBlock, powers
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.hermitian import real_coordinates
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer


@dataclass(frozen=True, eq=False, slots=True)
class SensorNoise(ParameterBlock):
    """Noise of every channel; the parameters are ln of its density over the usual variance of the layout.

    Parameters
    ----------
    layout
        Channels, their orders, and the covariance of the coordinates for noise of the usual size on each.
    usual
        Density of the noise before any data, over the usual variance of the layout [1/Hz].
    std
        Standard deviation of its logarithm: large, so that the data decide.

    Notes
    -----
    A channel that measures the time derivative of order o has white noise, which differentiation to an acceleration
    makes w^(2 (2 - o)) times as dense: N = sum over channels e^p w^(2 (2 - o)) N_k.
    """

    layout: RigidLayout
    usual: float = 1e-2
    std: float = 5.0

    group: ClassVar[str] = "noise"

    @property
    def names(self) -> tuple[str, ...]:
        """Names: `noise_` and the name of each channel."""
        return tuple(f"noise_{name}" for name in self.layout.names)

    @property
    def start(self) -> Real:
        """The usual density of every channel."""
        return np.full(len(self.layout.noise), np.log(self.usual))

    @property
    def prior_std(self) -> Real:
        """The same for all channels."""
        return np.full(len(self.layout.noise), self.std)

    @property
    def is_log_power(self) -> Booleans:
        """True for all parameters."""
        return np.ones(len(self.layout.noise), dtype=np.bool_)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the noise of all channels."""
        noise = np.einsum("kf,kij->fij", self._densities(parameters, terms), self.layout.noise)
        return replace(terms, noise=terms.noise + noise)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_density = np.einsum("fij,kij->kf", gradients.noise.real, self.layout.noise)
        return np.sum(by_density * self._densities(parameters, gradients.transfer.terms), axis=1)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        densities = self._densities(parameters, response.terms)
        noise = real_coordinates(self.layout.noise.astype(np.complex128))
        return list(densities[:, :, None] * noise[:, None])

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the densities of the noise over the usual variance [1/Hz]."""
        return dict(zip(self.names, np.exp(parameters).tolist(), strict=True))

    def _densities(self, parameters: Real, terms: Terms) -> Real:
        """Density of each channel's noise over its usual variance, as an acceleration, shape (channels, grid)."""
        pulsation = 2 * np.pi * terms.frequencies
        colours = pulsation ** (2 * (2 - self.layout.orders[:, None]))
        return np.asarray(powers(parameters)[:, None] * colours, dtype=np.float64)
