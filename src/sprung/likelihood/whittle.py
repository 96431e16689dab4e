"""Whittle likelihood of a vehicle: spectral matrix = response x inputs x response^H + sensor noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.inputs import InputModel
from sprung.likelihood.spectra import ClassSpectra, onto_grid, through_window
from sprung.vehicles import Component, Element, Structure

#: An element, its dynamic stiffness over frequency, and the derivative of that for each free parameter in it.
Arm = tuple[Element, Complex, list[tuple[int, Complex]]]


#: Value of the likelihood where a step of the search went beyond all numbers.
TOO_FAR = 1e100


@dataclass(frozen=True, eq=False, slots=True)
class MassChange:
    """A free part of the mass matrix.

    Parameters
    ----------
    name
        Of its parameter.
    matrix
        Shape (n, n): what one unit of the parameter adds to the mass matrix.
    width
        Standard deviation of the parameter about 0 before any data.
    unit
        Of the parameter in kg, kg m or kg m^2.
    """

    name: str
    matrix: Real
    width: float
    unit: float = 1.0


@dataclass(frozen=True, eq=False, slots=True)
class SensorChange:
    """A free place or time of a sensor.

    Parameters
    ----------
    name
        Of its parameter.
    motion
        Shape (channels, n): what one unit of the parameter adds to `RigidLayout.motion`; None for a lag.
    channel
        Row of the channel that one unit of the parameter delays by one second; None for a place.
    width
        Standard deviation of the parameter about 0 before any data.
    """

    name: str
    width: float
    motion: Real | None = None
    channel: int | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Model:
    """A vehicle on its road with free parameters.

    Parameters
    ----------
    structure
        With nominal components.
    layout
        Coordinates of the data.
    spectra
        The data.
    inputs
        What drives the wheels.
    components
        Free components; their parameters are ln(value / nominal value).
    masses
        Free parts of the mass matrix, such as a payload.
    sensors
        Free places and lags of sensors.
    width
        Standard deviation of these parameters before any data.

    Notes
    -----
    The parameters are those of the components, of the masses, of the sensors, of the inputs, and for each channel ln of
    its noise density over that of `sprung.likelihood.coordinates`.
    """

    structure: Structure
    layout: RigidLayout
    spectra: ClassSpectra
    inputs: InputModel
    components: tuple[Component, ...]
    masses: tuple[MassChange, ...] = ()
    sensors: tuple[SensorChange, ...] = ()
    width: float = 0.7

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        free = [str(component) for component in self.components]
        others = [*(part.name for part in self.masses), *(part.name for part in self.sensors)]
        return (*free, *others, *self.inputs.names, *(f"noise_{name}" for name in self.layout.names))

    @property
    def n_free(self) -> int:
        """Parameters of components, masses and sensors: the first ones."""
        return len(self.components) + len(self.masses) + len(self.sensors)

    @property
    def start(self) -> Real:
        """Nominal components, usual inputs and sensor noise: the centre of the prior."""
        return np.concatenate([np.zeros(self.n_free), self.inputs.start, self._noise_start()])

    def scaled_start(self, components: Real | None = None) -> Real:
        """Return `start`, or given components, with inputs and noise scaled so that the model has the data's power."""
        parameters = self.start
        if components is not None:
            parameters[: len(self.components)] = components
        inverse = np.linalg.inv(self.matrix(parameters))
        ratio = np.einsum("cfij,cfji->cf", inverse, self.spectra.matrices).real / len(self.layout.rows)
        shift = np.log(np.median(np.average(ratio, axis=0, weights=self.spectra.counts)))
        first, last = self.n_free, parameters.size - len(self.layout.noise)
        parameters[first:last] += shift * self.inputs.is_level
        parameters[last:] += shift
        return parameters

    @property
    def widths(self) -> Real:
        """Standard deviations before any data."""
        free = [self.width] * len(self.components)
        free += [*(part.width for part in self.masses), *(part.width for part in self.sensors)]
        return np.concatenate([free, self.inputs.widths, np.full(len(self.layout.noise), 5.0)])

    def _noise_start(self) -> Real:
        """Noise of a hundredth of the usual variance in one Hz."""
        return np.full(len(self.layout.noise), np.log(1e-2))

    def split(self, parameters: Real) -> tuple[Real, Real, Real]:
        """Return the parameters of components, masses and sensors, of inputs, and of noise."""
        first, last = self.n_free, parameters.size - len(self.layout.noise)
        return parameters[:first], parameters[first:last], parameters[last:]

    def arms(self, parameters: Real) -> list[Arm]:
        """Return each element's dynamic stiffness over frequency, and its derivative for each free parameter in it."""
        pulsation = np.asarray(2j * np.pi * self.spectra.grid, dtype=np.complex128)
        free = {component: number for number, component in enumerate(self.components)}
        found = []
        for element in self.structure.elements:
            numbers = [None if part is None else free.get(part) for part in element.components]
            stiffness = element.stiffness * (1.0 if numbers[0] is None else np.exp(parameters[numbers[0]]))
            damping = element.damping * (1.0 if numbers[1] is None else np.exp(parameters[numbers[1]]))
            arm = pulsation * damping
            change = arm
            if element.series_stiffness is not None and damping > 0:
                arm = 1 / (1 / arm + 1 / element.series_stiffness)
                change = arm**2 / change
            derivatives: list[tuple[int, Complex]] = []
            if numbers[0] is not None:
                derivatives.append((numbers[0], np.full_like(pulsation, stiffness)))
            if numbers[1] is not None:
                derivatives.append((numbers[1], change))
            found.append((element, np.asarray(stiffness + arm, dtype=np.complex128), derivatives))
        return found

    def response(self, arms: Sequence[Arm], free: Real) -> tuple[Complex, Complex, Complex]:
        """Return X = D^-1 B (frequencies, n, inputs), L = -w^2 R D^-1 (frequencies, coordinates, n) and H = L B."""
        frequencies = self.spectra.grid
        squared = (2 * np.pi * frequencies) ** 2
        mass = self.mass(free)
        directions = np.array([element.elongation for element, _, _ in arms])
        values = np.array([value for _, value, _ in arms])
        pulled = values.T[:, None, :] * directions.T
        dynamic = pulled @ directions - squared[:, None, None] * mass
        feet = np.array([self._foot(element) for element, _, _ in arms])
        drive = pulled @ feet + self.structure.forces
        rows = self.rows(free)
        solved = np.linalg.solve(dynamic, np.concatenate([drive, rows.swapaxes(1, 2)], axis=2))
        n_inputs = drive.shape[2]
        X = np.asarray(solved[..., :n_inputs], dtype=np.complex128)
        L = -squared[:, None, None] * solved[..., n_inputs:].swapaxes(1, 2)
        return X, np.asarray(L, dtype=np.complex128), np.asarray(-squared[:, None, None] * (rows @ X))

    def rows(self, free: Real) -> Complex:
        """Return the coordinates of the data for one unit of each of the structure's, (grid, coordinates, n)."""
        size = self.spectra.grid.size
        if not self.sensors:
            rows = self.layout.rows.astype(np.complex128)
            return np.broadcast_to(rows, (size, *rows.shape))
        motion, delay = self._sensed(free)
        return self.layout.reduction @ (delay[..., None] * motion)

    def _sensed(self, free: Real) -> tuple[Real, Complex]:
        """Return the motion of the channels where they are, (channels, n), and what lags do, (grid, channels)."""
        motion, lags = self.layout.motion.copy(), np.zeros(len(self.layout.names))
        for p, part in zip(free[self.n_free - len(self.sensors) :], self.sensors, strict=True):
            if part.motion is not None:
                motion += p * part.motion
            if part.channel is not None:
                lags[part.channel] += p
        return motion, np.exp(-2j * np.pi * self.spectra.grid[:, None] * lags)

    def rows_changes(self, free: Real) -> list[Complex]:
        """Return the derivative of `rows` for each parameter of the sensors."""
        if not self.sensors:
            return []
        motion, delay = self._sensed(free)
        reduction = self.layout.reduction
        found = []
        for part in self.sensors:
            if part.motion is not None:
                found.append(reduction @ (delay[..., None] * part.motion))
            else:
                k = part.channel
                later = -2j * np.pi * self.spectra.grid * delay[:, k]
                found.append(later[:, None, None] * np.outer(reduction[:, k], motion[k]))
        return found

    def mass(self, free: Real) -> Real:
        """Return the mass matrix."""
        added = zip(free[len(self.components) :], self.masses, strict=False)
        return self.structure.mass + sum(p * part.matrix for p, part in added)

    def _foot(self, element: Element) -> Real:
        """Return which input moves the lower end of an element, shape (inputs,)."""
        return np.array([float(element.foot == name) for name in self.structure.inputs])

    def noise(self, parameters: Real) -> Complex:
        """Return the spectral matrix of each channel's noise, shape (channels, grid, coordinates, coordinates)."""
        pulsation = 2 * np.pi * self.spectra.grid
        colours = pulsation[None, :] ** (2 * (2 - self.layout.orders[:, None]))
        return np.einsum("k,kf,kij->kfij", np.exp(np.minimum(parameters, 100.0)), colours, self.layout.noise)

    def matrix(self, parameters: Real) -> Complex:
        """Return the model's spectral matrix, shape of the data's."""
        free, road, noise = self.split(parameters)
        arms = self.arms(free)
        H = self.response(arms, free)[2]
        true = H @ self.inputs.matrix(road) @ H.conj().swapaxes(-1, -2) + self.noise(noise).sum(axis=0)
        return through_window(true)

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient.

        Notes
        -----
        sum over classes n sum over frequencies [ln det S + tr(S^-1 S^)] + sum (parameter - start)^2 / (2 width^2).
        Beyond all numbers, or with a mass matrix that no vehicle has, a value that makes any search turn back.
        """
        too_far = TOO_FAR, np.zeros_like(parameters)
        if np.linalg.eigvalsh(self.mass(parameters))[0] <= 0:
            return too_far
        try:
            with np.errstate(all="ignore"):
                value, gradient = self._objective(parameters)
        except np.linalg.LinAlgError:
            return too_far
        if np.isfinite(value) and np.all(np.isfinite(gradient)):
            return value, gradient
        return too_far

    def _objective(self, parameters: Real) -> tuple[float, Real]:
        """Return the value and its gradient, whatever numbers they are."""
        free, road, noise = self.split(parameters)
        arms = self.arms(free)
        X, L, H = self.response(arms, free)
        Hc = H.conj().swapaxes(-1, -2)
        Sr = self.inputs.matrix(road)
        N = self.noise(noise)
        SrHc = Sr @ Hc
        S = through_window(H @ SrHc + N.sum(axis=0))
        inverse, logdet = inverse_and_logdet(S)
        data = self.spectra.matrices
        weights = self.spectra.weights
        ratio = inverse @ data
        traces = np.einsum("cfii->cf", ratio).real
        if np.any(traces < 0):  # singular but for rounding: no inverse of it means anything
            raise np.linalg.LinAlgError
        value = float(np.sum(weights * (logdet + traces)))
        W = onto_grid(weights[..., None, None] * (inverse - ratio @ inverse))
        HcW = Hc @ W
        Q = (SrHc @ W).sum(axis=0)
        E = Q @ L
        G = X @ E
        gradient = np.empty_like(parameters)
        directions = np.array([element.elongation for element, _, _ in arms])
        feet = np.array([self._foot(element) for element, _, _ in arms])
        inner = np.sum((feet @ E - directions @ G) * directions, axis=-1)
        for column, (_, _, derivatives) in enumerate(arms):
            for number, derivative in derivatives:
                gradient[number] = 2 * float(np.sum((derivative * inner[:, column]).real))
        squared = (2 * np.pi * self.spectra.grid) ** 2
        for number, part in enumerate(self.masses, start=len(self.components)):
            gradient[number] = 2 * float(np.einsum("f,ij,fji->", squared, part.matrix, G).real)
        sensed = self.n_free - len(self.sensors)
        for number, change in enumerate(self.rows_changes(free), start=sensed):
            gradient[number] = -2 * float(np.einsum("f,fni,fij,fjn->", squared, X, Q, change).real)
        first, last = len(free), parameters.size - len(noise)
        gradient[first:last] = self.inputs.gradient(HcW @ H, Sr, road)
        total = W.sum(axis=0)
        gradient[last:] = np.einsum("fij,kfji->k", total, N).real
        away = (parameters - self.start) / self.widths
        return value + float(away @ away) / 2, gradient + away / self.widths

    def derivatives(self, parameters: Real) -> Complex:
        """Return the derivative of the model's spectral matrix for each parameter, (parameters, ...)."""
        free, road, noise = self.split(parameters)
        arms = self.arms(free)
        X, L, H = self.response(arms, free)
        Hc = H.conj().swapaxes(-1, -2)
        Sr = self.inputs.matrix(road)
        SrHc = Sr @ Hc
        found = np.empty((parameters.size, len(self.spectra.counts), *self.noise(noise).shape[1:]), dtype=np.complex128)
        for element, _, changes in arms:
            d, foot = element.elongation, self._foot(element)
            dH = (L @ d)[:, :, None] * (foot - d @ X)[:, None, :]
            for number, change in changes:
                half = (change[:, None, None] * dH) @ SrHc
                found[number] = half + half.conj().swapaxes(-1, -2)
        squared = (2 * np.pi * self.spectra.grid) ** 2
        for number, part in enumerate(self.masses, start=len(self.components)):
            half = (squared[:, None, None] * (L @ part.matrix @ X)) @ SrHc
            found[number] = half + half.conj().swapaxes(-1, -2)
        sensed = self.n_free - len(self.sensors)
        for number, change in enumerate(self.rows_changes(free), start=sensed):
            half = (-squared[:, None, None] * (change @ X)) @ SrHc
            found[number] = half + half.conj().swapaxes(-1, -2)
        first, last = len(free), parameters.size - len(noise)
        for number, change in enumerate(self.inputs.derivatives(Sr, road)):
            found[first + number] = H @ change @ Hc
        found[last:] = self.noise(noise)[:, None]
        return through_window(found)

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information of the data about the parameters, without the prior."""
        whitened = self.whitened_derivatives(parameters)
        flat = whitened.reshape(len(whitened), -1)
        return (flat.conj() @ flat.T).real

    def whitened_derivatives(self, parameters: Real) -> Complex:
        """Return sqrt(n) L^-1 dS L^-H for each parameter, S = L L^H."""
        factor = np.linalg.inv(np.linalg.cholesky(self.matrix(parameters)))
        scaled = np.sqrt(self.spectra.weights)[..., None, None] * factor
        return scaled @ self.derivatives(parameters) @ factor.conj().swapaxes(-1, -2)


def inverse_and_logdet(matrices: Complex) -> tuple[Complex, Real]:
    """Return the inverse and the ln of the determinant of Hermitian positive definite matrices in a stack."""
    if matrices.shape[-1] > 3:
        lower = np.linalg.cholesky(matrices)
        logdet = 2 * np.log(np.einsum("...ii->...i", lower).real).sum(axis=-1)
        return np.asarray(np.linalg.inv(matrices), dtype=np.complex128), np.asarray(logdet)
    if matrices.shape[-1] < 3:
        inverse_ = np.asarray(np.linalg.inv(matrices), dtype=np.complex128)
        return inverse_, np.asarray(np.linalg.slogdet(matrices)[1])
    a, b, c = matrices[..., 0, 0].real, matrices[..., 1, 1].real, matrices[..., 2, 2].real
    x, y, z = matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2]
    inverse = np.empty_like(matrices)
    inverse[..., 0, 0] = b * c - np.abs(z) ** 2
    inverse[..., 1, 1] = a * c - np.abs(y) ** 2
    inverse[..., 2, 2] = a * b - np.abs(x) ** 2
    inverse[..., 0, 1] = y * z.conj() - x * c
    inverse[..., 0, 2] = x * z - y * b
    inverse[..., 1, 2] = y * x.conj() - z * a
    for row, column in ((1, 0), (2, 0), (2, 1)):
        inverse[..., row, column] = inverse[..., column, row].conj()
    determinant = (a * inverse[..., 0, 0] + x * inverse[..., 1, 0] + y * inverse[..., 2, 0]).real
    return inverse / determinant[..., None, None], np.log(determinant)
