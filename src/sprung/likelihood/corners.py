"""Springs, dampers and tyres of every corner as a fit gives them."""

from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung._checks import freeze
from sprung.likelihood.whittle import Model
from sprung.vehicles import Component, ExactModes, Structure

#: A parameter is told by the data if they take its prior standard deviation down to this share.
TOLD = 0.5


@dataclass(frozen=True, eq=False, slots=True)
class CornerFit:
    """The vehicle that explains a drive best.

    Parameters
    ----------
    model
        With the data and what is nominal.
    parameters
        All of them, as `model.names`.
    covariance
        Of the parameters, corrected for a model that is not perfect.
    misfit
        Measured over fitted power less 1, shape (coordinates, frequencies), averaged over the classes.
    model_error
        RMS of that beyond what chance gives.
    n_segments, n_rejected
        Segments used, and left out for their speed.
    notes
        What a reader should know, one sentence each.
    from_modes
        ln(value / nominal value) of each component that identified modes alone give, as a check; None without modes.
    """

    model: Model
    parameters: Real
    covariance: Real
    misfit: Real
    model_error: float
    n_segments: int
    n_rejected: int
    notes: tuple[str, ...]
    from_modes: Real | None = None

    def __post_init__(self) -> None:
        freeze(self, parameters=1, covariance=2, misfit=2)

    @property
    def components(self) -> tuple[Component, ...]:
        """Fitted springs, dampers and tyres."""
        return self.model.components

    @property
    def log_ratios(self) -> Real:
        """ln(value / nominal value) of each component."""
        return self.parameters[: len(self.components)]

    @property
    def log_ratios_std(self) -> Real:
        """Standard deviations of `log_ratios`."""
        return np.sqrt(np.diag(self.covariance))[: len(self.components)]

    @property
    def nominal(self) -> Real:
        """Nominal values [N/m, N s/m]."""
        known = self.model.structure.components()
        return np.array([known[component] for component in self.components])

    @property
    def values(self) -> Real:
        """Fitted values [N/m, N s/m]."""
        return self.nominal * np.exp(self.log_ratios)

    @property
    def is_identifiable(self) -> Booleans:
        """Tell which components this run and these sensors tell; the others stay near what the vehicle file says."""
        return self.log_ratios_std < TOLD * self.model.width

    @property
    def inputs(self) -> dict[str, float]:
        """What drives the wheels: level [m^3], exponent, coherence length [m] of a road; levels of a rig [m^2/Hz]."""
        first = self.model.n_free
        found = dict(zip(self.model.inputs.names, self.parameters[first:], strict=False))
        return {
            name: value if name == "exponent" else float(np.exp(value))
            for name, value in found.items()
            if not name.startswith("class_")
        }

    @property
    def payload(self) -> dict[str, dict[str, float]]:
        """What is on the body beyond the vehicle file: mass [kg], moments [kg m], inertias [kg m^2], and deviations."""
        return self._free_parts(len(self.components), {part.name: part.unit for part in self.model.masses})

    @property
    def sensors(self) -> dict[str, dict[str, float]]:
        """Where [m] and how much later [s] than stated the sensors are, with deviations."""
        first = len(self.components) + len(self.model.masses)
        return self._free_parts(first, {part.name: 1.0 for part in self.model.sensors})

    def _free_parts(self, first: int, units: dict[str, float]) -> dict[str, dict[str, float]]:
        """Return parameters in units and their standard deviations."""
        deviations = np.sqrt(np.diag(self.covariance))
        return {
            name: {"value": unit * float(self.parameters[row]), "std": unit * float(deviations[row])}
            for row, (name, unit) in enumerate(units.items(), start=first)
        }

    def structure(self) -> Structure:
        """Return the fitted vehicle."""
        return fitted_structure(self.model, self.parameters)

    def modes(self) -> ExactModes:
        """Return the exact modes of the fitted vehicle."""
        return self.structure().modes()

    def modes_std(self) -> tuple[Real, Real]:
        """Return standard deviations of natural frequencies [Hz] and damping ratios of `modes`, by the delta method."""
        modes = self.modes()
        count = len(self.components) + len(self.model.masses)
        changes = np.empty((2, count, modes.poles.size))
        for number in range(count):
            step = 1e-4 * self.model.widths[number]
            shifted = []
            for sign in (1, -1):
                parameters = self.parameters.copy()
                parameters[number] += sign * step
                shifted.append(_near(fitted_structure(self.model, parameters).modes().poles, modes.poles))
            up, down = shifted
            changes[0, number] = (np.abs(up) - np.abs(down)) / (4 * np.pi * step)
            changes[1, number] = (-up.real / np.abs(up) + down.real / np.abs(down)) / (2 * step)
        covariance = self.covariance[:count, :count]
        frequency, damping = np.sqrt(np.einsum("qim,ij,qjm->qm", changes, covariance, changes))
        return frequency, damping


def fitted_structure(model: Model, parameters: Real) -> Structure:
    """Return the structure of a model with the components and masses of the parameters."""
    factors = {component: float(np.exp(value)) for component, value in zip(model.components, parameters, strict=False)}
    added = sum(
        (p * part.matrix for p, part in zip(parameters[len(model.components) :], model.masses, strict=False)),
        np.zeros_like(model.structure.mass),
    )
    changed = model.structure.changed(factors)
    return replace(changed, mass=changed.mass + added)


def _near(poles: Complex, wanted: Complex) -> Complex:
    """Return the pole nearest to each wanted one."""
    return poles[np.argmin(np.abs(poles[:, None] - wanted), axis=0)]
