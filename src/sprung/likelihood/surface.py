"""Roads and tracks under the wheels as parameters: the rear wheels repeat the input of the front ones."""

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.joints import comb
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer

#: Spatial frequency n0 at which the roughness of a surface is stated [1/m] (ISO 8608).
REFERENCE = 0.1
#: Density of joints over the roughness for a level of 1.
JOINT_DENSITY = 1e-4
#: Least density of joints between their lines over that of joints at random places.
LEAST = 1e-3


@dataclass(frozen=True, slots=True)
class DeviationPrior:
    """Deviation of a road's spectrum from the straight line before any data."""

    #: Lowest and highest knot [1/m].
    knots: tuple[float, float] = (0.02, 8.0)
    #: Number of knots.
    n_knots: int = 8
    #: Standard deviation of ln of the density.
    size: float = 0.7
    #: Length over ln n at which it is correlated by e^(-1/2).
    reach: float = 1.2


DEVIATIONS = DeviationPrior()


@dataclass(frozen=True, eq=False, slots=True)
class SurfaceForm:
    """Form of a surface's spectra over spatial frequency.

    Parameters
    ----------
    logs
        ln of the spectra over the roughness, shape (parts, classes, grid): that of one track and the cross spectrum of
        left and right; or those of the left track, of the right one, and of left and right, real and imaginary part.
    derivatives
        Derivatives with respect to each parameter of the form, shape (parameters, parts, classes, grid).
    """

    logs: Real
    derivatives: Real


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
    speed and geometry: a speedometer and a wheelbase are accurate to a few per cent.

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
    _n: Real = field(init=False, repr=False)
    _axles: Indices = field(init=False, repr=False)
    _pairs: tuple[Indices, Indices] = field(init=False, repr=False)
    _lags: Real = field(init=False, repr=False)

    group: ClassVar[str] = "inputs"
    #: Usual value and standard deviation of ln of the roughness and of each parameter of the form, by name.
    usual: ClassVar[dict[str, tuple[float, float]]]
    #: Standard deviation of ln of the delays over those of speed and geometry.
    delay_std: ClassVar[float] = 0.03
    #: Names of the parameters that are logarithms of their values.
    logarithms: ClassVar[frozenset[str]]

    def __post_init__(self) -> None:
        places, axles = np.unique(-self.positions, return_inverse=True)
        first, second = np.triu_indices(places.size, 1)
        seconds = (places[first] - places[second]) / self.spectra.speeds[:, None, None]
        object.__setattr__(self, "_axles", axles)
        object.__setattr__(self, "_pairs", (first, second))
        object.__setattr__(self, "_lags", np.asfortranarray(2 * np.pi * self.spectra.grid[:, None] * seconds))
        object.__setattr__(self, "_n", np.asfortranarray(self.spectra.grid / self.spectra.speeds[:, None]))
        object.__setattr__(self, "_patch", np.sinc(self._n * self.contact_length) ** 2)

    @abstractmethod
    def form(self, parameters: Real) -> SurfaceForm:
        """Return the form of the spectra at the spatial frequencies of the data."""

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
        return np.array([*(std for _, std in self.usual.values()), self.delay_std])

    @property
    def is_log_power(self) -> Booleans:
        """True for the roughness."""
        return np.array([name == "roughness" for name in self.names])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the spectral matrix of the surface as inputs."""
        form, lags = self.form(parameters[1:-1]), self._scaled_lags(parameters)
        delayed = self._between_axles(np.exp(-1j * lags - self._blur(lags) / 2), itself=1.0)
        scale = self._patch * np.exp(parameters[0]) / self.spectra.speeds[:, None]
        kinds, logs = self._pairs_of_sides()
        levels = scale.T * np.exp(np.tensordot(logs, form.logs.swapaxes(1, 2), axes=(0, 0)))
        by_side = levels[:, None, None] * delayed.T
        inputs = by_side[kinds.T, self._axles[:, None], self._axles]
        return replace(terms, inputs=inputs.T)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective: all parameters act on ln S_ij."""
        by_log, form = gradients.log_inputs, self.form(parameters[1:-1])
        masks = self._masks().swapaxes(1, 2)
        at_wheels = (by_log if np.iscomplexobj(masks) else by_log.real).T
        by_part = np.tensordot(masks, at_wheels, axes=2).real
        by_form = np.einsum("pkcf,kfc->p", form.derivatives, by_part)
        delay = 2 * np.sum((self._by_pair(by_log) * self._delay_derivative(parameters)).real)
        return np.array([by_log.real.sum(), *by_form, delay])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        form, inputs = self.form(parameters[1:-1]), response.terms.inputs
        by_part = [response.change_by_inputs(inputs * mask) for mask in self._masks()]
        delay = self._at_wheels(self._between_axles(self._delay_derivative(parameters), itself=0.0))
        by_form = [
            sum(derivative[..., None] * part for derivative, part in zip(each, by_part, strict=True))
            for each in form.derivatives
        ]
        return [response.change_by_inputs(inputs), *by_form, response.change_by_inputs(inputs * delay)]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return roughness [m^3], waviness, coherence or bends, and the ratio of the delays."""
        return {
            name: float(np.exp(value)) if name in self.logarithms else value
            for name, value in zip(self.names, parameters.tolist(), strict=True)
        }

    def _scaled_lags(self, parameters: Real) -> Real:
        """Phase lags w tau between the axles of each pair, shape (classes, grid, pairs)."""
        return np.asarray(self._lags * np.exp(parameters[-1]), dtype=np.float64)

    def _blur(self, lags: Real) -> Real:
        """Variance of the phase lags by the spread of the speed, shape (classes, grid, pairs)."""
        return np.asarray((lags * self.spectra.spreads[:, None, None]) ** 2, dtype=np.float64)

    def _delay_derivative(self, parameters: Real) -> Complex:
        """Derivative of ln S_ij with respect to `delay` for each pair of axles, shape (classes, grid, pairs)."""
        lags = self._scaled_lags(parameters)
        return np.asarray(-1j * lags - self._blur(lags), dtype=np.complex128)

    def _between_axles(self, by_pair: Complex, *, itself: float) -> Complex:
        """Hermitian matrices of the axles for a value of each pair, shape (classes, grid, axles, axles)."""
        first, second = self._pairs
        n_axles = int(self._axles.max()) + 1
        matrices = np.full((*by_pair.shape[:2], n_axles, n_axles), itself, dtype=np.complex128, order="F")
        matrices[..., first, second], matrices[..., second, first] = by_pair, by_pair.conj()
        return matrices

    def _by_pair(self, at_wheels: Complex) -> Complex:
        """Sums over the wheels of the first and the second axle of each pair, shape (classes, grid, pairs)."""
        blocks = [
            np.ix_(self._axles == second, self._axles == first) for first, second in zip(*self._pairs, strict=True)
        ]
        return np.asarray([at_wheels.T[block].sum(axis=(0, 1)) for block in blocks], dtype=np.complex128).T

    def _at_wheels(self, matrices: Complex) -> Complex:
        """Matrices of the axles as matrices of the wheels, in Fortran order."""
        return matrices.T[self._axles[:, None], self._axles].T

    def _pairs_of_sides(self) -> tuple[Indices, Real | Complex]:
        """Kind of each pair of wheels, shape (inputs, inputs), and factors of the logs in ln S, (parts, kinds)."""
        return np.not_equal.outer(self.sides, self.sides).astype(np.intp), np.eye(2)

    def _masks(self) -> Real | Complex:
        """Factors of the logs in ln S_ij, Hermitian, shape (parts, inputs, inputs)."""
        kinds, logs = self._pairs_of_sides()
        return logs[:, kinds]


@dataclass(frozen=True, eq=False, slots=True)
class RoadInputs(SurfaceInputs):
    """A road: c = (n / n0)^-waviness e^d(n) with a smooth deviation d from the straight line, g = exp(-(l n)^k).

    Notes
    -----
    The deviation d is a Gaussian process over ln n between 0.02 and 8 cycles/m, constant beyond, with the covariance
    s^2 exp(-(ln n - ln n')^2 / (2 r^2)) at eight knots, s = 0.7 and r = 1.2, without its constant and its linear part,
    which roughness and waviness are. Between the knots it is a cubic spline. Its parameters belong to the principal
    components of this covariance and have a prior of 1. As r is longer than the resonances of body and wheels are wide
    (about 0.6 and 0.4 in ln f), the road cannot take their place even at a single speed; with several speeds the road
    moves along the axis of frequency and the vehicle does not.

    Potholes make the road rougher at waves of about their length, and less coherent where they are on one side: the
    power k of the coherence's exponent is free, 1 for the usual exponential.

    References
    ----------
    ISO 8608:2016: straight line of the spectrum in double logarithmic scales, waviness 2.
    C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006, sections 2.7 and
    4.2.1 (explicit basis functions, squared exponential covariance).
    """

    _basis: Real = field(init=False, repr=False)

    usual: ClassVar[dict[str, tuple[float, float]]] = {
        "roughness": (np.log(256e-6), 5.0),
        "waviness": (2.0, 0.3),
        **{f"deviation_{number}": (0.0, 1.0) for number in range(1, DEVIATIONS.n_knots - 1)},
        "coherence_length": (np.log(1.5), 1.0),
        "coherence_power": (0.0, 0.3),
    }
    logarithms: ClassVar[frozenset[str]] = frozenset({"roughness", "coherence_length", "coherence_power", "delay"})

    def __post_init__(self) -> None:
        SurfaceInputs.__post_init__(self)
        object.__setattr__(self, "_basis", np.ascontiguousarray(np.swapaxes(road_deviations(self._n), 1, 2)))

    def form(self, parameters: Real) -> SurfaceForm:
        """Return the form of a road: ln c = -waviness ln(n / n0) + d, ln g = -(coherence length n)^power."""
        waviness, deviations, (log_length, log_power) = parameters[0], parameters[1:-2], parameters[-2:]
        log_ratio, power = np.log(self._n / REFERENCE), np.exp(log_power)
        log_waves = log_length + np.log(self._n)
        log_coherence, zero = -np.exp(power * log_waves), np.zeros_like(self._n)
        log_density = np.tensordot(deviations, self._basis, axes=1).T - waviness * log_ratio
        of_both = np.concatenate([-log_ratio[None], self._basis.swapaxes(1, 2)])
        of_cross = np.stack([power * log_coherence, power * log_waves * log_coherence])
        return SurfaceForm(
            logs=np.stack([log_density, log_density + log_coherence]),
            derivatives=np.concatenate(
                [np.stack([of_both, of_both], axis=1), np.stack([np.stack([zero, zero]), of_cross], axis=1)]
            ),
        )


@dataclass(frozen=True, eq=False, slots=True)
class RailInputs(SurfaceInputs):
    """A track: c (1 + g) / 2 = (n / n0)^-waviness / (1 + (n / bend)^2), g = 1 / (1 + 2 (n / cross)^2), and rail joints.

    Parameters
    ----------
    spectra, positions, sides, contact_length
        As for `SurfaceInputs`.
    pitch
        Distance between rail joints [m]; infinite: impacts are at random places, as of crossings; None: there are none.
    offset
        Distance over the pitch by which the joints of the right rail are ahead of those of the left one.

    Notes
    -----
    The spectra of ERRI B176 (see `sprung.excitation.Rail`) above their lowest bend, whose wavelength is far longer than
    a vehicle; `bend` and `cross` in cycles/m. Joints add j_i = joint_i c_1 K(n) / (1 + (n / joint_bend)^2)^joint_power
    to c of each rail i, left and right, with the lines K of the pitch and c_1 = 1e-4: a short dip of unknown depth and
    shape, whose spectrum falls off beyond the inverse of its length. They add sqrt(j_left j_right) / K C e^-joint_loss
    to c g, with the lines C of the offset (`comb`): joints at varying distances, or impacts of one rail alone, lose
    coherence.

    References
    ----------
    ERRI B176, Bogies with steered or steering wheelsets (1989).
    H. Claus and W. Schiehlen, Modeling and simulation of railway bogie structural vibrations, Vehicle System Dynamics
    29 (1998), supplement, 538-552.
    """

    pitch: float | None = None
    offset: float = 0.0
    _combs: Complex = field(init=False, repr=False)

    logarithms: ClassVar[frozenset[str]] = frozenset(
        {"roughness", "bend", "cross", "joint_bend", "joint_power", "joint_loss", "joint_left", "joint_right", "delay"}
    )
    _track: ClassVar[dict[str, tuple[float, float]]] = {
        "roughness": (np.log(1e-6), 10.0),
        "waviness": (2.0, 0.5),
        "bend": (np.log(0.8246 / (2 * np.pi)), 0.5),
        "cross": (np.log(0.4380 / (2 * np.pi)), 1.0),
    }
    _joints: ClassVar[dict[str, tuple[float, float]]] = {
        "joint_bend": (0.0, 1.0),
        "joint_power": (np.log(2.0), 0.5),
        "joint_loss": (np.log(0.05), 2.0),
        "joint_left": (2.0, 5.0),
        "joint_right": (2.0, 5.0),
    }

    def __post_init__(self) -> None:
        SurfaceInputs.__post_init__(self)
        if self.pitch is None:
            return
        # Lines sharper than a bin of a segment would make the density between them negative on its grid.
        lines = np.maximum(comb(self.spectra, self.pitch).real, LEAST)
        across = comb(self.spectra, self.pitch, self.offset) if self.offset else lines
        across = across * np.minimum(1, lines / np.maximum(np.abs(across), LEAST))
        object.__setattr__(self, "_combs", np.stack([lines, lines, across]))

    @property
    def usual(self) -> dict[str, tuple[float, float]]:  # type: ignore[override]
        """Usual value and standard deviation of each parameter; those of joints where there are some."""
        return self._track if self.pitch is None else {**self._track, **self._joints}

    def form(self, parameters: Real) -> SurfaceForm:
        """Return the form of a track."""
        n, (waviness, log_bend, log_cross) = self._n, parameters[:3]
        log_ratio = np.log(n / REFERENCE)
        bend, cross = (n / np.exp(log_bend)) ** 2, (n / np.exp(log_cross)) ** 2
        log_cross = -waviness * log_ratio - np.log1p(bend) - np.log1p(cross)
        common, loss = [-log_ratio, 2 * bend / (1 + bend)], 2 * cross / (1 + cross)
        smooth = SurfaceForm(
            logs=np.stack([log_cross + np.log1p(2 * cross), log_cross]),
            derivatives=np.stack(
                [np.stack([*common, loss - 4 * cross / (1 + 2 * cross)]), np.stack([*common, loss])], axis=1
            ),
        )
        return smooth if self.pitch is None else self._with_joints(smooth, parameters[3:])

    def _with_joints(self, smooth: SurfaceForm, parameters: Real) -> SurfaceForm:
        """Add joints to the spectrum of each rail and to the cross spectrum: ln (s + j), with all derivatives."""
        log_bend, log_power, log_loss, left, right = parameters
        waves, power, loss = (self._n / np.exp(log_bend)) ** 2, np.exp(log_power), np.exp(log_loss)
        levels = np.array([left, right, (left + right) / 2 - loss])
        by_level = np.array([[0, 0, -loss], [1, 0, 0.5], [0, 1, 0.5]])  # by loss, left and right
        falls = -power * np.log1p(waves)
        joints = JOINT_DENSITY * self._combs * np.exp(levels[:, None, None] + falls)
        track = np.exp(smooth.logs)[[0, 0, 1]]
        by_shape = np.stack([2 * power * waves / (1 + waves), falls])
        by_joints = np.concatenate(
            [
                np.broadcast_to(by_shape[:, None], (2, *joints.shape)),
                np.broadcast_to(by_level[..., None, None], (3, *joints.shape)),
            ]
        )
        share = joints / (track + joints)
        derivatives = np.concatenate([(1 - share) * smooth.derivatives[:, [0, 0, 1]], share * by_joints])
        logs = np.log(track + joints)
        return SurfaceForm(
            logs=np.concatenate([logs.real, logs.imag[2:]]),
            derivatives=np.concatenate([derivatives.real, derivatives.imag[:, 2:]], axis=1),
        )

    def _pairs_of_sides(self) -> tuple[Indices, Real | Complex]:
        """Kind of each pair of wheels and factors of the logs; beside joints, of each rail, and of left and right."""
        if self.pitch is None:
            return SurfaceInputs._pairs_of_sides(self)
        is_right = (self.sides < 0).astype(np.intp)
        factors = np.array([[1, 0, 0, 0], [0, 0, 0, 1], [0, 1, 1, 0], [0, 1j, -1j, 0]])
        return np.add.outer(2 * is_right, is_right), factors


def road_deviations(n: Real) -> Real:
    """Return the smooth deviations of ln of a road's density from a straight line over ln n, one for each parameter.

    Parameters
    ----------
    n
        Spatial frequencies [1/m], above 0, any shape.

    Returns
    -------
    ndarray
        Deviations for a parameter of 1, shape (parameters, *n.shape): principal components of the prior, the largest
        first.

    References
    ----------
    C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006, section 4.3
    (eigenfunctions of kernels).
    """
    lowest, highest = np.log(DEVIATIONS.knots)
    knots = np.linspace(lowest, highest, DEVIATIONS.n_knots)
    covariance = DEVIATIONS.size**2 * np.exp(-(np.subtract.outer(knots, knots) ** 2) / (2 * DEVIATIONS.reach**2))
    line = np.stack([np.ones_like(knots), knots], axis=1)
    curved = np.eye(len(knots)) - line @ np.linalg.pinv(line)
    variances, components = np.linalg.eigh(curved @ covariance @ curved)
    at_knots = (components * np.sqrt(np.maximum(variances, 0.0)) * np.sign(components[-1]))[:, :1:-1]
    # A natural cubic spline; that of scipy.interpolate costs a fifth of a second to import.
    places = (np.clip(np.log(n), knots[0], knots[-1]) - knots[0]) / (knots[1] - knots[0])
    curvature, size = np.zeros_like(at_knots), len(knots) - 2
    tridiagonal = 4 * np.eye(size) + np.eye(size, k=1) + np.eye(size, k=-1)
    curvature[1:-1] = np.linalg.solve(tridiagonal, np.diff(at_knots, 2, axis=0))
    before = np.minimum(places.astype(np.intp), size)
    after = (places - before)[..., None]
    ends = ((1 - after, before), (after, before + 1))
    return np.moveaxis(sum(x * at_knots[k] + (x**3 - x) * curvature[k] for x, k in ends), -1, 0)


@dataclass(frozen=True, eq=False, slots=True)
class ClassRoughness(ParameterBlock):
    """Roughness of the surface in each speed class; the parameters are ln of it over the common roughness.

    Parameters
    ----------
    n_classes
        Number of speed classes.
    std
        Standard deviation of ln of the roughness of each over the common one before any data.

    Notes
    -----
    Fast segments are driven on other roads than slow ones: S_inputs of class c is multiplied by e^p_c.
    """

    n_classes: int
    std: float = 0.5

    group: ClassVar[str] = "class_roughness"

    @property
    def names(self) -> tuple[str, ...]:
        """Names: `class_` and the number of each class."""
        return tuple(f"class_{number}" for number in range(self.n_classes))

    @property
    def prior_std(self) -> Real:
        """The same for all classes."""
        return np.full(self.n_classes, self.std)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the inputs of each class scaled."""
        return replace(terms, inputs=terms.inputs * np.exp(parameters)[:, None, None, None])

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        return np.asarray(gradients.log_inputs.real.sum(axis=(1, 2, 3)), dtype=np.float64)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        driven = response.change_by_inputs(response.terms.inputs)
        members = np.eye(self.n_classes)[:, :, None, None]
        return [driven * member for member in members]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the roughness of each class over the common one."""
        return dict(zip(self.names, np.exp(parameters).tolist(), strict=True))


@dataclass(frozen=True, eq=False, slots=True)
class TrackLevels(ParameterBlock):
    """Level of the right track over the left one: ln of the ratio of their amplitudes.

    Parameters
    ----------
    sides
        1 for a wheel on the left, -1 on the right, shape (inputs,).
    std
        Standard deviation of the level about 0 before any data: 2.6 dB.

    Notes
    -----
    The edge of a road is rougher than its middle, and potholes are on one side. With the level p the spectral matrix of
    the inputs is S_ij exp(-p (side_i + side_j) / 2): the roughness stays the geometric mean of both tracks. Without
    it, the rougher side appears as softer tyres and stronger dampers on that side.
    """

    sides: Real
    std: float = 0.3

    group: ClassVar[str] = "tracks"

    def __post_init__(self) -> None:
        freeze(self, sides=1)

    @property
    def names(self) -> tuple[str, ...]:
        """Right over left."""
        return ("right_over_left",)

    @property
    def prior_std(self) -> Real:
        """Standard deviation of the level."""
        return np.array([self.std])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the inputs of the tracks scaled."""
        return replace(terms, inputs=terms.inputs * np.exp(parameters[0] * self._log_derivative()))

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_wheels = gradients.log_inputs.real.sum(axis=(0, 1))
        return np.array([np.sum(by_wheels * self._log_derivative())])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        return [response.change_by_inputs(response.terms.inputs * self._log_derivative())]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the amplitude of the right track over that of the left one."""
        return {"right_over_left": float(np.exp(parameters[0]))}

    def _log_derivative(self) -> Real:
        """Derivative of ln S_ij with respect to the level, shape (inputs, inputs)."""
        return -np.add.outer(self.sides, self.sides) / 2
