"""Fitted springs, dampers and tyres of every corner, and first values of them from identified modes."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung._checks import freeze
from sprung._display import Drawable, Savable, Tabular, counted, in_short, listed
from sprung.errors import ParameterError
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.masked_lines import SpectralLine
from sprung.likelihood.search import Differenced, least_squares
from sprung.likelihood.speed_delay import SpeedDelay
from sprung.likelihood.suspension_forces import DrivenSegments
from sprung.likelihood.whittle import Model
from sprung.modal import Modes
from sprung.vehicles import Component, ExactModes, Structure

#: A parameter is identifiable if the data reduce the standard deviation of its prior to this share or less.
IDENTIFIABLE = 0.5


@dataclass(frozen=True, slots=True)
class CornerLimits:
    """Limits of fitted corners."""

    #: Factor between fitted springs or tyres and nominal on both sides of an axle, and between left and right, that no
    #: car of the vehicle file has.
    implausible: float = 1.5
    #: Step of the numerical derivatives of the modes, over the standard deviation of the prior.
    step: float = 1e-4


LIMITS = CornerLimits()


@dataclass(frozen=True, eq=False, slots=True)
class CornerFit(Tabular, Savable, Drawable):
    """The vehicle that explains a drive best.

    Parameters
    ----------
    model
        Data, nominal vehicle and free parameters.
    parameters
        Fitted parameters of the model, in the order of `model.names`.
    covariance
        Covariance of `parameters`, corrected for the error of the model.
    misfit
        Measured over fitted power less 1, averaged over the classes, shape (coordinates, frequencies).
    model_error
        RMS of `misfit` in excess of chance.
    n_segments, n_rejected
        Number of segments used, and of those left out for their speed.
    notes
        Remarks on the fit, one sentence each.
    from_modes
        ln(value / nominal value) of each component from identified modes alone, as a check; None without modes.
    speed_delay
        Delay of the speed channel; None without one.
    driven
        Segments of a drive on a road, which hold more than their mean spectra; None: not kept.
    lines
        Lines of wheels, engine or mains that were left out of the spectra.
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
    speed_delay: SpeedDelay | None = None
    driven: DrivenSegments | None = None
    lines: tuple[SpectralLine, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, parameters=1, covariance=2, misfit=2)

    def __repr__(self) -> str:
        """Return the quality of the fit, and the components that deviate most from nominal."""
        known = np.flatnonzero(self.is_identifiable)
        order = sorted(known, key=lambda row: -abs(self.log_ratios[row]) / self.log_ratios_std[row])
        changes = (f"{self.components[row]} {100 * np.expm1(self.log_ratios[row]):+z.1f} %" for row in order)
        quality = f"{counted(self.n_segments, 'segment')}, model error {100 * self.model_error:.2g} %"
        head = f"CornerFit: {len(known)} of {counted(len(self.components), 'component')} identifiable from {quality}"
        return in_short(head, f"from nominal: {listed(changes)}" if order else "", *self.notes[:1])

    @property
    def components(self) -> tuple[Component, ...]:
        """Fitted springs, dampers and tyres."""
        return self.model.components

    @property
    def log_ratios(self) -> Real:
        """ln(value / nominal value) of each component."""
        return self.parameters[self.model.rows("components")]

    @property
    def log_ratios_std(self) -> Real:
        """Standard deviations of `log_ratios`."""
        return self._std[self.model.rows("components")]

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
        """Whether the data determine each component; estimates of the others stay near nominal."""
        return self.log_ratios_std < IDENTIFIABLE * self.model.prior_std[self.model.rows("components")]

    @property
    def share_of_lines(self) -> float:
        """Share of the spectra, weighted by their segments, that the fit leaves out for lines."""
        spectra = self.model.spectra
        return 1.0 - float(spectra.counts @ np.mean(spectra.weights > 0, axis=1)) / spectra.n_segments

    @property
    def implausible_axles(self) -> dict[str, float]:
        """Springs and tyres that are implausible on both sides of an axle, such as "front tyres": value over nominal.

        Notes
        -----
        Geometric mean of both sides, where it is beyond a factor 1.5 by more than its standard deviation. Faults are
        seldom on both sides, and worn dampers are: springs and tyres of other values mean another vehicle than the
        file's, or a file that lacks something. Left out are axles of which one side is not fitted.
        """
        return self._beyond(("spring", "tyre"), weights=(0.5, 0.5))

    @property
    def uneven_axles(self) -> dict[str, float]:
        """Components that differ from left to right beyond production scatter, such as "rear dampers": left over right.

        Notes
        -----
        Where the ratio is beyond a factor 1.5 by more than its standard deviation: a fault, or an error of the model.
        """
        return self._beyond(("spring", "damper", "tyre"), weights=(1.0, -1.0))

    def _beyond(self, kinds: tuple[str, ...], *, weights: tuple[float, float]) -> dict[str, float]:
        """Return exp of a sum of left and right ln ratios for the axles where it is implausible."""
        rows: dict[str, list[int]] = {}
        for row, component in enumerate(self.components):
            if component.kind in kinds:
                rows.setdefault(f"{component.axle} {component.kind}s", []).append(row)
        beyond = {}
        for name, pair in rows.items():
            if len(pair) != len(weights):
                continue
            weight = np.array(weights)
            covariance = self.covariance[np.ix_(*2 * (self.model.rows("components")[pair],))]
            size, std = float(weight @ self.log_ratios[pair]), float(np.sqrt(weight @ covariance @ weight))
            if abs(size) > np.log(LIMITS.implausible) + std:
                beyond[name] = float(np.exp(size))
        return beyond

    @property
    def inputs(self) -> dict[str, float]:
        """Fitted inputs of the wheels.

        Roughness [m^3], waviness, deviations, coherence length [m], its power, and delay of a road; for a track bends
        [1/m] in place of deviations and coherence; levels [m^2/Hz] and exponent of a rig.
        """
        return self._values("inputs", self.parameters)

    @property
    def payload(self) -> dict[str, dict[str, float]]:
        """Mass [kg], moments [kg m] and inertias [kg m^2] on the body beyond the vehicle file, "value" and "std"."""
        return self._estimates("payload")

    @property
    def sensors(self) -> dict[str, dict[str, float]]:
        """Errors of the sensors' positions [m] and delays [s], "value" and "std"."""
        return self._estimates("sensors")

    @property
    def speed(self) -> dict[str, dict[str, float]]:
        """Delay of the speed channel [s] as `speed_delay`, "value" and "std"; empty without a speed channel."""
        if self.speed_delay is None:
            return {}
        return {"speed_delay": {"value": self.speed_delay.value, "std": self.speed_delay.std}}

    @property
    def _std(self) -> Real:
        """Standard deviations of `parameters`."""
        return np.sqrt(np.diag(self.covariance))

    def _values(self, group: str, parameters: Real) -> dict[str, float]:
        """Physical values of the blocks of a group."""
        values: dict[str, float] = {}
        for block, own in self.model.by_block(parameters):
            if block.group == group:
                values |= {name: values.get(name, 0.0) + value for name, value in block.values(own).items()}
        return values

    def _estimates(self, group: str) -> dict[str, dict[str, float]]:
        """Physical values and standard deviations of the blocks of a group, whose values are linear in parameters."""
        rows = self.model.rows(group)
        units = [self._values(group, unit) for unit in np.eye(self.parameters.size)[rows]]
        covariance = self.covariance[np.ix_(rows, rows)]
        estimates = {}
        for name, value in self._values(group, self.parameters).items():
            slopes = np.array([unit[name] for unit in units])
            estimates[name] = {"value": value, "std": float(np.sqrt(slopes @ covariance @ slopes))}
        return estimates

    def structure(self) -> Structure:
        """Return the fitted vehicle."""
        return fitted_structure(self.model, self.parameters)

    def modes(self) -> ExactModes:
        """Return the exact modes of the fitted vehicle."""
        return self.structure().modes()

    def modes_std(self) -> tuple[Real, Real]:
        """Return the standard deviations of natural frequencies [Hz] and damping ratios of `modes`.

        Notes
        -----
        By the delta method: variance g^T covariance g, g the derivative with respect to the parameters of the vehicle
        (`modes_derivatives`).
        """
        derivatives = self.modes_derivatives()
        frequency, damping = np.sqrt(np.einsum("qim,ij,qjm->qm", derivatives, self.covariance, derivatives))
        return frequency, damping

    def modes_derivatives(self) -> Real:
        """Return the derivatives of natural frequencies [Hz] and damping ratios of `modes`, by central differences.

        Returns
        -------
        ndarray
            With respect to each of `parameters`, shape (2, parameters, modes); 0 for those of inputs and sensors.
        """
        modes = self.modes()
        derivatives = np.zeros((2, self.parameters.size, modes.poles.size))
        for row in np.flatnonzero(is_structural(self.model)):
            step = LIMITS.step * self.model.prior_std[row]
            above, below = (self._poles_near(modes.poles, int(row), sign * step) for sign in (1, -1))
            derivatives[0, row] = (np.abs(above) - np.abs(below)) / (4 * np.pi * step)
            derivatives[1, row] = (-above.real / np.abs(above) + below.real / np.abs(below)) / (2 * step)
        return derivatives

    def _poles_near(self, poles: Complex, row: int, step: float) -> Complex:
        """Poles of the vehicle with one parameter changed, each the nearest to one of `poles`."""
        parameters = self.parameters.copy()
        parameters[row] += step
        changed = fitted_structure(self.model, parameters).modes().poles
        return changed[np.argmin(np.abs(changed[:, None] - poles), axis=0)]


def fitted_structure(model: Model, parameters: Real) -> Structure:
    """Return the structure of a model with the components, masses and others of the parameters.

    Parameters
    ----------
    model
        Nominal structure and blocks of parameters.
    parameters
        Parameters of the model.
    """
    structure = model.structure
    for block, own in model.by_block(parameters):
        structure = block.fitted(own, structure)
    return structure


def is_structural(model: Model) -> Booleans:
    """Whether each parameter changes the structure of the vehicle."""
    changes = [
        np.full(own.size, block.fitted(own, model.structure) is not model.structure)
        for block, own in model.by_block(model.start)
    ]
    return np.concatenate(changes)


def corners_from_modes(
    modes: Modes,
    structure: Structure,
    layout: RigidLayout,
    components: tuple[Component, ...],
    *,
    prior_std: float = 0.7,
    pole_error: float = 0.02,
) -> Real:
    """Return ln(value / nominal value) of components from poles and mode shapes.

    Parameters
    ----------
    modes
        Bounce, pitch and roll, or some of them, with the channels of the layout (other channels are ignored).
    structure
        Vehicle with nominal components.
    layout
        Coordinates of the channels, which must be motions of the body.
    components
        Components to fit; those that the modes do not determine stay near nominal.
    prior_std
        Standard deviation of ln(value / nominal value) before any mode.
    pole_error
        Relative error of an identified pole.

    Returns
    -------
    ndarray
        ln(value / nominal value), shape (components,).

    Raises
    ------
    ParameterError
        If a coordinate of the layout is not a motion of the body, or the modes lack one of its channels.

    Notes
    -----
    A mode of pole s and shape q of the body satisfies (M s^2 + C(s) s + K(s)) q = 0 on the rigid body's coordinates,
    where C(s) and K(s) hold wheels, mounted masses and tyres by elimination: with the dynamic stiffness D(s) in blocks
    of the body (b) and the others (o), the Schur complement gives (D_bb - D_bo D_oo^-1 D_ob) q = 0. With tyres much
    stiffer than springs these are the M^-1 K and M^-1 C of the thesis. Least squares over all modes, weighted for an
    error of a pole, and over the prior.

    References
    ----------
    F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, thesis, University of
    Huddersfield, 2020, section 4.3.2.
    F. Zhang (editor), The Schur Complement and Its Applications, Springer, 2005.

    Examples
    --------
    The exact modes of the body of a car with a soft spring give the loss of stiffness:

    >>> import numpy as np
    >>> from sprung.likelihood import rigid_layout
    >>> from sprung.modal import Modes
    >>> from sprung.vehicles import parse_fault, read_vehicle, structure, with_faults
    >>> nominal = structure(read_vehicle("zafira"))
    >>> exact = with_faults(nominal, [parse_fault("front_left.spring=-0.3")]).modes()
    >>> poles, shapes, std = exact.poles[:3], exact.mode_shapes[:3], np.full(3, np.nan)
    >>> modes = Modes(poles, shapes, exact.channels, std, std, np.ones(3), exact.labels[:3])
    >>> springs = tuple(component for component in nominal.components() if component.kind == "spring")
    >>> ratios = corners_from_modes(modes, nominal, rigid_layout(nominal), springs)
    >>> dict(zip(map(str, springs), np.expm1(ratios).round(2).tolist()))["front_left.spring"]
    -0.3
    """
    body = [structure.coordinates.index(name) for name in layout.coordinates if name in structure.coordinates]
    if len(body) != len(layout.coordinates):
        raise ParameterError(
            "the sensors observe more than the motion of the body: corners from modes need sensors on the body only"
        )
    try:
        rows = [modes.channels.index(name) for name in layout.names]
    except ValueError:
        wanted = ", ".join(layout.names)
        raise ParameterError(f"modes lack one of the channels {wanted}: identify all of them") from None
    poles = np.asarray(modes.poles)
    shapes = np.asarray(modes.mode_shapes)[:, rows] * poles[:, None] ** (2 - layout.orders)
    motions = shapes @ layout.reduction.T
    size = np.sqrt(np.diag(structure.mass)[body])
    motions /= np.linalg.norm(motions * size, axis=1, keepdims=True)

    def errors(logarithms: Real) -> Real:
        residuals = [logarithms / prior_std]
        changed = structure.changed(dict(zip(components, np.exp(logarithms).tolist(), strict=True)))
        for pole, motion in zip(poles, motions, strict=True):
            reduced = _reduced(_dynamic_stiffness(changed, complex(pole)), body)
            force = (reduced @ motion) / size / (2 * np.abs(pole) ** 2 * pole_error)
            residuals += [force.real, force.imag]
        return np.concatenate(residuals)

    return least_squares(Differenced(errors, np.zeros(len(components))), gain=1e-9).parameters


def _dynamic_stiffness(structure: Structure, pole: complex) -> Complex:
    """D(s) = M s^2 + C(s) s + K at a pole."""
    stiffness = np.array([element.dynamic_stiffness(pole) for element in structure.elements])
    D = structure.elongations
    return structure.mass * pole**2 + (D.T * stiffness) @ D + structure.rolling_at(pole)


def _reduced(stiffness: Complex, kept: list[int]) -> Complex:
    """Dynamic stiffness of some coordinates with no force on the others, D_bb - D_bo D_oo^-1 D_ob."""
    others = [row for row in range(len(stiffness)) if row not in kept]
    coupling = stiffness[np.ix_(kept, others)]
    return stiffness[np.ix_(kept, kept)] - coupling @ np.linalg.solve(
        stiffness[np.ix_(others, others)], stiffness[np.ix_(others, kept)]
    )
