"""One push, drop or release by linear modes or a swing with friction; springs and dampers from the modes found."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung.bounce_tests.results import RULES, BounceChange, BounceTest, CornerValue, relative_change
from sprung.errors import DataError, ParameterError
from sprung.identification.begins import fit_from_begins
from sprung.identification.free_response import FreeFit, fit_free_response
from sprung.identification.friction import FrictionFit, beyond_one_swing, correlated_samples, fit_friction
from sprung.identification.transients import Transient, motion_level, top_of_swings
from sprung.likelihood import corners_from_modes, rigid_layout
from sprung.likelihood.search import Differenced, least_squares
from sprung.modal import Modes, join_modes, mac, unit_shapes
from sprung.recording import Recording
from sprung.vehicles import Component, Vehicle, structure


def corners_of(fit: FreeFit, vehicle: Vehicle) -> tuple[tuple[CornerValue, ...], tuple[BounceChange, ...], list[str]]:
    """Return springs and dampers by generalised least squares to the modes of the body, left over right, and notes.

    Notes
    -----
    ln frequencies, ln damping ratios and shapes of the modes with their covariance, against those of the vehicle;
    Gauss-Newton from `corners_from_modes`, with the prior. Masses are those of the file: an error of the mass is one of
    all springs and dampers.
    """
    nominal = structure(vehicle, speed=0.0)
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
        return (), (), [f"springs and dampers are not estimated: {error}"]
    if start is None:
        return (), (), ["springs and dampers are not estimated: no mode of the body was found"]
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

    found = least_squares(Differenced(errors, np.clip(start, -2, 2)), gain=1e-9)
    dispersion = max(1.0, 2 * found.criterion / max(measured.size, 1))
    slopes = found.slopes()
    of_parts: Real = np.asarray(np.linalg.inv(slopes.T @ slopes) * dispersion, dtype=np.float64)
    stds = np.sqrt(np.diag(of_parts))
    values = zip(names, found.parameters, np.minimum(stds, priors), strict=True)
    notes = (
        []
        if dispersion < RULES.poor_fit
        else ["the modes do not fit the vehicle file well: springs and dampers are rough"]
    )
    corners = tuple(CornerValue(name, known[name], float(x), float(std)) for name, x, std in values)
    return corners, _left_over_right(names, found.parameters, of_parts), notes


def _left_over_right(names: tuple[Component, ...], logarithms: Real, covariance: Real) -> tuple[BounceChange, ...]:
    """Return how much each left spring and damper exceeds the right one, where the tests determine it.

    An error of the file's mass is common to both sides, so that their ratio is known better than either of them.
    """
    ratios = []
    for left, name in enumerate(names):
        right = names.index(Component(f"{name.axle}_right", name.kind)) if name.side == "left" else left
        if right == left or name.kind == "tyre":
            continue
        std = float(np.sqrt(covariance[left, left] + covariance[right, right] - 2 * covariance[left, right]))
        if std < RULES.max_std:
            size = float(logarithms[left] - logarithms[right])
            ratios.append(relative_change(f"{name.axle}.{name.kind}", "left_over_right", size, std))
    return tuple(ratios)


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


#: Derivative of displacement that a quantity measures; others are accelerations, unknown ones mostly travel.
_ORDERS = {"displacement": 0, "angle": 0, "strain": 0, "unknown": 0, "velocity": 1, "angular_velocity": 1}


def size_of(run: Recording, transient: Transient) -> float:
    """Return the range of the channel that moves most over that of the recording."""
    begin, end = (round(each * run.sampling_rate) for each in (transient.onset, transient.end))
    ranges = np.ptp(run.samples[:, begin:end], axis=1) / np.maximum(np.ptp(run.samples, axis=1), 1e-300)
    return float(np.max(ranges))


def tested(run: Recording, number: int, transient: Transient) -> BounceTest:
    """Return the test of one motion, by linear modes or with friction."""
    of_noise = max(RULES.nonlinear, RULES.tried_beyond_noise * transient.noise)
    is_linear = transient.unexplained < of_noise
    with_friction = None if is_linear else _with_friction(run, number, transient)
    if with_friction is None and transient.unexplained > max(RULES.hopeless, RULES.beyond_noise * transient.noise):
        raise DataError("it does not swing freely")
    free: tuple[Recording, FreeFit] | None = None
    if not is_linear and (with_friction is None or with_friction.residual > of_noise):
        try:
            free = _free(run, transient)
        except DataError:
            free = None
        beside = _beside_faster(run, number, transient, *free) if free is not None else None
        is_better = with_friction is None or (beside is not None and beside.residual < with_friction.residual)
        with_friction = beside if is_better else with_friction
    explains = free is not None and 1 - free[1].explained < of_noise**2
    if with_friction is not None and with_friction.is_significant and not explains:
        return with_friction
    try:
        linear = _linear(number, transient, *(free or _free(run, transient)))
    except DataError:
        if with_friction is None:
            raise
        return with_friction
    if is_linear and len(linear.modes) > 1:  # several modes imitate friction
        with_friction = _with_friction(run, number, transient)
        if with_friction is not None and not with_friction.is_significant:
            return linear
    if with_friction is None:
        return linear
    if is_linear or linear.residual < of_noise:
        return linear if _is_likelier(linear, with_friction) else with_friction
    is_simpler = len(linear.modes) <= len(with_friction.modes) and linear.residual < with_friction.residual
    return linear if is_simpler else with_friction


def _linear(number: int, transient: Transient, part: Recording, fit: FreeFit) -> BounceTest:
    """Return a test by the linear modes of its free part."""
    residual = float(np.sqrt(max(1 - fit.explained, 0.0)))
    if not len(fit.modes) or residual > _by_noise(RULES.max_linear_residual, transient):
        raise DataError("it does not swing freely")
    if fit.modes.damping_ratio.min() > RULES.max_damping:
        raise DataError("it returns without a swing")
    motion = fit.motion(0, np.arange(part.n_samples) / part.sampling_rate)
    motion = motion + np.mean(part.samples - motion, axis=1, keepdims=True)
    return BounceTest(number, transient, part, motion, fit.modes, (None,) * len(fit.modes), residual)


def _free(run: Recording, transient: Transient) -> tuple[Recording, FreeFit]:
    """Return the free part of a motion, and its linear modes."""
    part = run.part(*(round(each * run.sampling_rate) for each in (transient.begin, transient.end)))
    fit = fit_free_response(part, band=(0.0, top_of_swings(run, transient)), max_modes=RULES.max_modes)
    if not len(fit.modes):  # several that a short motion does not resolve: one, whose deviations hold the others
        fit = fit_free_response(part, band=(0.0, top_of_swings(run, transient)), max_modes=1)
    return part, fit


def _beside_faster(
    run: Recording, number: int, transient: Transient, part: Recording, fit: FreeFit
) -> BounceTest | None:
    """Return a test by swings with friction beside faster linear modes; None without any of both.

    Notes
    -----
    Linear modes imitate friction at the frequency of the swing and three times of it. What is faster and well
    determined is another mode: without its motion, a swing with friction describes the rest.
    """
    modes = fit.modes
    is_fast = modes.natural_frequency > RULES.faster * modes.natural_frequency.min(initial=np.inf)
    is_fast &= modes.damping_ratio_std < RULES.max_fast_deviation * modes.damping_ratio
    if not is_fast.any():
        return None
    fast = modes.take(np.flatnonzero(is_fast))
    time = np.arange(part.n_samples) / run.sampling_rate
    first, last = round(transient.begin * run.sampling_rate), round(transient.end * run.sampling_rate)
    motion = np.zeros(run.samples.shape)
    waves = fit.amplitudes[0][is_fast, None] * np.exp(np.outer(fast.poles, time))
    motion[:, first:last] = (fast.mode_shapes.T @ waves).real
    slower = Recording(run.samples - motion, run.sampling_rate, run.channels)
    window = motion_level(slower.part(first, last))[1]
    test = _with_friction(slower, number, replace(transient, onset=transient.begin, window=window))
    if test is None or not test.is_significant:
        return None
    begin = round(test.transient.begin * run.sampling_rate)
    part = run.part(begin, begin + test.part.n_samples)
    return replace(
        test,
        transient=replace(test.transient, onset=transient.onset, window=transient.window),
        part=part,
        fitted=test.fitted + motion[:, begin : begin + part.n_samples],
        modes=join_modes([test.modes, fast]),
        frictions=(*test.frictions, *(None,) * len(fast)),
    )


def _is_likelier(linear: BounceTest, with_friction: BounceTest) -> bool:
    """Return whether linear modes are likelier than swings with friction, by the Bayesian information criterion.

    Swings of single travels leave the others as they are.
    """
    n = min(linear.part.n_samples, with_friction.part.n_samples)
    left = [test.part.samples[:, -n:] - np.nan_to_num(test.fitted[:, -n:]) for test in (linear, with_friction)]
    powers = [np.sum((each - each.mean(axis=1, keepdims=True)) ** 2, axis=1) for each in left]
    n_free = n / correlated_samples(left[int(np.argmin([np.sum(np.log(power)) for power in powers]))])
    n_channels = len(left[0])
    n_more = len(linear.modes) * (2 + 2 * n_channels) - len(with_friction.modes) * 4 - n_channels
    gain = n_free / 2 * float(np.sum(np.log(powers[1] / powers[0])))
    return bool(gain > n_more / 2 * np.log(n_free * n_channels))


def _by_noise(limit: float, transient: Transient) -> float:
    """Return a limit of residuals over the motion, higher where noise explains more, as long as the motion is clear."""
    return max(limit, min(RULES.beyond_noise * transient.noise, RULES.max_noise))


def _with_friction(run: Recording, number: int, transient: Transient) -> BounceTest | None:
    """Return a test by swings with friction, of all channels or of single travels; None where none fits."""
    orders = {_ORDERS.get(channel.quantity, 2) for channel in run.channels}
    groups = [tuple(range(len(run.channels)))] if len(orders) == 1 else []
    groups += [(k,) for k in range(len(run.channels)) if orders == {0} and len(run.channels) > 1]
    found: list[tuple[tuple[int, ...], FrictionFit, int]] = []
    for group in groups:
        best = _swing(run, group, transient)
        if best is not None:
            found.append((group, *best))
            if len(group) == len(run.channels):
                break
    if not found:
        return None
    begin, end = min(first for _, _, first in found), round(transient.end * run.sampling_rate)
    part = run.part(begin, end)
    fitted = np.full(part.samples.shape, np.nan)
    n, shapes = len(found), np.zeros((len(found), len(run.channels)), dtype=np.complex128)
    for k, (group, fit, first) in enumerate(found):
        fitted[group, first - begin :] = fit.motion(np.arange(end - first) / run.sampling_rate)
        shapes[k, group] = fit.amplitudes
    f, xi = np.array([fit.equivalent[0] for _, fit, _ in found]).T
    f_std, xi_std = np.array([fit.equivalent[1] for _, fit, _ in found]).T
    poles = 2 * np.pi * f * (1j * np.sqrt(1 - xi**2) - xi)
    modes = Modes(poles, unit_shapes(shapes), run.names, f_std, xi_std, np.full(n, np.nan), (None,) * n)
    residual = float(np.mean([fit.residual for _, fit, _ in found]))
    transient = replace(transient, begin=begin / run.sampling_rate)
    return BounceTest(number, transient, part, fitted, modes, tuple(fit for _, fit, _ in found), residual)


def _swing(run: Recording, group: tuple[int, ...], transient: Transient) -> tuple[FrictionFit, int] | None:
    """Return the swing with friction of some channels, and its first sample; None where none describes them."""
    rate, window = run.sampling_rate, transient.window
    order = _ORDERS.get(run.channels[group[0]].quantity, 2)
    first, end = round(transient.onset * rate), round(transient.end * rate)
    samples = run.samples[list(group), first:end]
    strongest = int(np.argmax(np.std(samples, axis=1)))
    row, largest = group[strongest], samples[strongest]
    width = max(1, round(window * rate / 10))
    smooth = np.convolve(largest, np.ones(width) / width, mode="same")
    prominence = 0.1 * np.ptp(smooth)
    side = 1 if np.ptp([smooth.max(), smooth[-1]]) > np.ptp([smooth.min(), smooth[-1]]) else -1
    turns, others = (_peaks(sign * smooth, prominence) for sign in (side, -side))
    if first == 0 and side * largest[0] > 0.97 * np.max(side * largest):  # released where the record begins
        turns = np.concatenate([[0], turns])
    turns = turns[turns >= np.argmax(side * smooth)] if turns.size and turns[0] > 0 else turns
    stops = others[_at_stop(smooth[others], run.samples[row])] if order == 0 else others[:0]
    turns = turns[turns > stops.max(initial=-1)]
    best = None
    for turn in turns[: RULES.max_turns]:
        if end - first - turn < 1.2 * window * rate:
            break
        if beyond_one_swing(samples[:, turn:]) > RULES.max_residual:
            continue
        fit = fit_friction(samples[:, turn:], rate, frequency=1 / window, order=order)
        if fit.equivalent[0, 1] > RULES.max_swing_damping or fit.friction > RULES.max_swing_damping:
            continue
        if fit.equivalent[1, 1] > RULES.max_deviation * fit.equivalent[0, 1]:
            continue
        if fit.residual < RULES.max_residual:
            best = fit, first + int(turn)
        if fit.residual < RULES.good_residual:
            break
    return best


def _peaks(values: Real, prominence: float) -> Indices:
    """Return the maxima, or their middles, that rise and fall by a prominence from the minima on either side."""
    found: list[int] = []
    lowest, highest = np.inf, None
    for k, value in enumerate(values.tolist()):
        if highest is None:
            lowest = min(lowest, value)
            highest = k if value - lowest >= prominence else None
        elif value > values[highest]:
            highest = k
        elif values[highest] - value >= prominence:
            level = int(np.argmin(values[highest:] == values[highest]))
            found.append(highest + (level - 1) // 2)
            lowest, highest = value, None
    return np.array(found, dtype=np.intp)


def _at_stop(values: Real, samples: Real) -> Booleans:
    """Return which values of a channel are at an end of its range where it dwells: an end stop."""
    ends = np.array([samples.min(), samples.max()])
    reach = RULES.stop_range * np.ptp(ends)
    dwells = [np.mean(np.abs(samples - end) < reach) > RULES.stop_dwell for end in ends]
    return np.asarray(np.any((np.abs(values[:, None] - ends) < reach) & dwells, axis=1))


def fitted_together(tests: Sequence[BounceTest], runs: Sequence[Recording]) -> FreeFit | None:
    """Return the free responses of linear tests of the same channels, fitted together."""
    tests = [test for test in tests if test.part.channels == tests[0].part.channels]
    if not tests:
        return None
    band = 0.0, top_of_swings(runs[tests[0].recording], tests[0].transient)
    begins = [test.modes for test in tests]
    try:
        return fit_from_begins([(runs[test.recording], test.transient) for test in tests], band=band, begins=begins)
    except DataError:
        return fit_free_response([test.part for test in tests], band=band, begins=begins)


def pooled(tests: Sequence[BounceTest]) -> Modes:
    """Return the modes of tests with friction, those of the same channel averaged with the inverse variances."""
    modes = [test.modes.take(np.array([k])) for test in tests for k in range(len(test.modes))]
    groups: list[list[Modes]] = []
    for mode in modes:
        own = [
            group
            for group in groups
            if mac(group[0].mode_shapes, mode.mode_shapes)[0, 0] > 0.8
            and abs(np.log(mode.natural_frequency[0] / group[0].natural_frequency[0])) < np.log(RULES.faster)
        ]
        if not own:
            groups.append([])
        (own or groups)[-1].append(mode)
    pooled = []
    for group in groups:
        f, f_std = _weighted([float(mode.natural_frequency[0]) for mode in group], group, "natural_frequency_std")
        xi, xi_std = _weighted([float(mode.damping_ratio[0]) for mode in group], group, "damping_ratio_std")
        pole = 2 * np.pi * f * (1j * np.sqrt(1 - xi**2) - xi)
        pooled.append((pole, group[0].mode_shapes[0], f_std, xi_std))
    order = sorted(pooled, key=lambda each: abs(each[0]))
    poles, shapes, f_stds, xi_stds = (np.array(each) for each in zip(*order, strict=True))
    n = len(order)
    return Modes(poles, shapes, modes[0].channels, f_stds, xi_stds, np.full(n, np.nan), (None,) * n)


def _weighted(values: Sequence[float], group: Sequence[Modes], name: str) -> tuple[float, float]:
    """Return the mean with the inverse variances, and its standard deviation, at least that of the scatter."""
    stds = np.array([float(getattr(mode, name)[0]) for mode in group])
    weights = 1 / stds**2
    mean = float(np.average(values, weights=weights))
    scatter = float(np.average((np.array(values) - mean) ** 2, weights=weights)) / max(len(values) - 1, 1)
    return mean, float(np.sqrt(max(1 / weights.sum(), scatter)))
