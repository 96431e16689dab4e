"""Free responses: pushes, drops and releases in a recording, from where on their motion is free, and its modes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_type, freeze
from sprung.errors import DataError
from sprung.likelihood.free_poles import FreePoles
from sprung.likelihood.free_response import FreeLines, FreeResponse, free_lines, poles_of, realised_poles
from sprung.likelihood.modal import ModalParameters
from sprung.likelihood.search import scored
from sprung.modal import Modes, unit_shapes
from sprung.recording import Recording, each_recording


@dataclass(frozen=True, slots=True)
class _FreeRules:
    """How free responses are fitted."""

    #: Most modes; states of the realisations are up to twice as many.
    max_modes: int = 6
    #: Most block rows, and share of the real parts of the lines that they may use: the rest averages noise.
    max_block_rows: int = 24
    lines_of_block_rows: float = 0.25
    #: Largest damping ratio of a pole that swings.
    max_damping: float = 0.9
    #: Numbers of modes that are refined: those whose least squares come nearest to the data; one where modes are known.
    n_refined: int = 2
    #: Decrease of the log likelihood by the prior below which the search does not begin again from where it ended.
    settled: float = 0.05
    #: Largest standard deviation of a mode's frequency over its half-width, and of its damping ratio over itself.
    max_deviation: float = 0.5
    #: Lines around each mode that judge the model, in half-widths from its frequency.
    judged_widths: float = 2.0
    #: Misfit there, over that by chance, from which random forces during the decay are tried.
    forced_misfit: float = 2.0
    #: Largest distance of a further mode, in ln of the frequency, that may be hidden beside another.
    nearby: float = 0.5
    #: Factor of a deviation by which a mode that may be hidden is noted.
    doubled: float = 2.0


_FIT = _FreeRules()


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
        Share of the power in the band that the modes explain, in the channel that they explain best of the record that
        they explain least.
    information_criterion
        Bayesian information criterion, half of it, in units of the log likelihood.
    has_forces
        Whether random forces acted during the motion.
    hidden
        Frequencies of the modes beside which another one may hide, so that their deviations are more than doubled [Hz].
    """

    modes: Modes
    amplitudes: Complex
    covariance: Real
    explained: float
    information_criterion: float
    has_forces: bool
    hidden: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, amplitudes=2, dtype=np.complex128)
        freeze(self, covariance=2)

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on modes that may be hidden, if any."""
        if not self.hidden:
            return ()
        beside = " and ".join(f"{frequency:.4g}" for frequency in self.hidden)
        return (
            f"another mode may hide beside {beside} Hz, which the stated deviations allow for: add sensors elsewhere",
        )

    def motion(self, record: int, time: Real) -> Real:
        """Return the fitted motion of one record at times [s] after its first sample, shape (channels, times)."""
        waves = self.amplitudes[record][:, None] * np.exp(self.modes.poles[:, None] * time)
        return np.asarray((self.modes.mode_shapes.T @ waves).real, dtype=np.float64)


def fit_free_response(
    recordings: Recording | Sequence[Recording],
    *,
    band: tuple[float, float] | None = None,
    max_modes: int | None = None,
    begins: Sequence[Modes] = (),
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
    begins
        Modes of all channels from which the search begins, too, such as those of single records.

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
    Starting values by least squares with rising numbers of modes (`FreePoles`), each from a realisation
    (`realised_poles`) or from the fit before and a further pole; the nearest are refined to the largest likelihood
    (`FreeResponse`). Variances are multiplied by the power of the residuals around each mode, over that of the model,
    where it is above 1, corrected for the number of parameters, and hold a further mode that may be hidden nearby.

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
    most = max_modes or _FIT.max_modes
    realised = list(_realised(lines, most=most))
    starts = _grown(lines, [poles for poles, _ in realised], most=most, begins=begins)
    nearest = sorted(starts, key=lambda start: start.criterion)[: 1 if begins else _FIT.n_refined]
    best = min(map(_refined, nearest), key=lambda fitted: fitted.criterion, default=None)
    if best is None:
        raise DataError("no motion swings freely in these records: give the part after the push, or a wider band")
    if _misfits(best).max() > _FIT.forced_misfit:
        best = min([best, *_forced(lines, realised)], key=lambda fitted: fitted.criterion)
    return _result(best, _doubts(best), channels=runs[0].names)


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
    n_data, n_channels = 2 * lines.values.size, lines.values.shape[1]
    best = np.inf, np.inf
    try:
        for poles, _ in _realised(lines, most=max_modes, step=2):
            n_mean = 2 * poles.size * (n_channels + 1)
            if n_mean + 2 * n_channels <= n_data / 2:
                fit = FreePoles(lines, poles)
                density = float(np.mean(fit.noise)) * n_data / (n_data - n_mean)
                best = min(best, (fit.criterion + n_mean / 2 * np.log(n_data), density))
    except DataError:
        return np.inf
    return float(np.sqrt(best[1] * lines.frequencies.max()))


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


def _realised(lines: FreeLines, *, most: int, step: int = 1) -> Iterator[tuple[Complex, Complex]]:
    """Yield the poles and shapes that swing of realisations with up to the most modes; `step` between their states."""
    shortest = min((int(np.sum(lines.records == number)) for number in range(lines.n_records)), default=0)
    rows, n_channels = int(min(_FIT.max_block_rows, 2 * _FIT.lines_of_block_rows * shortest)), lines.values.shape[1]
    n_states = min(2 * most + 2, (rows - 1) * min(n_channels, 2))
    if n_states < 2:
        raise DataError("the records are too short for a free response: give longer ones, or a wider band")
    rms = np.sqrt(np.mean(np.abs(lines.values) ** 2, axis=0))
    if not np.all(rms > 0) or not np.all(np.isfinite(rms)):
        raise DataError("a free response needs channels that move, without missing values: leave out dead channels")
    sizes = range(step, n_states + 1, step)
    for poles, shapes in realised_poles(lines.scaled(1 / rms), n_states=sizes, block_rows=rows):
        xi = -poles.real / np.abs(poles)
        swings = np.flatnonzero((xi < _FIT.max_damping) & (np.abs(poles) < 2 * np.pi * lines.frequencies.max()))
        if 0 < swings.size <= most:
            yield poles[swings], unit_shapes(shapes[swings] * rms)


def _grown(lines: FreeLines, realised: Sequence[Complex], *, most: int, begins: Sequence[Modes]) -> list[_Fitted]:
    """Return the fits of least squares with rising numbers of modes.

    Notes
    -----
    Each from the nearest known poles or realisation, and from the fit before and a further pole. Where modes are known,
    from the fewest of them on.
    """
    found: list[_Fitted] = []
    known = [*realised] + [modes.poles for modes in begins if len(modes)]
    first = min((len(modes) for modes in begins if len(modes)), default=1)
    poles = FreePoles(lines, np.zeros(0, dtype=np.complex128))
    for n in range(first, most + 1):
        near = (FreePoles(lines, each) for each in known if each.size == n)
        candidates = sorted(near, key=lambda each: each.criterion)[:1]
        candidates += [poles.with_another()] if poles.poles.size == n - 1 else []
        if not candidates:
            break
        poles = min((each.refined() for each in candidates), key=lambda each: each.criterion)
        start = _started(lines, poles.poles, unit_shapes(poles.mode_shapes))
        if start is None:
            break
        found.append(start)
        if len(found) - 2 > np.argmin([each.criterion for each in found]):
            break
    return found


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
    """Return the parameters of largest likelihood; those given where the search fails.

    Notes
    -----
    The search begins again from where it ended if the prior around the start pulled it, or if a shape is larger
    elsewhere than where it was 1.
    """
    try:
        parameters, _ = scored(fitted.model, fitted.parameters)
        again = fitted.model if fitted.model.has_forces else fitted.model.with_noise(parameters)
        pull = ((parameters - fitted.model.start) / fitted.model.prior_std)[_rows_of_modes(fitted.model)]
        if pull @ pull / 2 < _FIT.settled and np.array_equal(again.modal.is_free, fitted.model.modal.is_free):
            return _Fitted(fitted.model, parameters)
        return _Fitted(again, scored(again, again.start)[0])
    except np.linalg.LinAlgError:
        return fitted


def _forced(lines: FreeLines, realised: Sequence[tuple[Complex, Complex]]) -> list[_Fitted]:
    """Return fits with random forces of rising numbers of modes, as long as the criterion falls."""
    started = [start for each in realised if (start := _started(lines, *each)) is not None]
    starts = {each.model.modal.n_modes: each for each in sorted(started, key=lambda each: -each.criterion)}
    found: list[_Fitted] = []
    for n in sorted(starts):
        found.append(_refined(_with_forces(_refined(starts[n]))))
        if found[-1].criterion > min(each.criterion for each in found):
            break
    return found


def _with_forces(fitted: _Fitted) -> _Fitted:
    """Return a fit with random forces whose motion at each peak is as strong as the noise."""
    values = fitted.model.modal.unpacked(fitted.parameters)
    power = 4 * values.damping_ratio**2 * np.mean(values.noise)
    begin = replace(values, forces=np.diag(power).astype(np.complex128))
    model = replace(fitted.model, begin=begin, has_forces=True)
    return _Fitted(model, model.start)


def _misfits(fitted: _Fitted) -> Real:
    """Return the power of the residuals around each mode over that of the model, shape (modes,).

    Notes
    -----
    Around a mode the fitted mean takes more of the noise than elsewhere: residuals are judged by what it leaves.
    """
    model, fit = fitted.model, fitted.model.fitted(fitted.parameters)
    values, powers = fit.values, np.abs(fit.whitened) ** 2
    expected = 1 - model.leverages(fitted.parameters)
    everywhere = expected.size / max(np.sum(expected), expected.size / 4)
    misfits = np.empty(model.modal.n_modes)
    for k, (f, xi) in enumerate(zip(values.natural_frequency, values.damping_ratio, strict=True)):
        distance = np.abs(model.data.frequencies - f)
        reach = max(_FIT.judged_widths * f * xi, np.partition(distance, min(7, distance.size - 1))[7 % distance.size])
        near = distance <= reach
        misfits[k] = np.sum(powers[near]) / max(np.sum(expected[near]), expected[near].size / 4)
    return np.maximum(misfits, everywhere)


def _doubts(fitted: _Fitted) -> Real:
    """Return factors of the standard deviations of ln frequencies and damping ratios for modes that may be hidden.

    Returns
    -------
    ndarray
        At least 1, shape (2, modes).

    Notes
    -----
    The criterion leaves out a mode beside another that is worth less than its parameters cost, but the estimates of the
    other one move. Mean square errors are averaged over the fit and the one with a further mode nearby, whose weight is
    1/2 where it gains as much as chance gives on average, and its logistic function of the gain beyond.

    References
    ----------
    S. T. Buckland, K. P. Burnham and N. H. Augustin, Model selection: an integral part of inference, Biometrics 53
    (1997), 603-618.
    """
    model, n = fitted.model, fitted.model.modal.n_modes
    if model.has_forces:
        return np.ones((2, n))
    own = model.fitted(fitted.parameters).values
    poles = FreePoles(model.data, poles_of(own)).with_another(nearer=_FIT.nearby).refined()
    start = _started(model.data, poles.poles, unit_shapes(poles.mode_shapes))
    if start is None:
        return np.ones((2, n))
    other = _refined(start)
    gain = model.objective(fitted.parameters)[0] - other.model.objective(other.parameters)[0]
    n_more = other.parameters.size - fitted.parameters.size + 2 * model.data.n_records
    weight = 1 / (1 + np.exp(np.clip(n_more / 2 - gain, -50, 50)))
    values = other.model.fitted(other.parameters).values
    logarithms = [np.log([each.natural_frequency, each.damping_ratio]) for each in (own, values)]
    differences = logarithms[1][:, None, :] - logarithms[0][:, :, None]
    nearest = np.argmin(np.sum(np.abs(differences), axis=0), axis=1)
    errors = differences[:, np.arange(n), nearest] ** 2
    variances = np.diag(_covariance(fitted))[: 2 * n].reshape(2, n)
    further = np.diag(_covariance(other))[: 2 * n + 2].reshape(2, n + 1)[:, nearest]
    ratios = (further + errors) / np.where(variances > 0, variances, np.inf)
    return np.asarray(np.sqrt(np.maximum(1, 1 + weight * (ratios - 1))))


def _covariance(fitted: _Fitted) -> Real:
    """Return the covariance of ln frequencies, ln damping ratios and free parts of the shapes, misfits included."""
    model, parameters = fitted.model, fitted.parameters
    covariance = np.linalg.inv(model.information(parameters) + np.diag(1 / model.prior_std**2))
    chosen = _rows_of_modes(model)
    factors = np.sqrt(_misfits(fitted))[_mode_of_each(model)]
    return np.asarray(covariance[np.ix_(chosen, chosen)] * np.outer(factors, factors))


def _rows_of_modes(model: FreeResponse) -> Indices:
    """Return the numbers of the parameters that are ln frequencies, ln damping ratios and free parts of the shapes."""
    return np.concatenate([model.modal.rows[name] for name in ("natural_frequency", "damping_ratio", "mode_shapes")])


def _mode_of_each(model: FreeResponse) -> Indices:
    """Return the number of the mode of each row of `_covariance`."""
    return np.concatenate(
        [np.tile(np.arange(model.modal.n_modes), 2), np.repeat(np.nonzero(model.modal.is_free)[0], 2)]
    )


def _result(fitted: _Fitted, doubts: Real, *, channels: tuple[str, ...]) -> FreeFit:
    """Return the clear modes of a fit."""
    model, parameters = fitted.model, fitted.parameters
    fit, n = model.fitted(parameters), model.modal.n_modes
    values = fit.values
    f, xi, poles = values.natural_frequency, values.damping_ratio, poles_of(values)
    of_mode = _mode_of_each(model)
    factors = np.concatenate([doubts.ravel(), doubts.max(axis=0)[of_mode[2 * n :]]])
    covariance = _covariance(fitted) * np.outer(factors, factors)
    variances = np.diag(covariance)
    stds = np.sqrt(np.where(variances > 0, variances, np.inf))  # not positive where the records determine nothing
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
    certain = (stds[: 2 * n] / doubts.ravel()).reshape(2, n)
    is_clear = (certain[0] < _FIT.max_deviation * xi) & (certain[1] < _FIT.max_deviation) & (xi < _FIT.max_damping)
    kept = order[is_clear[order]]
    rows = np.concatenate([kept, n + kept, *(np.flatnonzero(of_mode[2 * n :] == k) + 2 * n for k in kept)])
    every = np.arange(model.data.n_records)[:, None] == model.data.records
    left, whole = (every @ np.abs(each) ** 2 for each in (fit.residuals, model.data.values))
    return FreeFit(
        modes=modes.take(kept),
        amplitudes=amplitudes[:, kept],
        covariance=covariance[np.ix_(rows, rows)],
        explained=float(1 - np.max(np.min(left / whole, axis=1))),
        information_criterion=fitted.criterion,
        has_forces=model.has_forces,
        hidden=tuple(f[kept][doubts.max(axis=0)[kept] > _FIT.doubled].tolist()),
    )


@dataclass(frozen=True, slots=True)
class _TransientRules:
    """What counts as motion that dies away."""

    #: Bounds of the frequency of the swings [Hz] that sets the windows of the level.
    swings: tuple[float, float] = (0.4, 30.0)
    #: Samples at either end through whose means a line is subtracted: a step between the ends is no swing.
    ends: int = 8
    #: Power over its median from which a line is motion: one line of noise in a million is.
    beyond_median: float = 20.0
    #: Level at which a motion begins and ends, over the largest level, and over that of the quiet parts.
    edge: float = 0.06
    edge_over_quiet: float = 3.0
    #: Smallest peak of a motion over the largest.
    min_peak: float = 0.4
    #: Smallest fall of the level from the peak to the end.
    min_fall: float = 3.0
    #: The same where the end is at the edge.
    min_fall_to_edge: float = 2.0
    #: Shortest free motion, in windows of the level.
    min_windows: float = 1.2
    #: Rise of the level over its minimum since the peak before from which another motion begins.
    rise: float = 3.0
    #: Level below which a record is quiet, over its peak, and least share of such samples of a record of free motion.
    quiet: float = 0.08
    min_quiet: float = 0.4
    #: Least share of a record of free motion that is free: one pothole of a drive is no push.
    min_share: float = 0.02
    #: Fall of the level, from the first sixth to the last, of a record that is one decay.
    fall_of_record: float = 5.0
    #: Most motions in a record of free motion, and most windows of each that are fitted.
    max_motions: int = 20
    max_windows: float = 60.0
    #: Windows of rest that are fitted after the end of a motion.
    rest: int = 1
    #: Starts of free motion that are tried, from a window before the peak of the level to two after it.
    n_starts: int = 10
    #: Windows on either side of the quietest sample, from which the noise is taken: one alone is quiet by chance.
    around_quietest: int = 1
    #: Frequencies that are fitted, over that of the windows, and most modes.
    reach: float = 8.0
    max_modes: int = 4
    #: RMS of the residuals of the first free motion over the smallest of later starts.
    beyond_least: float = 1.2
    #: The same, in shares of the motion's own RMS, for motion with friction or progressive springs.
    beyond_motion: float = 0.004


_EVENTS = _TransientRules()


@dataclass(frozen=True, slots=True)
class Transient:
    """Motion after a push, drop or release that dies away.

    Parameters
    ----------
    onset
        Time at which the motion begins [s] after the first sample of the recording.
    begin, end
        Times between which it is free [s].
    window
        Length of the windows of the level [s], about one period.
    unexplained
        RMS of what free modes leave of it from a quarter of a window after its peak, over that of the motion.
    noise
        RMS in the band that is fitted, where the recording is quietest, over that of the motion.
    """

    onset: float
    begin: float
    end: float
    window: float
    unexplained: float
    noise: float


def motion_level(recording: Recording) -> tuple[Real, float]:
    """Return the level of the motion over time, 1 at its largest, and the length of its windows [s].

    Returns
    -------
    ndarray, float
        Standard deviation within a window of about one period around each sample, root mean square over the channels
        that move beyond their noise, each over its own largest; shape (samples,).

    Notes
    -----
    The period is that of the mean frequency of the slopes, in which steps of travel count little, by the lines whose
    power stands above the noise: the slopes of the noise alone would halve it.
    """
    samples, rate = np.nan_to_num(recording.samples), recording.sampling_rate
    begin, end = (part.mean(axis=1) for part in (samples[:, : _EVENTS.ends], samples[:, -_EVENTS.ends :]))
    powers = np.abs(np.fft.rfft(samples - np.linspace(begin, end, samples.shape[1], axis=1), axis=1)) ** 2
    frequencies = np.fft.rfftfreq(samples.shape[1], 1 / rate)
    used = (frequencies >= _EVENTS.swings[0]) & (frequencies <= min(_EVENTS.swings[1], 0.4 * rate))
    powers, frequencies = powers[:, used], frequencies[used]
    slopes = powers * np.sin(np.pi * frequencies / rate) ** 2
    slopes = slopes * (powers > _EVENTS.beyond_median * np.median(powers, axis=1, keepdims=True))
    spectrum = np.mean(slopes / np.maximum(slopes.sum(axis=1, keepdims=True), 1e-300), axis=0)
    centre = float(np.sum(spectrum * frequencies) / max(spectrum.sum(), 1e-300)) or _EVENTS.swings[0]
    n = int(np.clip(rate / centre, 8, max(8, samples.shape[1] // 4)))
    centred = samples - np.median(samples, axis=1, keepdims=True)
    means, squares = (_running_mean(values, n) for values in (centred, centred**2))
    deviations = np.sqrt(np.maximum(squares - means**2, 0.0))
    largest = np.maximum(deviations.max(axis=1, keepdims=True), 1e-300)
    moves = largest[:, 0] > _EVENTS.min_fall * np.quantile(deviations, 0.1, axis=1)
    level = np.sqrt(np.mean((deviations / largest)[moves if moves.any() else slice(None)] ** 2, axis=0))
    return np.asarray(level / max(level.max(), 1e-300)), n / rate


def _running_mean(values: Real, n: int) -> Real:
    """Return the mean of n values around each one; the first and the last are continued, shape of the values."""
    around = np.pad(values, ((0, 0), (n // 2 + 1, n - 1 - n // 2)), mode="edge")
    sums = np.cumsum(around, axis=1)
    return np.asarray((sums[:, n:] - sums[:, :-n]) / n)


def find_transients(recording: Recording) -> tuple[Transient, ...]:
    """Return the motions of a recording that begin suddenly and die away, with the parts in which they are free.

    Parameters
    ----------
    recording
        Channels of motion, without missing values or gaps.

    Returns
    -------
    tuple of Transient
        By time; none where the motion never falls to a fraction of its peak.

    Notes
    -----
    A motion is a part above the edge of the level whose peak is not far below the largest one. It is free from the
    first start on from which modes leave hardly more than they leave of a later one (`unexplained`).
    """
    check_type("recording", recording, Recording)
    level, window = motion_level(recording)
    rate, width = recording.sampling_rate, round(window * recording.sampling_rate)
    edge = max(_EVENTS.edge, min(_EVENTS.edge_over_quiet * float(np.quantile(level, 0.1)), 1 / _EVENTS.min_fall))
    scale = np.maximum(np.std(recording.samples, axis=1, keepdims=True), 1e-300)
    quietest = int(np.argmin(level))
    reach = _EVENTS.around_quietest * width
    resting = recording.samples[:, max(quietest - reach, 0) : quietest + reach + 1] / scale
    at_rest = _rms_up_to(resting, _top(recording, window) / rate)
    events = _events(level, edge, width)
    found = []
    for first, last in events:
        part = level[first : last + 1]
        fallen = max(part.max() / _EVENTS.min_fall, min(edge, part.max() / _EVENTS.min_fall_to_edge))
        if part.max() < _EVENTS.min_peak or part[-1] > fallen:
            continue
        peak = first + int(np.flatnonzero(part > 0.7 * part.max())[-1])
        end = min([last + _EVENTS.rest * width, level.size, *(each[0] for each in events if each[0] > last)])
        starts = np.linspace(peak - width, peak + 2 * width, _EVENTS.n_starts).astype(int)
        starts = np.unique(np.clip(starts, 0, max(end - int(_EVENTS.min_windows * width), 0)))
        left = [_left_over(recording, begin, end, scale, window) for begin in starts]
        fitted = np.flatnonzero(np.isfinite(left))
        if not fitted.size:
            continue
        motion = float(np.sqrt(np.mean((np.std(recording.samples[:, starts[0] : end], axis=1) / scale[:, 0]) ** 2)))
        allowed = _EVENTS.beyond_least * min(left) + _EVENTS.beyond_motion * motion
        begin = int(starts[np.flatnonzero(np.array(left) <= allowed)[0]])
        judged = int(fitted[np.clip(np.sum(starts[fitted] < peak + width // 4), 0, fitted.size - 1)])
        own = np.sqrt(np.mean((np.std(recording.samples[:, starts[judged] : end], axis=1) / scale[:, 0]) ** 2))
        relative, quiet = (float(each / max(own, 1e-300)) for each in (left[judged], at_rest))
        found.append(Transient(float(first / rate), begin / rate, float(end / rate), window, relative, quiet))
    return tuple(found)


def _events(level: Real, edge: float, width: int) -> list[tuple[int, int]]:
    """Return first and last sample of each motion above the edge; one that rises again is another one."""
    events: list[tuple[int, int]] = []
    first, lowest, highest = -1, 0, 0.0
    for k in range(0, level.size, max(1, width // 8)):
        value = level[k]
        if first < 0:
            first, lowest, highest = (k, k, value) if value > edge else (first, lowest, highest)
            continue
        highest = max(highest, value)
        lowest = k if value < level[lowest] or value == highest else lowest
        is_again = (
            value > _EVENTS.rise * level[lowest] and value > _EVENTS.min_peak and highest > _EVENTS.rise * level[lowest]
        )
        is_over = level[k : k + width].max() <= edge
        if is_over or is_again:
            events.append((first, int(lowest if is_again else k)))
            first, lowest, highest = (lowest, k, value) if is_again else (-1, 0, 0.0)
    return [*events, (first, level.size - 1)] if first >= 0 else events


def free_parts(recordings: Sequence[Recording], *, is_certain: bool = False) -> list[Recording]:
    """Return the parts of records in which motion is free; none where they are records of random motion.

    Parameters
    ----------
    recordings
        Channels of motion, without missing values or gaps.
    is_certain
        Whether the records are known to be of free motion; otherwise most of each must be quiet, or its level must fall
        from the beginning to the end.
    """
    parts = []
    for recording in recordings:
        level, window = motion_level(recording)
        blocks = np.array([np.mean(block) for block in np.array_split(level, 6)])
        falls = bool(np.all(np.diff(blocks) < 0)) and blocks[0] > _EVENTS.fall_of_record * blocks[-1]
        if not is_certain and np.mean(level < _EVENTS.quiet) < _EVENTS.min_quiet and not falls:
            return []
        found = find_transients(recording)
        if not 0 < len(found) <= _EVENTS.max_motions:
            return []
        rate = recording.sampling_rate
        longest = _EVENTS.max_windows * window
        free = sum(each.end - each.begin for each in found)
        if not is_certain and not falls and free < _EVENTS.min_share * recording.duration:
            return []
        for each in found:
            until = min(each.end, each.begin + longest) if not falls else recording.duration
            begin = 0.0 if each.onset == 0 else each.begin  # the record begins with free motion
            parts.append(recording.part(round(begin * rate), round(until * rate)))
    return parts


def _left_over(recording: Recording, begin: int, end: int, scale: Real, window: float) -> float:
    """Return what free modes leave of a part, over the scale of each channel."""
    part = Recording(recording.samples[:, begin:end] / scale, recording.sampling_rate, recording.channels)
    return unexplained(part, band=(0.0, _top(recording, window)), max_modes=_EVENTS.max_modes)


def _top(recording: Recording, window: float) -> float:
    """Return the highest frequency that is fitted [Hz]."""
    return float(min(_EVENTS.reach / window, 0.45 * recording.sampling_rate))


def _rms_up_to(samples: Real, top: float) -> float:
    """Return the RMS, root mean square over the channels, up to a frequency over the sampling rate."""
    n = samples.shape[1]
    lines = np.fft.rfft(samples, axis=1)[:, 1 : int(top * n) + 1] / n
    return float(np.sqrt(2 * np.mean(np.sum(np.abs(lines) ** 2, axis=1))))
