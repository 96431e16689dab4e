"""Modes from free responses: pushes, drops and releases whose motion dies away."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import freeze
from sprung.errors import DataError
from sprung.likelihood.free_response import FreeLines, FreeResponse, free_lines, poles_of, realised_poles
from sprung.likelihood.modal import ModalParameters
from sprung.likelihood.search import scored
from sprung.modal import Modes, unit_shapes
from sprung.recording import Recording, each_recording


@dataclass(frozen=True, slots=True)
class FreeRules:
    """How free responses are fitted."""

    #: Most modes; states of the realisations are up to twice as many.
    max_modes: int = 6
    #: Most block rows, and share of the real parts of the lines that they may use: the rest averages noise.
    max_block_rows: int = 24
    lines_of_block_rows: float = 0.5
    #: Largest damping ratio of a pole that swings.
    max_damping: float = 0.9
    #: Numbers of modes that are refined: those whose realisations come nearest to the data.
    n_refined: int = 2
    #: Largest standard deviation of a mode's frequency over its half-width, and of its damping ratio over itself.
    max_deviation: float = 0.5
    #: Lines around each mode that judge the model, in half-widths from its frequency.
    judged_widths: float = 2.0
    #: Misfit there, over that by chance, from which random forces during the decay are tried.
    forced_misfit: float = 1.5


RULES = FreeRules()


@dataclass(frozen=True, eq=False, slots=True)
class FreeFit:
    """Modes fitted to free responses.

    Parameters
    ----------
    modes
        Modes by rising frequency with their standard deviations; stable rates are NaN.
    amplitudes
        Complex amplitude of each mode at the first sample of each record, in the units of its largest channel, shape
        (records, modes): the motion is the real part of amplitude x shape x exp(pole t).
    covariance
        Covariance of ln frequency and ln damping ratio of all modes, then of the real and imaginary parts of their
        shapes at all channels but the largest, shape (parameters, parameters).
    explained
        Share of the power in the band that the modes explain, in the channel that they explain best.
    information_criterion
        Bayesian information criterion, half of it, in units of the log likelihood.
    has_forces
        Whether random forces acted during the motion.
    n_unclear
        Number of fitted modes that are left out, because the records do not determine them.
    """

    modes: Modes
    amplitudes: Complex
    covariance: Real
    explained: float
    information_criterion: float
    has_forces: bool
    n_unclear: int = 0

    def __post_init__(self) -> None:
        freeze(self, amplitudes=2, dtype=np.complex128)
        freeze(self, covariance=2)

    def motion(self, record: int, time: Real) -> Real:
        """Return the fitted motion of one record at times [s] after its first sample, shape (channels, times)."""
        waves = self.amplitudes[record][:, None] * np.exp(self.modes.poles[:, None] * time)
        return np.asarray((self.modes.mode_shapes.T @ waves).real, dtype=np.float64)


def fit_free_response(
    recordings: Recording | Sequence[Recording],
    *,
    band: tuple[float, float] | None = None,
    max_modes: int | None = None,
) -> FreeFit:
    """Return the modes of one or several free responses of one system, each from a state of its own.

    Parameters
    ----------
    recordings
        Records of the same channels and rate without gaps, in which no force but random ones acts from the first sample
        on.
    band
        Frequencies to fit [Hz]; default: up to 0.4 of the sampling rate.
    max_modes
        Largest number of modes; default: 6.

    Returns
    -------
    FreeFit
        Fit of the number of modes that the Bayesian information criterion prefers, without those that remain unclear.

    Raises
    ------
    DataError
        If the records are too short, or no channel moves.

    Notes
    -----
    Starting values by realisation (`realised_poles`) with rising numbers of states, each refined to the largest
    likelihood (`FreeResponse`). Variances are multiplied by the power of the residuals around each mode, over that of
    the model, where it is above 1, and corrected for the number of parameters.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> time = np.arange(300) / 100
    >>> swing = np.exp(-0.2 * 2 * np.pi * 1.5 * time) * np.sin(2 * np.pi * 1.5 * np.sqrt(1 - 0.2**2) * time)
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(300)
    >>> fit = fit_free_response(Recording((swing + noise)[None], 100.0, (Channel("acc", "acceleration"),)))
    >>> fit.modes.natural_frequency.round(2), fit.modes.damping_ratio.round(2)
    (array([1.5]), array([0.2]))
    """
    runs = list(each_recording(recordings))
    lines = free_lines(runs, band=band or (0.0, 0.4 * runs[0].sampling_rate))
    starts = _starts(lines, most=max_modes or RULES.max_modes)
    nearest = sorted(starts, key=lambda start: start.criterion)[: RULES.n_refined]
    best = min(map(_refined, nearest), key=lambda fitted: fitted.criterion, default=None)
    if best is None:
        raise DataError("no motion swings freely in these records: give the part after the push, or a wider band")
    if _misfits(best).max() > RULES.forced_misfit:
        best = min(best, _refined(_with_forces(best)), key=lambda fitted: fitted.criterion)
    return _result(best, channels=runs[0].names)


def unexplained(recording: Recording, *, band: tuple[float, float], max_modes: int) -> float:
    """Return the RMS in the band of what free modes leave of a record, without a search; inf if none fit.

    Parameters
    ----------
    recording
        Record whose channels are of about equal size.
    band, max_modes
        As for `fit_free_response`.
    """
    lines = free_lines([recording], band=band)
    try:
        starts = _starts(lines, most=max_modes, step=2)
    except DataError:
        return np.inf
    best = min(starts, key=lambda start: start.criterion, default=None)
    if best is None:
        return np.inf
    n_mean = 2 * best.model.modal.n_modes * (best.model.modal.n_channels + 1)
    n_data = 2 * lines.values.size
    density = np.mean(best.model.begin.noise) * n_data / max(n_data - n_mean, 1)
    return float(np.sqrt(density * lines.frequencies.max()))


@dataclass(frozen=True, eq=False, slots=True)
class _Fitted:
    """A model with data, and parameters of it."""

    model: FreeResponse
    parameters: Real

    @property
    def criterion(self) -> float:
        """Half of the Bayesian information criterion."""
        model = self.model
        n_free = self.parameters.size + 2 * model.modal.n_modes * model.data.n_records
        return model.objective(self.parameters)[0] + n_free / 2 * np.log(2 * model.data.values.size)


def _starts(lines: FreeLines, *, most: int, step: int = 1) -> list[_Fitted]:
    """Return the realisations nearest to the data with each number of modes, up to the most; `step` between states."""
    shortest = min((int(np.sum(lines.records == number)) for number in range(lines.n_records)), default=0)
    rows, n_channels = int(min(RULES.max_block_rows, 2 * RULES.lines_of_block_rows * shortest)), lines.values.shape[1]
    n_states = min(2 * most + 2, (rows - 1) * min(n_channels, 2))
    if n_states < 2:
        raise DataError("the records are too short for a free response: give longer ones, or a wider band")
    rms = np.sqrt(np.mean(np.abs(lines.values) ** 2, axis=0))
    if not np.all(rms > 0) or not np.all(np.isfinite(rms)):
        raise DataError("a free response needs channels that move, without missing values: leave out dead channels")
    best: dict[int, _Fitted] = {}
    sizes = range(step, n_states + 1, step)
    for poles, shapes in realised_poles(lines.scaled(1 / rms), n_states=sizes, block_rows=rows):
        xi = -poles.real / np.abs(poles)
        swings = np.flatnonzero((xi < RULES.max_damping) & (np.abs(poles) < 2 * np.pi * lines.frequencies.max()))
        if not 0 < swings.size <= most:
            continue
        start = _started(lines, poles[swings], unit_shapes(shapes[swings] * rms))
        if start is not None and (swings.size not in best or start.criterion < best[swings.size].criterion):
            best[swings.size] = start
    return list(best.values())


def _started(data: FreeLines, poles: Complex, shapes: Complex) -> _Fitted | None:
    """Return the model at some poles with the noise that they leave; None where the data are fewer than needed."""
    n, n_channels = len(poles), data.values.shape[1]
    begin = ModalParameters(
        natural_frequency=np.abs(poles) / (2 * np.pi),
        damping_ratio=-poles.real / np.abs(poles),
        common_exponent=np.zeros(1),
        force_exponents=np.zeros(n),
        mode_shapes=shapes,
        forces=np.zeros((n, n), dtype=np.complex128),
        noise=np.ones(n_channels),
        noise_exponents=np.zeros(n_channels),
    )
    model = FreeResponse(data, begin)
    if 2 * (model.start.size + n * data.n_records) > 2 * data.values.size:
        return None
    try:
        model = model.with_noise(model.start)
    except np.linalg.LinAlgError:
        return None
    return _Fitted(model, model.start)


def _refined(fitted: _Fitted) -> _Fitted:
    """Return the parameters of largest likelihood; those given where the search fails."""
    try:
        parameters, _ = scored(fitted.model, fitted.parameters)
        again = fitted.model if fitted.model.has_forces else fitted.model.with_noise(parameters)
        return _Fitted(again, scored(again, again.start)[0])
    except np.linalg.LinAlgError:
        return fitted


def _with_forces(fitted: _Fitted) -> _Fitted:
    """Return a fit with random forces whose motion at each peak is as strong as the noise."""
    values = fitted.model.modal.unpacked(fitted.parameters)
    power = 4 * values.damping_ratio**2 * np.mean(values.noise)
    begin = replace(values, forces=np.diag(power).astype(np.complex128))
    model = replace(fitted.model, begin=begin, has_forces=True)
    return _Fitted(model, model.start)


def _misfits(fitted: _Fitted) -> Real:
    """Return the power of the residuals around each mode over that of the model, shape (modes,)."""
    model, fit = fitted.model, fitted.model.fitted(fitted.parameters)
    values, powers = fit.values, np.abs(fit.whitened) ** 2
    n_data = 2 * model.data.values.size
    n_mean = 2 * model.modal.n_modes * (model.modal.n_channels + model.data.n_records)
    misfits = np.empty(model.modal.n_modes)
    for k, (f, xi) in enumerate(zip(values.natural_frequency, values.damping_ratio, strict=True)):
        distance = np.abs(model.data.frequencies - f)
        reach = max(RULES.judged_widths * f * xi, np.partition(distance, min(7, distance.size - 1))[7 % distance.size])
        misfits[k] = np.mean(powers[distance <= reach])
    return np.maximum(misfits, 1.0) * n_data / max(n_data - n_mean, n_data / 4)


def _result(fitted: _Fitted, *, channels: tuple[str, ...]) -> FreeFit:
    """Return the clear modes of a fit."""
    model, parameters = fitted.model, fitted.parameters
    fit, n = model.fitted(parameters), model.modal.n_modes
    values = fit.values
    f, xi, poles = values.natural_frequency, values.damping_ratio, poles_of(values)
    covariance = np.linalg.inv(model.information(parameters) + np.diag(1 / model.prior_std**2))
    chosen = np.concatenate([model.modal.rows[name] for name in ("natural_frequency", "damping_ratio", "mode_shapes")])
    of_mode = np.concatenate([np.arange(n), np.arange(n), np.repeat(np.nonzero(model.modal.is_free)[0], 2)])
    factors = np.sqrt(_misfits(fitted))[of_mode]
    covariance = covariance[np.ix_(chosen, chosen)] * np.outer(factors, factors)
    stds = np.sqrt(np.diag(covariance))
    shape_stds = np.zeros(values.mode_shapes.shape, dtype=np.complex128)
    shape_stds[model.modal.is_free] = stds[2 * n :].view(np.complex128)
    modes = Modes(
        poles=poles,
        mode_shapes=values.mode_shapes,
        channels=channels,
        natural_frequency_std=f * stds[:n],
        damping_ratio_std=xi * stds[n : 2 * n],
        stable_rate=np.full(n, np.nan),
        labels=(None,) * n,
        mode_shape_std=shape_stds,
    )
    gains = model.data.gains[np.flatnonzero(np.diff(model.data.records, prepend=-1))]
    durations = 2 / (gains * model.data.sampling_rate) ** 2
    amplitudes = 2 * fit.amplitudes / (1 - np.exp(np.outer(durations, poles)))
    order = np.argsort(f)
    is_clear = (
        (stds[:n] < RULES.max_deviation * xi) & (stds[n : 2 * n] < RULES.max_deviation) & (xi < RULES.max_damping)
    )
    kept = order[is_clear[order]]
    rows = np.concatenate([kept, n + kept, *(np.flatnonzero(of_mode[2 * n :] == k) + 2 * n for k in kept)])
    left = np.sum(np.abs(fit.residuals) ** 2, axis=0)
    return FreeFit(
        modes=modes.take(kept),
        amplitudes=amplitudes[:, kept],
        covariance=covariance[np.ix_(rows, rows)],
        explained=float(1 - np.min(left / np.sum(np.abs(model.data.values) ** 2, axis=0))),
        information_criterion=fitted.criterion,
        has_forces=model.has_forces,
        n_unclear=n - len(kept),
    )
