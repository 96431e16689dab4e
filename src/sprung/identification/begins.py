"""Where the free motion of pushes begins: as early as the modes of the motion after it predict the samples before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung.errors import DataError
from sprung.identification.free_response import FreeFit, fit_free_response
from sprung.identification.transients import Transient
from sprung.modal import Modes
from sprung.recording import Recording


@dataclass(frozen=True, slots=True)
class _BeginRules:
    """From where on a motion is free beyond doubt, and how far it is followed back."""

    #: Delay of the first fit after the begin that was found, in windows of the level, and shortest motion then.
    delay: float = 0.5
    min_windows: float = 1.2
    #: Samples that are predicted together, in windows of the level.
    block: float = 0.0625
    #: Normal quantile of the errors of a prediction, for the block or for all so far, beyond which the motion was not
    #: free: that of 0.001.
    beyond: float = 3.09
    #: Blocks after a wrong prediction that are left out: what is too small to see there still pulls the modes.
    margin: int = 1


_RULES = _BeginRules()


def fit_from_begins(
    motions: Sequence[tuple[Recording, Transient]],
    *,
    band: tuple[float, float] | None = None,
    begins: Sequence[Modes] = (),
    least_explained: float = 0.0,
) -> FreeFit:
    """Return the modes of several motions, each from where on it is free; as `fit_free_response`.

    Parameters
    ----------
    motions
        Recordings of the same channels and rate without gaps, and a motion of each.
    band, begins, least_explained
        As for `fit_free_response`.

    Raises
    ------
    DataError
        As for `fit_free_response`, and if the modes explain less than demanded.

    Notes
    -----
    First from where they are free beyond doubt, then from where on the modes found predict them.
    """
    runs, spans = [run for run, _ in motions], [delayed(*each) for each in motions]

    def fitted(begins: Sequence[Modes]) -> FreeFit:
        parts = [run.part(*span) for run, span in zip(runs, spans, strict=True)]
        return fit_free_response(parts, band=band, begins=begins, least_explained=least_explained)

    fit = fitted(begins)
    if any(first for first, _ in spans):
        for k, (run, motion) in enumerate(motions):
            begin = round(motion.begin * run.sampling_rate)
            spans[k] = free_from(fit, k, run, spans[k], motion) if len(fit.modes) else begin, spans[k][1]
        fit = fitted([fit.modes, *begins])
    if fit.explained < least_explained:
        raise DataError(f"free modes explain less than {100 * least_explained:.0f} % of the motion in these records")
    return fit


def delayed(run: Recording, motion: Transient) -> tuple[int, int]:
    """Return first and last sample of a motion that is free beyond doubt; a record that begins free is so at once."""
    rate, window = run.sampling_rate, motion.window
    begin, end = (round(each * rate) for each in (motion.begin, motion.end))
    if begin == 0:
        return begin, end
    latest = end - round(_RULES.min_windows * window * rate)
    return max(begin, min(begin + round(_RULES.delay * window * rate), latest)), end


def free_from(fit: FreeFit, record: int, run: Recording, span: tuple[int, int], motion: Transient) -> int:
    """Return the first sample from which on a motion is free.

    Parameters
    ----------
    fit
        Modes of all motions.
    record
        Number of the motion in the fit.
    run, span, motion
        Its recording, first and last sample that were fitted, and the motion.

    Notes
    -----
    Amplitudes, offsets and the errors of the modes are estimated from the later samples by least squares, and predict
    the block of samples before with their covariance (recursive residuals). A block within chance joins the estimate:
    (x / n)^(1/3) of a chi-squared x of n degrees is normal, of mean 1 - 2 / 9n and variance 2 / 9n.

    References
    ----------
    E. B. Wilson and M. M. Hilferty, The distribution of chi-square, Proceedings of the National Academy of Sciences 17
    (1931), 684-688.
    """
    begin, end = span
    near = _Linearised(fit, record, run, begin)
    near = _Linearised(fit, record, run, begin, noise=np.std(near.left(begin, end), axis=0))
    design, left = near.design(begin, end), near.left(begin, end).ravel()
    information = design.T @ design + near.prior(len(fit.amplitudes))
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    covariance = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
    state = covariance @ (design.T @ left)
    block = max(1, round(_RULES.block * motion.window * run.sampling_rate))
    first, worse, size = begin, 0.0, 0
    while first - block >= round(motion.onset * run.sampling_rate):
        rows = near.design(first - block, first)
        errors = near.left(first - block, first).ravel() - rows @ state
        gain = np.linalg.solve(np.eye(len(rows)) + rows @ covariance @ rows.T, np.column_stack([rows, errors]))
        power = float(errors @ gain[:, -1])
        worse, size = worse + power, size + errors.size
        if max(_quantile(power, errors.size), _quantile(worse, size)) > _RULES.beyond:
            return min(first + _RULES.margin * block, begin)
        state = state + covariance @ rows.T @ gain[:, -1]
        covariance = covariance - covariance @ rows.T @ gain[:, :-1] @ covariance
        first -= block
    return first


def _quantile(power: float, size: int) -> float:
    """Return the normal quantile of a chi-squared power of a number of errors."""
    variance = 2 / (9 * size)
    return float(((power / size) ** (1 / 3) - 1 + variance) / np.sqrt(variance))


class _Linearised:
    """Motion of a test near the fitted modes, over the noise: linear in amplitudes, offsets and errors of the modes."""

    def __init__(self, fit: FreeFit, record: int, run: Recording, begin: int, noise: Real | None = None) -> None:
        self.fit, self.record, self.run, self.begin = fit, record, run, begin
        self.noise = np.ones(len(run.channels)) if noise is None else np.maximum(noise, 1e-300)

    def left(self, first: int, last: int) -> Real:
        """Return samples less the fitted motion, over the noise, shape (samples, channels)."""
        fitted = self.fit.motion(self.record, (np.arange(first, last) - self.begin) / self.run.sampling_rate)
        return np.asarray((self.run.samples[:, first:last] - fitted).T / self.noise)

    def prior(self, n_records: int) -> Real:
        """Return the information on all unknowns from the other records."""
        n_free = 2 * len(self.fit.modes) + len(self.noise)
        size = n_free + len(self.fit.covariance)
        information = np.zeros((size, size))
        information[n_free:, n_free:] = np.linalg.inv(self.fit.covariance) * (n_records - 1) / n_records
        return information

    def design(self, first: int, last: int) -> Real:
        """Return the derivatives of samples over the noise, shape (samples x channels, unknowns)."""
        modes, time = self.fit.modes, (np.arange(first, last) - self.begin) / self.run.sampling_rate
        shapes, amplitudes, xi = modes.mode_shapes, self.fit.amplitudes[self.record], modes.damping_ratio
        waves = np.exp(np.outer(time, modes.poles))
        by_damping = 2 * np.pi * modes.natural_frequency * xi * (-1 - 1j * xi / np.sqrt(1 - xi**2))
        pairs = [
            each for k in range(len(xi)) for each in (waves[:, k, None] * shapes[k], 1j * waves[:, k, None] * shapes[k])
        ]
        offsets = [np.ones((time.size, 1)) * row for row in np.eye(len(self.noise))]
        moved = waves * amplitudes
        poles = [
            (time * moved[:, k] * slopes[k])[:, None] * shapes[k]
            for slopes in (modes.poles, by_damping)
            for k in range(len(xi))
        ]
        of_shapes = []
        for k, c in zip(
            *np.nonzero(np.arange(len(self.noise)) != np.argmax(np.abs(shapes), axis=1)[:, None]), strict=True
        ):
            unit = np.eye(len(self.noise))[c]
            of_shapes += [moved[:, k, None] * unit, 1j * moved[:, k, None] * unit]
        columns = (
            np.stack([each.real for each in [*pairs, *offsets, *poles, *of_shapes]], axis=-1) / self.noise[:, None]
        )
        return np.asarray(columns.reshape(-1, columns.shape[-1]))
