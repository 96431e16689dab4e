"""Swings with viscous damping and dry friction: both from one free response, and where it sticks."""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze


@dataclass(frozen=True, slots=True)
class FrictionRules:
    """How swings with friction are fitted."""

    #: Frequencies over the given one at which searches start.
    frequencies: tuple[float, ...] = (0.5, 0.7, 1.0)
    dampings: tuple[float, ...] = (0.03, 0.1, 0.25, 0.45)
    #: The same around the fit without friction: changes of ln frequency, damping ratios, friction over the amplitude.
    near: tuple[float, ...] = (-0.03, 0.0, 0.03)
    fine_dampings: tuple[float, ...] = (0.002, 0.02, 0.05, 0.08, 0.12, 0.17, 0.23, 0.32, 0.45)
    frictions: tuple[float, ...] = (0.005, 0.015, 0.03, 0.045, 0.07, 0.1, 0.14, 0.2)
    #: Times of the first turn before the first sample, in periods, at which searches start.
    turns: tuple[float, ...] = (0.0, -0.15, -0.35)
    #: Starts that are searched from: the nearest to the data.
    n_searches: int = 4
    #: RMS of what a swing without friction leaves over that of the motion, above which friction is not looked for.
    max_viscous: float = 0.4
    #: Smallest improvement of the log likelihood, and friction in standard deviations, that count as friction.
    min_gain: float = 4.0
    min_deviations: float = 2.5
    #: Most half swings that are followed.
    max_half_swings: int = 200
    #: Most samples of a fit: swings are smooth between them.
    max_samples: int = 300


RULES = FrictionRules()


@dataclass(frozen=True, eq=False, slots=True)
class FrictionFit:
    """Swing of one mode with viscous damping and dry friction.

    Parameters
    ----------
    natural_frequency, damping_ratio
        Of the motion between two turns: undamped [Hz], and viscous.
    friction
        Friction force over stiffness and over the distance of the first turn from rest: below it, the motion sticks.
    natural_frequency_std, damping_ratio_std, friction_std
        Standard deviations.
    equivalent
        Natural frequency [Hz] and damping ratio of the fit without friction, with their standard deviations, shape
        (2, 2): values in the first row.
    gain
        Improvement of the log likelihood by the friction.
    residual
        RMS of what is left, over that of the motion.
    turn
        Time of the first turn [s] after the first sample, 0 or before.
    amplitudes, offsets
        Signed distance of the first turn from rest, in the unit of each channel's displacement, and value of each
        channel without motion, shape (channels,).
    order
        Derivative of displacement that the channels measure.
    """

    natural_frequency: float
    damping_ratio: float
    friction: float
    natural_frequency_std: float
    damping_ratio_std: float
    friction_std: float
    equivalent: Real
    gain: float
    residual: float
    turn: float
    amplitudes: Real
    offsets: Real
    order: int

    def __post_init__(self) -> None:
        freeze(self, equivalent=2, amplitudes=1, offsets=1)

    @property
    def is_significant(self) -> bool:
        """Whether the record shows friction beyond chance."""
        return self.gain > RULES.min_gain and self.friction > RULES.min_deviations * self.friction_std

    @property
    def sticking(self) -> Real:
        """Displacement from rest below which each channel's motion sticks, shape (channels,)."""
        return np.asarray(self.friction * np.abs(self.amplitudes))

    def motion(self, time: Real) -> Real:
        """Return the fitted values at times [s] after the first sample, shape (channels, times)."""
        swing = swing_with_friction(
            time - self.turn,
            natural_frequency=self.natural_frequency,
            damping_ratio=self.damping_ratio,
            friction=self.friction,
            order=self.order,
        )
        return np.asarray(self.offsets[:, None] + np.outer(self.amplitudes, swing))


def swing_with_friction(
    time: Real, *, natural_frequency: float, damping_ratio: float, friction: float, order: int = 0
) -> Real:
    """Return the motion from a turn at 1 of an oscillator with viscous damping and dry friction.

    Parameters
    ----------
    time
        Times after the turn [s], rising; before it, the first half swing is continued backwards; shape (times,).
    natural_frequency
        Undamped [Hz], above 0.
    damping_ratio
        Viscous, 0 or more and below 1.
    friction
        Friction force over stiffness and over the distance of the first turn from rest, 0 or more.
    order
        Order of the derivative: 0, 1 or 2.

    Returns
    -------
    ndarray
        Displacement from rest [1], velocity [1/s] or acceleration [1/s^2], shape (times,).

    Notes
    -----
    x'' + 2 xi w x' + w^2 (x + d sign x') = 0. Between two turns the motion is linear around -d sign x', so that each
    turn is exact: e - c = -(e_before - c) exp(-xi pi / sqrt(1 - xi^2)) with c = d sign e_before. It sticks at the first
    turn within d of rest.

    References
    ----------
    J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Transactions of the ASME 53 (1931),
    107-115.

    Examples
    --------
    Without viscous damping, each half swing loses twice the friction; it sticks at 0.2, below 0.3:

    >>> import numpy as np
    >>> swing_with_friction(np.arange(4) / 2, natural_frequency=1.0, damping_ratio=0.0, friction=0.3).round(6).tolist()
    [1.0, -0.4, -0.2, -0.2]
    """
    omega = 2 * np.pi * natural_frequency
    turning = omega * np.sqrt(1 - damping_ratio**2)
    half, decay = np.pi / turning, damping_ratio * omega
    turns = [1.0]
    centres: list[float] = []
    while abs(turns[-1]) > friction and len(centres) < RULES.max_half_swings and len(centres) * half <= time[-1]:
        centres.append(friction * np.sign(turns[-1]))
        turns.append(centres[-1] - (turns[-1] - centres[-1]) * np.exp(-decay * half))
    if not centres:
        return np.full(time.shape, 1.0 if order == 0 else 0.0)
    number = np.clip(np.floor(time / half).astype(int), 0, len(centres) - 1)
    after = time - number * half
    distance = np.array(turns)[number] - np.array(centres)[number]
    fall = distance * np.exp(-decay * after)
    cosine, sine = np.cos(turning * after), np.sin(turning * after)
    if order == 0:
        moving = np.array(centres)[number] + fall * (cosine + decay / turning * sine)
    elif order == 1:
        moving = -fall * omega**2 / turning * sine
    else:
        moving = -fall * omega**2 * (cosine - decay / turning * sine)
    is_stuck = time >= len(centres) * half
    at_rest = turns[-1] if order == 0 else 0.0
    return np.asarray(np.where(is_stuck, at_rest, moving), dtype=np.float64)


def fit_friction(samples: Real, sampling_rate: float, *, frequency: float, order: int = 0) -> FrictionFit:
    """Fit a swing with viscous damping and dry friction to channels that move together.

    Parameters
    ----------
    samples
        Free motion of one mode, which begins near a turn, shape (channels, samples).
    sampling_rate
        Sampling rate [Hz].
    frequency
        Frequency near which the search starts [Hz]: it ends between a third and twice of it.
    order
        Derivative of displacement that the channels measure: 0, 1 or 2.

    Returns
    -------
    FrictionFit

    Notes
    -----
    Least squares over frequency, damping ratio, friction and time of the first turn; amplitudes and offsets are linear
    and follow from them. Variances hold the correlation of the residuals over time.

    Examples
    --------
    >>> time = np.arange(400) / 100
    >>> swing = swing_with_friction(time, natural_frequency=1.5, damping_ratio=0.1, friction=0.05)
    >>> fit = fit_friction(0.02 * swing[None], 100.0, frequency=1.4)
    >>> round(fit.damping_ratio, 6), fit.sticking.round(6)
    (0.1, array([0.001]))
    """
    from scipy.optimize import OptimizeResult, least_squares

    values, step = _scaled(samples)
    time = np.arange(len(values)) * step / sampling_rate

    def linear(parameters: Real) -> tuple[Real, Real]:
        f = float(np.exp(parameters[0]))
        swing = swing_with_friction(
            time - parameters[3] / f,
            natural_frequency=f,
            damping_ratio=float(np.exp(parameters[1])),
            friction=float(parameters[2]),
            order=order,
        )
        columns = np.stack([swing, np.ones_like(swing)], axis=1)
        return columns, np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0], dtype=np.float64)

    def errors(parameters: Real) -> Real:
        columns, factors = linear(parameters)
        return np.asarray((values - columns @ factors).T.ravel())

    def searched(starts: list[Real], most_friction: float) -> OptimizeResult:
        bounds = np.array([np.log(frequency / 3), np.log(1e-5), 0.0, -0.5])
        upper = np.array([np.log(2 * frequency), np.log(0.95), most_friction, 0.1])
        nearest = sorted(starts, key=lambda start: float(np.sum(errors(start) ** 2)))[: RULES.n_searches]
        inside = [np.clip(start, bounds + 1e-12, upper - 1e-12) for start in nearest]
        scale = [0.1, 0.3, 0.1, 0.1]
        fits = [
            least_squares(errors, start, bounds=(bounds, upper), x_scale=scale, xtol=1e-10, ftol=1e-10, gtol=1e-10)
            for start in inside
        ]
        return min(fits, key=lambda fit: float(fit.cost))

    coarse = product(np.log(frequency * np.array(RULES.frequencies)), RULES.dampings, RULES.turns)
    viscous = searched([np.array([f, np.log(xi), 0.0, turn]) for f, xi, turn in coarse], 1e-9)
    near, turn = viscous.x[0] + np.array(RULES.near), viscous.x[3]
    fine = product(near, np.log(RULES.fine_dampings), RULES.frictions)
    if np.sqrt(2 * viscous.cost / values.size) > RULES.max_viscous:
        fine = product(near[:0], [], [])
    best = searched([*(np.array([f, xi, part, turn]) for f, xi, part in fine), viscous.x], 0.95)
    factors = linear(best.x)[1]
    of_best, of_viscous = _deviations(best), _deviations(viscous)
    n_free = values.size / correlated_samples(best.fun.reshape(values.shape[::-1]))
    scales = np.maximum(np.std(samples, axis=1), 1e-300)
    f, xi = np.exp(best.x[:2])
    equivalent = np.exp(viscous.x[:2])
    return FrictionFit(
        natural_frequency=float(f),
        damping_ratio=float(xi),
        friction=float(best.x[2]),
        natural_frequency_std=float(f * of_best[0]),
        damping_ratio_std=float(xi * of_best[1]),
        friction_std=float(of_best[2]),
        equivalent=np.stack([equivalent, equivalent * of_viscous[:2]]),
        gain=float(max(n_free - 6, 1) / 2 * np.log(max(viscous.cost, 1e-30) / max(best.cost, 1e-30))),
        residual=float(np.sqrt(2 * best.cost / values.size)),
        turn=float(best.x[3] / f),
        amplitudes=factors[0] * scales,
        offsets=factors[1] * scales,
        order=order,
    )


def _scaled(samples: Real) -> tuple[Real, int]:
    """Return the samples that are fitted, over the RMS of their channel, shape (samples, channels), and their step."""
    step = max(1, samples.shape[1] // RULES.max_samples)
    return np.asarray(samples[:, ::step].T / np.maximum(np.std(samples, axis=1), 1e-300)), step


def beyond_one_swing(samples: Real) -> float:
    """Return the least RMS that any one motion of all channels can leave of samples, over that of the motion."""
    values = _scaled(samples)[0]
    own = np.linalg.svd(values - values.mean(axis=0), compute_uv=False)
    return float(np.sqrt(np.sum(own[1:] ** 2) / values.size))


def _deviations(fit: Any) -> Real:
    """Return the standard deviations of the parameters of a least-squares fit, from its residuals."""
    n_free = max(fit.fun.size / correlated_samples(fit.fun[None]) - 6, 1.0)
    return np.asarray(np.sqrt(np.diag(2 * fit.cost / n_free * np.linalg.pinv(fit.jac.T @ fit.jac))))


def correlated_samples(residuals: Real) -> float:
    """Return the number of samples that count as one, by the correlation of residuals up to its first zero."""
    n = residuals.shape[1]
    lines = np.sum(np.abs(np.fft.rfft(residuals - residuals.mean(axis=1, keepdims=True), 2 * n)) ** 2, axis=0)
    correlations = np.fft.irfft(lines)[:n]
    ratios = correlations / max(correlations[0], 1e-300)
    last = int(np.argmax(ratios <= 0)) or n
    return float(max(1.0, 1 + 2 * np.sum(ratios[1:last])))
