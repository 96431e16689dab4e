"""Roads and tracks under the wheels as parameters: the rear wheels repeat the input of the front ones."""

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer

#: Standard deviation of ln of the delays over those of speed and geometry.
_DELAY = 0.03
#: Standard deviation of ln of a speed class' roughness over the common one.
_CLASS = 0.5
#: Spatial frequency n0 at which the roughness of a surface is stated [1/m] (ISO 8608).
REFERENCE = 0.1


@dataclass(frozen=True, eq=False, slots=True)
class SurfaceForm:
    """Form of a surface's spectra over spatial frequency, shape (classes, grid) each.

    Parameters
    ----------
    log_density
        ln c, density of one track over its roughness.
    log_coherence
        ln g, cross spectrum of left and right over the density.
    density_derivatives, coherence_derivatives
        Derivatives of both with respect to each parameter of the form, shape (parameters, classes, grid).
    """

    log_density: Real
    log_coherence: Real
    density_derivatives: Real
    coherence_derivatives: Real


@dataclass(frozen=True, eq=False, slots=True)
class SurfaceInputs(ParameterBlock):
    """A surface under the wheels: roughness, form of its spectra, coherence of left and right, delay between the axles.

    Parameters
    ----------
    spectra
        Data whose frequencies, speeds and spreads the surface is seen at.
    positions
        Distance of each wheel ahead of the centre of gravity [m], shape (inputs,).
    sides
        1 for a wheel on the left, -1 on the right, shape (inputs,).
    contact_length
        Length over which a wheel averages the surface [m].

    Notes
    -----
    With the spatial frequency n = f / v, the one-sided spectral matrix of the displacements under the wheels is, in
    m^2/Hz,

        S_ij = G0 c(n) / v  sinc^2(n l)  g_ij(n)  e^(-i w tau_ij)  b_ij,    tau_ij = e^delay (d_i - d_j) / v,

    where G0 is the roughness at n0 = 0.1 cycles/m, l the contact length, d the distance behind the front axle, g_ij the
    coherence of the two sides and 1 on one side, and b_ij = exp(-(w tau_ij spread)^2 / 2) blurs the delay by the spread
    of the speed. Parameters: ln G0 [m^3], those of the form (c and g), and `delay`, ln of the delays over those of
    speed and geometry: a speedometer and a wheelbase are right to a few per cent.

    References
    ----------
    C. J. Dodds and J. D. Robson, The description of road surface roughness, Journal of Sound and Vibration 31 (1973),
    175-183 (coherence of two tracks of an isotropic surface).
    ISO 8608:2016, Mechanical vibration - Road surface profiles - Reporting of measured data.
    """

    spectra: ClassSpectra
    positions: Real
    sides: Real
    contact_length: float = 0.1
    _patch: Real = field(init=False, repr=False)
    _lags: Real = field(init=False, repr=False)
    _axles: Indices = field(init=False, repr=False)

    group: ClassVar[str] = "inputs"
    #: Usual value and standard deviation of ln of the roughness and of each parameter of the form, by name.
    usual: ClassVar[dict[str, tuple[float, float]]]

    def __post_init__(self) -> None:
        places, axles = np.unique(-self.positions, return_inverse=True)
        seconds = np.subtract.outer(places, places) / self.spectra.speeds[:, None, None, None]
        object.__setattr__(self, "_axles", axles)
        object.__setattr__(self, "_lags", 2 * np.pi * self.spectra.grid[:, None, None] * seconds)
        object.__setattr__(self, "_patch", np.sinc(self._spatial_frequencies() * self.contact_length) ** 2)

    @abstractmethod
    def form(self, n: Real, parameters: Real) -> SurfaceForm:
        """Return the form of the spectra at spatial frequencies n [1/m]."""

    @property
    def names(self) -> tuple[str, ...]:
        """Roughness, parameters of the form, and delay."""
        return (*self.usual, "delay")

    @property
    def start(self) -> Real:
        """A usual surface."""
        return np.array([*(value for value, _ in self.usual.values()), 0.0])

    @property
    def prior_std(self) -> Real:
        """Large, so that the data decide, except for the delay."""
        return np.array([*(std for _, std in self.usual.values()), _DELAY])

    @property
    def is_log_power(self) -> Booleans:
        """True for the roughness."""
        return np.array([name == "roughness" for name in self.names])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the spectral matrix of the surface as inputs."""
        form, lags = self.form(self._spatial_frequencies(), parameters[1:-1]), self._scaled_lags(parameters)
        density = self._patch * np.exp(parameters[0] + form.log_density) / self.spectra.speeds[:, None]
        between_axles = np.exp(-1j * lags - (lags * self.spectra.spreads[:, None, None, None]) ** 2 / 2)
        between_axles *= density[..., None, None]
        coherence = np.where(self._is_across(), np.exp(form.log_coherence)[..., None, None], 1.0)
        return replace(terms, inputs=self._at_wheels(between_axles) * coherence)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective: all parameters act on ln S_ij."""
        by_log = gradients.log_inputs
        total = by_log.real.sum(axis=(-1, -2))
        across = by_log.real[..., self._is_across()].sum(axis=-1)
        form = self.form(self._spatial_frequencies(), parameters[1:-1])
        by_form = np.einsum("pcf,cf->p", form.density_derivatives, total)
        by_form += np.einsum("pcf,cf->p", form.coherence_derivatives, across)
        delay = np.sum((by_log * self._delay_derivative(parameters)).real)
        return np.array([total.sum(), *by_form, delay])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Complex]:
        """Return the derivatives of the spectral matrix."""
        form = self.form(self._spatial_frequencies(), parameters[1:-1])
        across = self._is_across()
        changes: list[Real | Complex] = [np.ones(1)]
        for density, coherence in zip(form.density_derivatives, form.coherence_derivatives, strict=True):
            changes.append(density[..., None, None] + coherence[..., None, None] * across)
        changes.append(self._delay_derivative(parameters))
        return [response.change_by_inputs(response.terms.inputs * change) for change in changes]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return roughness [m^3], waviness, coherence or bends, and the ratio of the delays."""
        return {
            name: value if name == "waviness" else float(np.exp(value))
            for name, value in zip(self.names, parameters.tolist(), strict=True)
        }

    def _scaled_lags(self, parameters: Real) -> Real:
        """Phase lags w tau between the axles, shape (classes, grid, axles, axles)."""
        return np.asarray(self._lags * np.exp(parameters[-1]), dtype=np.float64)

    def _delay_derivative(self, parameters: Real) -> Complex:
        """Derivative of ln S_ij with respect to `delay`, shape (classes, grid, inputs, inputs)."""
        lags = self._scaled_lags(parameters)
        blur = (lags * self.spectra.spreads[:, None, None, None]) ** 2
        return self._at_wheels(np.asarray(-1j * lags - blur, dtype=np.complex128))

    def _at_wheels(self, matrices: Complex) -> Complex:
        """Matrices of the axles as matrices of the wheels."""
        return matrices[..., self._axles[:, None], self._axles]

    def _spatial_frequencies(self) -> Real:
        """Spatial frequency of each class and frequency [1/m]."""
        return self.spectra.grid / self.spectra.speeds[:, None]

    def _is_across(self) -> Booleans:
        """Whether two wheels are on different sides, shape (inputs, inputs)."""
        return np.not_equal.outer(self.sides, self.sides)


@dataclass(frozen=True, eq=False, slots=True)
class RoadInputs(SurfaceInputs):
    """A road: c = (n / n0)^-waviness, g = exp(-coherence length n).

    References
    ----------
    ISO 8608:2016: straight line of the spectrum in double logarithmic scales, waviness 2.
    """

    usual: ClassVar[dict[str, tuple[float, float]]] = {
        "roughness": (np.log(256e-6), 5.0),
        "waviness": (2.0, 0.3),
        "coherence_length": (np.log(1.5), 1.0),
    }

    def form(self, n: Real, parameters: Real) -> SurfaceForm:
        """Return the form of a road: ln c = -waviness ln(n / n0), ln g = -coherence length n."""
        waviness, log_length = parameters
        log_ratio, log_coherence, zero = np.log(n / REFERENCE), -np.exp(log_length) * n, np.zeros_like(n)
        return SurfaceForm(
            log_density=-waviness * log_ratio,
            log_coherence=log_coherence,
            density_derivatives=np.stack([-log_ratio, zero]),
            coherence_derivatives=np.stack([zero, log_coherence]),
        )


@dataclass(frozen=True, eq=False, slots=True)
class RailInputs(SurfaceInputs):
    """A track: c = (n / n0)^-waviness / (1 + (n / bend)^2), g = 1 / (1 + 2 (n / cross)^2).

    Notes
    -----
    The spectra of ERRI B176 (see `sprung.excitation.Rail`) above their lowest bend, whose wavelength is far longer than
    a vehicle; `bend` and `cross` in cycles/m.

    References
    ----------
    ERRI B176, Bogies with steered or steering wheelsets (1989).
    H. Claus and W. Schiehlen, Modeling and simulation of railway bogie structural vibrations, Vehicle System Dynamics
    29 (1998), supplement, 538-552.
    """

    usual: ClassVar[dict[str, tuple[float, float]]] = {
        "roughness": (np.log(1e-6), 10.0),
        "waviness": (2.0, 0.5),
        "bend": (np.log(0.8246 / (2 * np.pi)), 0.5),
        "cross": (np.log(0.4380 / (2 * np.pi)), 1.0),
    }

    def form(self, n: Real, parameters: Real) -> SurfaceForm:
        """Return the form of a track."""
        waviness, log_bend, log_cross = parameters
        log_ratio, zero = np.log(n / REFERENCE), np.zeros_like(n)
        bend, cross = (n / np.exp(log_bend)) ** 2, (n / np.exp(log_cross)) ** 2
        return SurfaceForm(
            log_density=-waviness * log_ratio - np.log1p(bend),
            log_coherence=-np.log1p(2 * cross),
            density_derivatives=np.stack([-log_ratio, 2 * bend / (1 + bend), zero]),
            coherence_derivatives=np.stack([zero, zero, 4 * cross / (1 + 2 * cross)]),
        )


@dataclass(frozen=True, eq=False, slots=True)
class ClassRoughness(ParameterBlock):
    """Roughness of the surface in each speed class; the parameters are ln of it over the common roughness.

    Parameters
    ----------
    n_classes
        Number of speed classes.

    Notes
    -----
    Fast segments are driven on other roads than slow ones: S_inputs of class c is multiplied by e^p_c.
    """

    n_classes: int

    group: ClassVar[str] = "class_roughness"

    @property
    def names(self) -> tuple[str, ...]:
        """Number of each class after "class_"."""
        return tuple(f"class_{number}" for number in range(self.n_classes))

    @property
    def start(self) -> Real:
        """The common roughness."""
        return np.zeros(self.n_classes)

    @property
    def prior_std(self) -> Real:
        """The same for all classes."""
        return np.full(self.n_classes, _CLASS)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the inputs of each class scaled."""
        return replace(terms, inputs=terms.inputs * np.exp(parameters)[:, None, None, None])

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        return np.asarray(gradients.log_inputs.real.sum(axis=(1, 2, 3)), dtype=np.float64)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Complex]:
        """Return the derivatives of the spectral matrix."""
        driven = response.change_by_inputs(response.terms.inputs)
        members = np.eye(self.n_classes)[:, :, None, None, None]
        return [driven * member for member in members]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the roughness of each class over the common one."""
        return dict(zip(self.names, np.exp(parameters).tolist(), strict=True))
