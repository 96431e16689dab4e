"""Springs and dampers of every corner from the free modes of the body."""

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung.bounce_tests.results import RULES, CornerValue
from sprung.errors import ParameterError
from sprung.identification.free_response import FreeFit
from sprung.likelihood import corners_from_modes, rigid_layout
from sprung.modal import mac
from sprung.vehicles import Vehicle, structure


def corners_of(fit: FreeFit, vehicle: Vehicle) -> tuple[tuple[CornerValue, ...], list[str]]:
    """Return springs and dampers by generalised least squares to the modes of the body, and notes.

    Notes
    -----
    ln frequencies, ln damping ratios and shapes of the modes with their covariance, against those of the vehicle;
    Gauss-Newton from `corners_from_modes`, with the prior. Masses are those of the file: an error of the mass is one of
    all springs and dampers.
    """
    from scipy.optimize import least_squares

    nominal = structure(vehicle)
    known = nominal.components()
    names = tuple(component for component in known if component.kind in ("spring", "damper", "tyre"))
    hops = nominal.modes()
    fastest = max(
        (f for f, label in zip(hops.natural_frequency, hops.labels, strict=True) if label != "wheel_hop"), default=0
    )
    body = np.flatnonzero(fit.modes.natural_frequency < RULES.body_reach * fastest)
    try:
        layout = rigid_layout(nominal)
        start = corners_from_modes(fit.modes.take(body), nominal, layout, names) if body.size else None
    except ParameterError as error:
        return (), [f"springs and dampers are not estimated: {error}"]
    if start is None:
        return (), ["springs and dampers are not estimated: no mode of the body was found"]
    priors = np.array([RULES.prior_std[component.kind == "tyre"] for component in names])
    measured, covariance, free = _modal_vector(fit, body)
    whitening = np.linalg.inv(np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance))))
    columns = [nominal.outputs.names.index(name) for name in fit.modes.channels]

    def errors(logarithms: Real) -> Real:
        changed = nominal.changed(dict(zip(names, np.exp(logarithms).tolist(), strict=True))).modes()
        shapes = changed.mode_shapes[:, columns]
        near = [
            int(np.argmin(np.abs(np.log(changed.poles / pole)) + 1 - row)) for pole, row in _matches(fit, body, shapes)
        ]
        vector = _vector(changed.poles[near], shapes[near], fit.modes.mode_shapes[body], free)
        return np.concatenate([whitening @ (vector - measured), logarithms / priors])

    found = least_squares(errors, np.clip(start, -2, 2), x_scale=0.1)
    dispersion = max(1.0, 2 * found.cost / max(measured.size, 1))
    slopes = np.asarray(found.jac)
    stds = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)) * dispersion)
    values = zip(names, found.x, np.minimum(stds, priors), strict=True)
    notes = (
        []
        if dispersion < RULES.poor_fit
        else ["the modes do not fit the vehicle file well: springs and dampers are rough"]
    )
    return tuple(CornerValue(name, known[name], float(x), float(std)) for name, x, std in values), notes


def _matches(fit: FreeFit, body: Indices, shapes: Complex) -> list[tuple[complex, Real]]:
    """Return the poles of measured modes, and the MAC of each with those of the vehicle."""
    modes = fit.modes
    return [(complex(modes.poles[k]), mac(modes.mode_shapes[k : k + 1], shapes)[0]) for k in body]


def _modal_vector(fit: FreeFit, body: Indices) -> tuple[Real, Real, Booleans]:
    """Return ln frequencies, ln damping ratios and free parts of the shapes of some modes, and their covariance."""
    n, shapes = len(fit.modes), fit.modes.mode_shapes
    free = np.arange(shapes.shape[1]) != np.argmax(np.abs(shapes), axis=1)[:, None]
    of_mode = np.repeat(np.nonzero(free)[0], 2)
    rows = np.concatenate([body, n + body, *(2 * n + np.flatnonzero(of_mode == k) for k in body)])
    measured = _vector(fit.modes.poles[body], shapes[body], shapes[body], free[body])
    return measured, fit.covariance[np.ix_(rows, rows)], free[body]


def _vector(poles: Complex, shapes: Complex, references: Complex, free: Booleans) -> Real:
    """Return ln frequencies, ln damping ratios, and shapes scaled to 1 where the references are 1."""
    largest = np.argmax(np.abs(references), axis=1)
    scaled = shapes / shapes[np.arange(len(shapes)), largest][:, None]
    logarithms = [np.log(np.abs(poles)), np.log(-poles.real / np.abs(poles))]
    return np.concatenate([*logarithms, np.ascontiguousarray(scaled[free]).view(np.float64)])
