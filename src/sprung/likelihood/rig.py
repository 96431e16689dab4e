"""Rollers of a rig under the wheels as parameters."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.likelihood.blocks import ParameterBlock, powers
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer

#: Frequency at which the levels are stated [Hz].
_REFERENCE = 10.0


@dataclass(frozen=True, eq=False, slots=True)
class RigInputs(ParameterBlock):
    """Rollers: every wheel has an input of its own, and all wheels, or both of an axle, have parts in common.

    Parameters
    ----------
    spectra
        Data whose frequencies and classes the inputs have.
    inputs
        Names of the inputs, left and right of each axle, front to rear.
    usual_level
        Usual density of the displacement of a roller [m^2/Hz].
    level_std, exponent_std
        Standard deviations of ln of a level and of the exponent before any data.

    Notes
    -----
    S = (f / 10 Hz)^-exponent sum over parts p of level_p e_p e_p^T, e_p = 1 for the wheels of the part and 0 for the
    others. A wheelset that is not driven has levels near 0. Parameters: ln level of each part [m^2/Hz], exponent.
    """

    spectra: ClassSpectra
    inputs: tuple[str, ...]
    usual_level: float = 1e-12
    level_std: float = 10.0
    exponent_std: float = 1.0

    group: ClassVar[str] = "inputs"

    @property
    def parts(self) -> Real:
        """1 for the wheels of each part, shape (parts, inputs)."""
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
        """White inputs, with common parts of a tenth."""
        levels = np.full(len(self.parts), np.log(self.usual_level))
        levels[len(self.inputs) :] -= np.log(10)
        return np.append(levels, 0.0)

    @property
    def prior_std(self) -> Real:
        """Large, so that the data decide."""
        return np.append(np.full(len(self.parts), self.level_std), self.exponent_std)

    @property
    def is_log_power(self) -> Booleans:
        """True for the levels."""
        return np.append(np.ones(len(self.parts), dtype=np.bool_), False)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the spectral matrix of the rollers as inputs."""
        parts = self.parts
        at_reference = np.einsum("p,pu,pv->uv", self._levels(parameters), parts, parts)
        matrix = self._colour(parameters)[:, None, None] * at_reference
        return replace(
            terms, inputs=np.broadcast_to(matrix, (self.spectra.counts.size, *matrix.shape)).astype(np.complex128)
        )

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        parts = self.parts
        by_reference = np.einsum("cfuv,f->uv", gradients.inputs, self._colour(parameters)).real
        levels = self._levels(parameters) * np.einsum("pu,uv,pv->p", parts, by_reference, parts)
        exponent = -np.einsum("f,cfuv->", self._log_frequencies(), gradients.log_inputs.real)
        return np.append(levels, exponent)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        colour = self._colour(parameters)[:, None, None]
        levels = [
            response.change_by_inputs(level * colour * np.outer(part, part))
            for level, part in zip(self._levels(parameters), self.parts, strict=True)
        ]
        exponent = -self._log_frequencies()[:, None, None] * response.terms.inputs
        return [*levels, response.change_by_inputs(exponent)]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the levels [m^2/Hz] and the exponent."""
        return {
            name: value if name == "exponent" else float(np.exp(value))
            for name, value in zip(self.names, parameters.tolist(), strict=True)
        }

    def _levels(self, parameters: Real) -> Real:
        """Levels of the parts [m^2/Hz]."""
        return powers(parameters[:-1])

    def _colour(self, parameters: Real) -> Real:
        """Density over that at the reference frequency, shape (grid,)."""
        return np.asarray((self.spectra.grid / _REFERENCE) ** -parameters[-1], dtype=np.float64)

    def _log_frequencies(self) -> Real:
        """ln(f / reference frequency), shape (grid,)."""
        return np.asarray(np.log(self.spectra.grid / _REFERENCE), dtype=np.float64)
