"""Modes of free responses: of the motion after pushes, drops and releases."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung._threads import one_thread
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
    #: Share of the motion that starts explain at least, over that of the refined modes: noise hides modes from them.
    of_starts: float = 0.9
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
    #: Misfit around a mode from which it may be a mixture of several, in several records too.
    mixed_misfit: float = 1.25
    #: Normal quantile of misfits, beyond which chance does not explain them: that of 0.001.
    beyond_chance: float = 3.09
    #: Largest distance of a further mode, in ln of the frequency, that may be hidden beside another.
    nearby: float = 0.5
    #: Loss of the log likelihood below which two modes a damping ratio above and below one, in ln of the frequency, are
    #: about as likely as two close by: a single record does not resolve them. Deviation of ln of the damping then.
    resolved_by: float = 2.0
    unresolved_damping: float = 0.5
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
    unresolved
        Frequencies of the modes that may be two, and the distance below which these are not resolved [Hz].
    """

    modes: Modes
    amplitudes: Complex
    covariance: Real
    explained: float
    information_criterion: float
    has_forces: bool
    hidden: tuple[float, ...] = ()
    unresolved: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        freeze(self, amplitudes=2, dtype=np.complex128)
        freeze(self, covariance=2)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on modes that may be hidden or two, if any."""
        allowed = "which the stated deviations allow for"
        notes = []
        if self.unresolved:
            places = " and ".join(f"{distance:.2g} Hz apart at {f:.4g} Hz" for f, distance in self.unresolved)
            notes.append(f"modes less than {places} cannot be distinguished, {allowed}: push other corners too")
        if self.hidden:
            beside = " and ".join(f"{frequency:.4g}" for frequency in self.hidden)
            notes.append(f"another mode may hide beside {beside} Hz, {allowed}: add sensors elsewhere")
        return tuple(notes)

    def motion(self, record: int, time: Real) -> Real:
        """Return the fitted motion of one record at times [s] after its first sample, shape (channels, times)."""
        waves = self.amplitudes[record][:, None] * np.exp(self.modes.poles[:, None] * time)
        return np.asarray((self.modes.mode_shapes.T @ waves).real, dtype=np.float64)


@one_thread
def fit_free_response(
    recordings: Recording | Sequence[Recording],
    *,
    band: tuple[float, float] | None = None,
    max_modes: int | None = None,
    begins: Sequence[Modes] = (),
    least_explained: float = 0.0,
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
    least_explained
        Share of the power that free modes have to explain by least squares, 0 to 1; default: any.

    Returns
    -------
    FreeFit
        Fit of the number of modes that the Bayesian information criterion prefers, without those that remain unclear.

    Raises
    ------
    DataError
        If the records are too short, no channel moves, or free modes explain less than demanded.

    Notes
    -----
    Starting values by least squares with rising numbers of modes (`FreePoles`), each from a realisation
    (`realised_poles`) or from the fit before and a further pole; the nearest are refined to the largest likelihood
    (`FreeResponse`). Variances are multiplied by the power of the residuals around each mode, over that of the model,
    where it is above 1, corrected for the number of parameters, and hold a further mode that may be hidden nearby.
    Where neither free modes nor random forces during the motion explain it, they hold the difference of both.

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
    if starts and all(_explained(start) < _FIT.of_starts * least_explained for start in starts):
        raise DataError(f"free modes explain less than {100 * least_explained:.0f} % of the motion in these records")
    nearest = sorted(starts, key=lambda start: start.criterion)[: 1 if begins else _FIT.n_refined]
    best = min(map(_refined, nearest), key=lambda fitted: fitted.criterion, default=None)
    if best is None:
        raise DataError("no motion swings freely in these records: give the part after the push, or a wider band")
    free = best = _pruned(best)
    forced: list[_Fitted] = []
    if np.any(_misfits(best) > np.maximum(_FIT.forced_misfit, _by_chance(best))):
        forced = _forced(lines, realised)
        best = min([free, *forced], key=lambda fitted: fitted.criterion)
    doubts = _doubts(best)
    if forced and _misfits(best).max() > _FIT.forced_misfit:
        rival = min(forced, key=lambda fitted: fitted.criterion) if best is free else free
        doubts = np.sqrt(doubts**2 + _moved(best, rival)[0] ** 2 / _variances(best))
    return _result(best, doubts, _unresolved(best, was_forced=bool(forced)), channels=runs[0].names)


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


def _pruned(fitted: _Fitted) -> _Fitted:
    """Return the fit without modes that the criterion does not want, least squares having taken noise for them."""
    model, n = fitted.model, fitted.model.modal.n_modes
    values, fewer = model.modal.unpacked(fitted.parameters), []
    for k in range(n if n > 1 else 0):
        kept = np.delete(np.arange(n), k)
        begin = replace(
            values,
            natural_frequency=values.natural_frequency[kept],
            damping_ratio=values.damping_ratio[kept],
            force_exponents=values.force_exponents[kept],
            mode_shapes=values.mode_shapes[kept],
            forces=values.forces[np.ix_(kept, kept)],
        )
        less = replace(model, begin=begin)
        fewer.append(_Fitted(less, less.start))
    best = min(fewer, key=lambda each: each.criterion, default=fitted)
    return _pruned(_refined(best)) if best.criterion < fitted.criterion else fitted


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
    """Return the power of the residuals around each mode over that of the model, shape (modes,)."""
    powers, expected, everywhere = _around(fitted)
    return np.maximum(powers / expected, everywhere)


def _by_chance(fitted: _Fitted) -> Real:
    """Return the largest misfit around each mode that chance explains, shape (modes,)."""
    return np.asarray(1 + _FIT.beyond_chance / np.sqrt(_around(fitted)[1]))


def _around(fitted: _Fitted) -> tuple[Real, Real, float]:
    """Return the power of the residuals around each mode, that by the model, (modes,), and one over the other of all.

    Notes
    -----
    Around a mode the fitted mean takes more of the noise than elsewhere: residuals are judged by what it leaves.
    """
    model, fit = fitted.model, fitted.model.fitted(fitted.parameters)
    values, powers = fit.values, np.abs(fit.whitened) ** 2
    expected = 1 - model.leverages(fitted.parameters)
    everywhere = expected.size / max(np.sum(expected), expected.size / 4)
    around = np.empty((2, model.modal.n_modes))
    for k, (f, xi) in enumerate(zip(values.natural_frequency, values.damping_ratio, strict=True)):
        distance = np.abs(model.data.frequencies - f)
        reach = max(_FIT.judged_widths * f * xi, np.partition(distance, min(7, distance.size - 1))[7 % distance.size])
        near = distance <= reach
        around[:, k] = np.sum(powers[near]), max(np.sum(expected[near]), expected[near].size / 4)
    return around[0], around[1], everywhere


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
    poles = (
        FreePoles(model.data, poles_of(model.fitted(fitted.parameters).values))
        .with_another(nearer=_FIT.nearby)
        .refined()
    )
    start = _started(model.data, poles.poles, unit_shapes(poles.mode_shapes))
    if start is None:
        return np.ones((2, n))
    other = _refined(start)
    gain = model.objective(fitted.parameters)[0] - other.model.objective(other.parameters)[0]
    n_more = other.parameters.size - fitted.parameters.size + 2 * model.data.n_records
    weight = 1 / (1 + np.exp(np.clip(n_more / 2 - gain, -50, 50)))
    moved, nearest = _moved(fitted, other)
    further = np.diag(_covariance(other))[: 2 * n + 2].reshape(2, n + 1)[:, nearest]
    ratios = (further + moved**2) / _variances(fitted)
    return np.asarray(np.sqrt(np.maximum(1, 1 + weight * (ratios - 1))))


def _moved(fitted: _Fitted, other: _Fitted) -> tuple[Real, Indices]:
    """Return changes of ln frequency and damping ratio to the nearest modes of another fit, (2, modes), and these."""
    values = [each.model.modal.unpacked(each.parameters) for each in (fitted, other)]
    logarithms = [np.log([each.natural_frequency, each.damping_ratio]) for each in values]
    differences = logarithms[1][:, None, :] - logarithms[0][:, :, None]
    nearest = np.argmin(np.sum(np.abs(differences), axis=0), axis=1)
    return differences[:, np.arange(len(nearest)), nearest], nearest


def _variances(fitted: _Fitted) -> Real:
    """Return the variances of ln frequencies and damping ratios, inf where they are unknown, shape (2, modes)."""
    variances = np.diag(_covariance(fitted))[: 2 * fitted.model.modal.n_modes].reshape(2, -1)
    return np.where(variances > 0, variances, np.inf)


def _unresolved(fitted: _Fitted, *, was_forced: bool) -> Real:
    """Return up to which distance each mode may as well be two, in damping ratios above and below it, 0 to 1, (modes,).

    Notes
    -----
    A mode of a single record, one that does not explain the motion around it, or one beside a mode that is not clear,
    may be two where these are as likely a damping ratio away as close by. Where free modes do not explain the motion
    and random forces are tried, one with a misfit is a mixture: the loss of likelihood, over the misfit
    (quasi-likelihood) and as the square of the distance, bounds how far apart the two may be.
    """
    data, values = fitted.model.data, fitted.model.modal.unpacked(fitted.parameters)
    poles, f, xi = poles_of(values), values.natural_frequency, values.damping_ratio
    distances, misfits, is_clear = np.zeros(poles.size), _misfits(fitted), _are_clear(fitted)
    mixed_from = np.maximum(_FIT.mixed_misfit, np.where(was_forced, 0.0, _by_chance(fitted)))
    reach = np.maximum(xi * f, data.frequencies.min())
    for k in range(poles.size):
        is_mixed = bool(misfits[k] > mixed_from[k])
        is_beside = bool(np.any(~is_clear & (np.abs(f - f[k]) < reach + xi[k] * f[k])))
        if is_mixed or is_beside or (data.n_records == 1 and not fitted.model.has_forces):
            pairs = (np.append(np.delete(poles, k), poles[k] * np.exp(d * np.array([-xi[k], xi[k]]))) for d in (1, 0.1))
            far, near = (FreePoles(data, pair).criterion for pair in pairs)
            if far - near < _FIT.resolved_by:
                distances[k] = 1.0
            elif is_mixed and was_forced:
                distances[k] = min(1.0, np.sqrt(_FIT.resolved_by * misfits[k] / (far - near)))
    return distances


def _are_clear(fitted: _Fitted) -> Booleans:
    """Return which modes the records determine, shape (modes,)."""
    xi, variances = fitted.model.modal.unpacked(fitted.parameters).damping_ratio, _variances(fitted)
    most = np.stack([_FIT.max_deviation * xi, np.full(xi.size, _FIT.max_deviation)])
    return np.all(variances < most**2, axis=0) & (xi < _FIT.max_damping)


def _covariance(fitted: _Fitted) -> Real:
    """Return the covariance of ln frequencies, ln damping ratios and free parts of the shapes, misfits included."""
    model, parameters = fitted.model, fitted.parameters
    covariance = np.linalg.inv(model.information(parameters) + np.diag(1 / model.prior_std**2))
    chosen = _rows_of_modes(model)
    factors = np.sqrt(_misfits(fitted))[_mode_of_each(model)]
    return np.asarray(covariance[np.ix_(chosen, chosen)] * np.outer(factors, factors))


def _explained(fitted: _Fitted) -> float:
    """Return the share of the power that the modes explain, as in `FreeFit`."""
    data = fitted.model.data
    every = np.arange(data.n_records)[:, None] == data.records
    residuals = fitted.model.fitted(fitted.parameters).residuals
    left, whole = (every @ np.abs(each) ** 2 for each in (residuals, data.values))
    return float(1 - np.max(np.min(left / whole, axis=1)))


def _rows_of_modes(model: FreeResponse) -> Indices:
    """Return the numbers of the parameters that are ln frequencies, ln damping ratios and free parts of the shapes."""
    return np.concatenate([model.modal.rows[name] for name in ("natural_frequency", "damping_ratio", "mode_shapes")])


def _mode_of_each(model: FreeResponse) -> Indices:
    """Return the number of the mode of each row of `_covariance`."""
    return np.concatenate(
        [np.tile(np.arange(model.modal.n_modes), 2), np.repeat(np.nonzero(model.modal.is_free)[0], 2)]
    )


def _result(fitted: _Fitted, doubts: Real, unresolved: Real, *, channels: tuple[str, ...]) -> FreeFit:
    """Return the clear modes of a fit."""
    model, parameters = fitted.model, fitted.parameters
    fit, n = model.fitted(parameters), model.modal.n_modes
    values = fit.values
    f, xi, poles = values.natural_frequency, values.damping_ratio, poles_of(values)
    of_mode = _mode_of_each(model)
    covariance = _covariance(fitted)
    spread = np.stack([xi, np.full(n, _FIT.unresolved_damping)]) * unresolved
    hidden = (doubts.max(axis=0) > _FIT.doubled) & (unresolved == 0)
    doubts = np.sqrt(doubts**2 + spread**2 / np.maximum(np.diag(covariance)[: 2 * n].reshape(2, n), 1e-300))
    factors = np.concatenate([doubts.ravel(), doubts.max(axis=0)[of_mode[2 * n :]]])
    covariance = covariance * np.outer(factors, factors)
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
    is_known = (stds[:n] < _FIT.max_deviation) | (model.data.n_records == 1)  # of one, a rough mode is better than none
    is_clear = _are_clear(fitted) & is_known
    kept = order[is_clear[order]]
    rows = np.concatenate([kept, n + kept, *(np.flatnonzero(of_mode[2 * n :] == k) + 2 * n for k in kept)])
    return FreeFit(
        modes=modes.take(kept),
        amplitudes=amplitudes[:, kept],
        covariance=covariance[np.ix_(rows, rows)],
        explained=_explained(fitted),
        information_criterion=fitted.criterion,
        has_forces=model.has_forces,
        hidden=tuple(float(f[k]) for k in kept if hidden[k]),
        unresolved=tuple((float(f[k]), float(2 * unresolved[k] * xi[k] * f[k])) for k in kept if unresolved[k]),
    )
