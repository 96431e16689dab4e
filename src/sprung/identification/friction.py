"""Swings with viscous damping and dry friction: both from one free response, and where it sticks."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze
from sprung.likelihood.search import least_squares


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
    values, step = _scaled(samples)
    offsets = values.mean(axis=0)
    start = _Swing(values - offsets, np.arange(len(values)) * step / sampling_rate, frequency, order)

    def searched(starts: list[Real], most_friction: float) -> _Swing:
        tried = [replace(start, parameters=each, most_friction=most_friction) for each in starts]
        return min(map(least_squares, sorted(tried, key=_cost)[: RULES.n_searches]), key=_cost)

    coarse = product(np.log(frequency * np.array(RULES.frequencies)), RULES.dampings, RULES.turns)
    viscous = searched([np.array([f, np.log(xi), 0.0, turn]) for f, xi, turn in coarse], 0.0)
    near, turn = viscous.parameters[0] + np.array(RULES.near), viscous.parameters[3]
    fine = product(near, np.log(RULES.fine_dampings), RULES.frictions)
    if np.sqrt(viscous.cost / values.size) > RULES.max_viscous:
        fine = product(near[:0], [], [])
    starts = [np.array([f, xi, part, turn]) for f, xi, part in fine]
    best = searched([*starts, viscous.parameters], start.most_friction)
    of_best, of_viscous = best.deviations(), viscous.deviations()
    n_free = values.size / correlated_samples(best.left.T)
    scales = np.maximum(np.std(samples, axis=1), 1e-300)
    f, xi, friction, turn = best.parameters
    f, xi = np.exp(f), np.exp(xi)
    equivalent = np.exp(viscous.parameters[:2])
    return FrictionFit(
        natural_frequency=float(f),
        damping_ratio=float(xi),
        friction=float(friction),
        natural_frequency_std=float(f * of_best[0]),
        damping_ratio_std=float(xi * of_best[1]),
        friction_std=float(of_best[2]),
        equivalent=np.stack([equivalent, equivalent * of_viscous[:2]]),
        gain=float(max(n_free - 6, 1) / 2 * np.log(max(viscous.cost, 1e-30) / max(best.cost, 1e-30))),
        residual=float(np.sqrt(best.cost / values.size)),
        turn=float(turn / f),
        amplitudes=best.amplitudes * scales,
        offsets=(offsets - best.amplitudes * best.motion(best.parameters).mean()) * scales,
        order=order,
    )


#: Step of ln frequency, ln damping ratio, friction and turn for their derivatives.
_STEP = 1e-7


@dataclass(frozen=True, eq=False)
class _Swing:
    """Samples without their means, shape (samples, channels), and a swing with friction: a point of `least_squares`.

    Notes
    -----
    Parameters are ln frequency, ln damping ratio, friction, and the first turn in periods after the first sample.
    Amplitudes and offsets are linear and follow from them.
    """

    values: Real
    time: Real
    frequency: float
    order: int
    most_friction: float = 0.95
    parameters: Real = field(default_factory=lambda: np.zeros(4))

    def motion(self, parameters: Real) -> Real:
        """Return the swing of unit amplitude, shape (samples,)."""
        f = float(np.exp(parameters[0]))
        return swing_with_friction(
            self.time - parameters[3] / f,
            natural_frequency=f,
            damping_ratio=float(np.exp(parameters[1])),
            friction=float(parameters[2]),
            order=self.order,
        )

    @cached_property
    def left(self) -> Real:
        """What the swing leaves, shape (samples, channels)."""
        return self._fitted(self.parameters)[0]

    @property
    def amplitudes(self) -> Real:
        """Amplitude of each channel, shape (channels,)."""
        return self._fitted(self.parameters)[1]

    @property
    def errors(self) -> Real:
        """What the swing leaves, channel by channel, shape (errors,)."""
        return self.left.T.ravel()

    @property
    def cost(self) -> float:
        """Sum of the squared errors."""
        return float(np.sum(self.left**2))

    @property
    def criterion(self) -> float:
        """Minus the log likelihood, but for a constant."""
        return self.values.size / 2 * float(np.log(max(self.cost, 1e-300)))

    def slopes(self) -> Real:
        """Return the derivatives of the errors; 0 for a parameter that a step would move beyond its bound."""
        slopes, (low, high) = self._derivatives(), self._bounds
        rise = slopes.T @ self.errors
        is_held = (self.parameters <= low) & (rise > 0) | (self.parameters >= high) & (rise < 0)
        return np.where(is_held, 0.0, slopes)

    def moved(self, step: Real) -> "_Swing":
        """Return the swing after a step of the parameters, within their bounds."""
        return replace(self, parameters=np.clip(self.parameters + step, *self._bounds))

    def deviations(self) -> Real:
        """Return the standard deviations of the parameters, from what is left."""
        n_free = max(self.values.size / correlated_samples(self.errors[None]) - 6, 1.0)
        slopes = self._derivatives()
        return np.asarray(np.sqrt(np.diag(self.cost / n_free * np.linalg.pinv(slopes.T @ slopes))))

    @property
    def _bounds(self) -> Real:
        """Lowest and highest parameters, shape (2, 4)."""
        low = [np.log(self.frequency / 3), np.log(1e-5), 0.0, -0.5]
        return np.array([low, [np.log(2 * self.frequency), np.log(0.95), self.most_friction, 0.1]])

    def _fitted(self, parameters: Real) -> tuple[Real, Real]:
        swing = self.motion(parameters)
        swing = swing - swing.mean()
        amplitudes = swing @ self.values / max(float(swing @ swing), 1e-300)
        return self.values - np.outer(swing, amplitudes), amplitudes

    def _derivatives(self) -> Real:
        moved = [self._fitted(self.parameters + _STEP * row)[0].T.ravel() for row in np.eye(4)]
        return np.stack([(each - self.errors) / _STEP for each in moved], axis=-1)


def _cost(swing: _Swing) -> float:
    return swing.cost


def _scaled(samples: Real) -> tuple[Real, int]:
    """Return the samples that are fitted, over the RMS of their channel, shape (samples, channels), and their step."""
    step = max(1, samples.shape[1] // RULES.max_samples)
    return np.asarray(samples[:, ::step].T / np.maximum(np.std(samples, axis=1), 1e-300)), step


def beyond_one_swing(samples: Real) -> float:
    """Return the least RMS that any one motion of all channels can leave of samples, over that of the motion."""
    values = _scaled(samples)[0]
    own = np.linalg.svd(values - values.mean(axis=0), compute_uv=False)
    return float(np.sqrt(np.sum(own[1:] ** 2) / values.size))


def correlated_samples(residuals: Real) -> float:
    """Return the number of samples that count as one, by the correlation of residuals up to its first zero."""
    n = residuals.shape[1]
    lines = np.sum(np.abs(np.fft.rfft(residuals - residuals.mean(axis=1, keepdims=True), 2 * n)) ** 2, axis=0)
    correlations = np.fft.irfft(lines)[:n]
    ratios = correlations / max(correlations[0], 1e-300)
    last = int(np.argmax(ratios <= 0)) or n
    return float(max(1.0, 1 + 2 * np.sum(ratios[1:last])))
