"""Modes of a structure measured in several set-ups of roving sensors, matched and glued."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import Protocol

import numpy as np
from scipy import fft

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_each, freeze, settings_of
from sprung.errors import DataError, ParameterError
from sprung.identification.contribution import complete_shapes
from sprung.identification.correlation import Correlations, exact_correlations
from sprung.identification.results import Identification, RovingSetups, SetUp
from sprung.identification.roving import Points, common_points
from sprung.identification.settings import IdentificationSettings
from sprung.identification.steps import no_report
from sprung.modal import Modes, mac, unit_shapes
from sprung.recording import Recording, each_recording
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles.labels import labelled
from sprung.vehicles.sensor_layout import check_present
from sprung.vehicles.usable import AnyVehicle, output_channels


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of matching modes over set-ups and of gluing their shapes."""

    #: Frequencies of one mode differ between set-ups by this share: temperature, the mass of the sensors.
    drift: float = 0.005
    #: They differ by up to this many standard deviations of their difference.
    deviations: float = 3.0
    #: 1 - MAC on the shared points at which modes of equal frequency are two.
    other_shape: float = 0.3
    #: Least share of the set-ups that show a mode.
    min_share: float = 0.5
    #: Most sweeps of least squares over scales and shape.
    max_sweeps: int = 500
    #: Change of the scales that ends them.
    converged: float = 1e-12
    #: Share of a spectral segment up to which its correlations are used: the window leaves more than half of them.
    used_share: float = 0.25


_RULES = _Rules()


def match_modes(parts: Sequence[Modes], rows: Sequence[Sequence[int]]) -> Indices:
    """Match the modes of several set-ups.

    Parameters
    ----------
    parts
        Modes of each set-up.
    rows
        Index of the point that each channel of each set-up measures.

    Returns
    -------
    numpy.ndarray
        Index of the set-up's mode for each matched mode and set-up, -1 for none; shape (modes, set-ups). Modes that
        fewer than half of the set-ups show are left out.

    Notes
    -----
    Agglomeration with average linkage on the squared distance (f - f')^2 / (9 (s^2 + s'^2 + (0.005 f)^2))
    + ((1 - MAC) / 0.3)^2, up to 1; two modes of one set-up are never the same. The MAC is that on the points that both
    set-ups measure; with a single shared point it carries no information.
    """
    owners = np.concatenate([np.full(len(part), k) for k, part in enumerate(parts)]).astype(np.intp)
    places = np.concatenate([np.arange(len(part)) for part in parts]).astype(np.intp)
    groups = [[k] for k in range(len(owners))]
    distance = _distances(parts, rows)
    while len(groups) > 1:
        closest = np.unravel_index(np.argmin(distance), distance.shape)
        if distance[closest] > 1:
            break
        kept, gone = sorted(int(k) for k in closest)
        sizes = len(groups[kept]), len(groups[gone])
        mean = (sizes[0] * distance[kept] + sizes[1] * distance[gone]) / sum(sizes)
        mean[kept] = np.inf
        distance[kept], distance[:, kept] = mean, mean
        distance = np.delete(np.delete(distance, gone, axis=0), gone, axis=1)
        groups[kept] += groups.pop(gone)
    members = np.full((len(groups), len(parts)), -1, dtype=np.intp)
    for row, group in enumerate(groups):
        members[row, owners[group]] = places[group]
    return members[np.count_nonzero(members >= 0, axis=1) >= _RULES.min_share * len(parts)]


def _distances(parts: Sequence[Modes], rows: Sequence[Sequence[int]]) -> Real:
    """Return the squared distance of all modes of all set-ups from each other; infinite within a set-up."""
    edges = np.cumsum([0, *(len(part) for part in parts)])
    distance = np.full((edges[-1], edges[-1]), np.inf)
    for i, part in enumerate(parts):
        for j in range(i):
            other = parts[j]
            shared = sorted(set(rows[i]) & set(rows[j]))
            own, others = ([list(rows[k]).index(point) for point in shared] for k in (i, j))
            frequency, same = part.natural_frequency[:, None], other.natural_frequency
            variance = np.nan_to_num(part.natural_frequency_std[:, None]) ** 2
            variance = variance + np.nan_to_num(other.natural_frequency_std) ** 2 + (_RULES.drift * frequency) ** 2
            squared = (frequency - same) ** 2 / (_RULES.deviations**2 * variance)
            if shared:
                likeness = mac(part.mode_shapes[:, own], other.mode_shapes[:, others])
                squared = squared + ((1 - likeness) / _RULES.other_shape) ** 2
            block = slice(edges[i], edges[i + 1]), slice(edges[j], edges[j + 1])
            distance[block], distance[block[::-1]] = squared, squared.T
    return distance


def combine(values: Real, deviations: Real) -> tuple[float, float]:
    """Return the mean of several estimates of one number, and its standard deviation.

    Parameters
    ----------
    values, deviations
        Estimates and their standard deviations, shape (estimates,); NaN for an unknown deviation.

    Notes
    -----
    Weights 1 / (s^2 + t^2) with the variance t^2 between the estimates by moments: where they scatter more than their
    deviations explain, the mean is less certain, and precise estimates weigh less. Where a deviation is unknown, all
    weigh the same and the scatter alone counts.

    References
    ----------
    R. DerSimonian and N. Laird (1986), Meta-analysis in clinical trials, Controlled Clinical Trials 7, 177-188.
    """
    n = len(values)
    if not np.all(np.isfinite(deviations) & (deviations > 0)):
        scatter = float(values.std(ddof=1)) / np.sqrt(n) if n > 1 else float(deviations[0])
        return float(values.mean()), scatter
    weights = deviations**-2.0
    mean = np.sum(weights * values) / weights.sum()
    excess = np.sum(weights * (values - mean) ** 2) - (n - 1)
    between = max(0.0, excess / (weights.sum() - np.sum(weights**2) / weights.sum())) if n > 1 else 0.0
    weights = 1 / (deviations**2 + between)
    return float(np.sum(weights * values) / weights.sum()), float(weights.sum() ** -0.5)


@dataclass(frozen=True, eq=False, slots=True)
class GluedShape:
    """One mode shape on all points of several set-ups.

    Parameters
    ----------
    shape
        Mode shape, 1 at its largest point, shape (points,); NaN at a point of which no set-up shows the mode.
    variance
        Variance of `shape` (of real and imaginary part together), shape (points,); 0 at its largest point, NaN where
        the set-ups share too few points to show their scatter.
    scales
        Factor by which `shape` becomes that of each set-up, shape (set-ups,).
    """

    shape: Complex
    variance: Real
    scales: Complex

    def __post_init__(self) -> None:
        freeze(self, shape=1, scales=1, dtype=np.complex128)
        freeze(self, variance=1)


def glue(
    shapes: Sequence[Complex],
    rows: Sequence[Sequence[int]],
    *,
    n_points: int,
    variances: Sequence[Real] | None = None,
) -> GluedShape:
    """Glue the shapes of one mode in several set-ups by least squares over the points they share.

    Parameters
    ----------
    shapes
        Mode shape in each set-up, of any complex scale, shape (channels of the set-up,).
    rows
        Index of the point that each channel of each set-up measures; the set-ups are connected through shared points.
    n_points
        Number of points.
    variances
        Variance of each shape, shape (channels of the set-up,); None: unknown, the same for all shapes scaled to 1 at
        their largest channel.

    Returns
    -------
    GluedShape

    Notes
    -----
    The weighted sum of abs(shape_j,c - scale_j shape_c)^2 is minimised over all scales and the shape, in turn. The
    variance is that of linear least squares at the minimum; the sum of squares that the shared points leave gives its
    scale where the variances are unknown, and increases it where it is more than they explain.

    References
    ----------
    C. Rainieri and G. Fabbrocino (2014), Operational Modal Analysis of Civil Engineering Structures, Springer, chapter
    4 (merging of set-ups after identification).
    """
    sizes = np.array([np.abs(shape).max() for shape in shapes])
    readings = _Readings(
        values=np.concatenate([shape / size for shape, size in zip(shapes, sizes, strict=True)]),
        weights=np.concatenate(
            [np.ones(len(own)) for own in rows]
            if variances is None
            else [size**2 / known for known, size in zip(variances, sizes, strict=True)]
        ),
        points=np.concatenate([np.asarray(own, dtype=np.intp) for own in rows]),
        owners=np.concatenate([np.full(len(own), k, dtype=np.intp) for k, own in enumerate(rows)]),
    )
    scales = _first_scales(readings, len(shapes))
    shape = np.zeros(n_points, dtype=complex)
    for _ in range(_RULES.max_sweeps):
        before = scales
        shape = _ratios(readings, scales[readings.owners], readings.points, n_points)
        shape = shape / np.abs(shape).max()
        scales = _ratios(readings, shape[readings.points], readings.owners, len(shapes))
        if np.abs(scales - before).max() < _RULES.converged:
            break
    largest = int(np.argmax(np.abs(shape)))
    shape, scales = shape / shape[largest], scales * shape[largest]
    variance = _variance(readings, shape, scales, is_known=variances is not None)
    is_measured = np.isin(np.arange(n_points), readings.points)
    return GluedShape(np.where(is_measured, shape, np.nan), np.where(is_measured, variance, np.nan), scales * sizes)


@dataclass(frozen=True, eq=False, slots=True)
class _Readings:
    """Shapes of all set-ups in a row: values with their weights, and the point and the set-up of each."""

    values: Complex
    weights: Real
    points: Indices
    owners: Indices


def _ratios(readings: _Readings, factors: Complex, groups: Indices, n_groups: int) -> Complex:
    """Return for each group the number that times `factors` is nearest to its values; 0 for an empty group."""
    products = readings.weights * factors.conj() * readings.values
    real, imaginary, power = (
        np.bincount(groups, part, n_groups)
        for part in (products.real, products.imag, readings.weights * np.abs(factors) ** 2)
    )
    return np.asarray((real + 1j * imaginary) / np.maximum(power, np.finfo(float).tiny))


def _first_scales(readings: _Readings, n_setups: int) -> Complex:
    """Return scales of the set-ups, each from those before it that share most of its motion."""
    motion = np.zeros((n_setups, readings.points.max() + 1), dtype=complex)
    motion[readings.owners, readings.points] = readings.values
    scales = np.zeros(n_setups, dtype=complex)
    scales[0], joined = 1.0, motion[0].copy()
    waiting = set(range(1, n_setups))
    while waiting:
        strength = {k: np.abs(np.vdot(joined, motion[k])) for k in waiting}
        best = max(sorted(waiting), key=lambda k: strength[k])
        shared = (joined != 0) & (motion[best] != 0)
        power = np.sum(np.abs(joined[shared]) ** 2)
        scales[best] = np.vdot(joined[shared], motion[best, shared]) / power if power else 1.0
        scales[best] = scales[best] if scales[best] else 1.0
        joined = np.where(joined == 0, motion[best] / scales[best], joined)
        waiting.remove(best)
    return scales


def _variance(readings: _Readings, shape: Complex, scales: Complex, *, is_known: bool) -> Real:
    """Return the variance of the shape at all points, the largest of which is held."""
    n_points, n_values = len(shape), len(readings.values)
    jacobian = np.zeros((n_values, n_points + len(scales)), dtype=complex)
    jacobian[np.arange(n_values), readings.points] = scales[readings.owners]
    jacobian[np.arange(n_values), n_points + readings.owners] = shape[readings.points]
    free = np.setdiff1d(np.flatnonzero(np.any(jacobian != 0, axis=0)), [np.argmax(np.abs(shape))])
    reduced = np.sqrt(readings.weights)[:, None] * jacobian[:, free]
    residual = readings.values - scales[readings.owners] * shape[readings.points]
    n_spare = n_values - len(free)
    scatter = np.sum(readings.weights * np.abs(residual) ** 2) / n_spare if n_spare > 0 else np.nan
    inverse = np.linalg.pinv(reduced.conj().T @ reduced, hermitian=True)
    variance = np.zeros(n_points)
    is_point = free < n_points
    variance[free[is_point]] = (np.fmax(scatter, 1.0) if is_known else scatter) * np.diag(inverse).real[is_point]
    return variance


class Identify(Protocol):
    """Function that identifies the modes of one condition: `cov_ssi`, `acs_ssi` or `coss_ssi`."""

    def __call__(
        self,
        recordings: Recording | Iterable[Recording],
        *,
        settings: IdentificationSettings | None = None,
        vehicle: AnyVehicle | None = None,
        on_progress: Callable[[str, float], None] | None = None,
    ) -> Identification:
        """Return the modes of one condition."""


def identify_setups(
    identify: Identify,
    setups: Iterable[Recording | Iterable[Recording]],
    *,
    references: Sequence[str] | None = None,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Identification:
    """Identify the modes of several set-ups of roving sensors and merge them.

    Parameters
    ----------
    identify
        Method that identifies each set-up by itself: `cov_ssi`, `acs_ssi` or `coss_ssi`.
    setups
        Record, or records, of each set-up. An iterator is read once, one set-up at a time.
    references
        Names of the channels that stay in place in all set-ups; all others have moved, also where names repeat. None:
        channels of one name are one point unless their positions or directions differ.
    settings
        Settings of the identification of each set-up; its `references` are those of the correlations. Each set-up may
        lack sensors of the vehicle file; with `allow_missing`, all of them may.
    vehicle
        As for `cov_ssi`.
    on_progress
        Function called with the current step in words and the share that is done, 0 to 1.

    Returns
    -------
    Identification
        Modes on the points of all set-ups, which are in `setups`. Spectra are those of the references, plan and
        sampling rate those of the first set-up.

    Raises
    ------
    DataError
        If no set-up is usable. One bad set-up of several is left out, with a note.
    ParameterError
        If set-ups do not share channels, all have the same channels and no references are given, all lack a sensor of
        the vehicle file, or a setting does not suit the records.

    Notes
    -----
    Modes of the set-ups are matched by frequency and by MAC on the shared points, and kept where at least half of the
    set-ups show them; in the others their shape is the least-squares fit of the correlations with all merged modes.
    Shapes are glued over the shared points by least squares, so that set-ups may be excited at any level; their
    standard deviations are from the scatter between the set-ups, NaN where these share too few points to show it.
    Frequencies and damping ratios are means weighted by their variance and the scatter between the set-ups.

    References
    ----------
    E. Reynders, F. Magalhaes, G. De Roeck and A. Cunha (2009), Merging strategies for multi-setup operational modal
    analysis: application to the Luiz I steel arch bridge, Proceedings of the 27th International Modal Analysis
    Conference (PoSER: post separate estimation re-scaling).

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain(4)
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> front, rear = run.select(run.names[:3]), run.select((*run.names[:2], run.names[3]))
    >>> merged = identify_setups(cov_ssi, [front, rear])
    >>> len(merged.channels), len(merged.modes)
    (4, 4)
    >>> np.allclose(merged.modes.natural_frequency, masses.modes().natural_frequency, rtol=0.01)
    True
    """
    report, settings = on_progress or no_report, settings_of(IdentificationSettings, settings)
    if not callable(identify):
        raise ParameterError("identify must be the method for each set-up: pass sprung.cov_ssi, then the set-ups")
    if isinstance(setups, Recording | str) or not isinstance(setups, Iterable):
        check_each("setups", setups, Recording)
    sensors = () if vehicle is None or settings.allow_missing else vehicle.sensor
    if isinstance(setups, Sequence):
        for setup in setups:
            each_recording(setup)
        _check_channels(setups, references, vehicle)
    measured: dict[str, None] = {}
    own = replace(settings, allow_missing=True)
    identifications: list[Identification] = []
    numbers: list[int] = []
    left_out: dict[int, DataError] = {}
    for number, records in enumerate(setups, start=1):
        report(f"identifying set-up {number}", 0.0)
        try:
            identifications.append(identify(_noted(records, measured), settings=own, vehicle=vehicle))
            numbers.append(number)
        except DataError as error:
            left_out[number] = error
    if not identifications:
        raise next(iter(left_out.values()), DataError("there is no set-up to identify modes from: give at least two"))
    if len(identifications) == 1:
        reason = f": set-up {next(iter(left_out))} {next(iter(left_out.values()))}" if left_out else ""
        raise ParameterError(f"modes of roving sensors need at least two usable set-ups, got 1{reason}")
    check_present(tuple(measured), sensors)
    report("merging the set-ups", 1.0)
    points = common_points([identification.channels for identification in identifications], references=references)
    notes = [f"set-up {number} left out: {error}" for number, error in left_out.items()]
    return _merged(identifications, points, numbers, vehicle=vehicle, notes=notes)


def _noted(records: Recording | Iterable[Recording], measured: dict[str, None]) -> Recording | Iterable[Recording]:
    """Return the records of a set-up; the names of their channels are put into `measured` as they are read."""
    if not isinstance(records, Recording | Sequence):
        return _noting(records, measured)
    for _ in _noting([records] if isinstance(records, Recording) else records, measured):
        pass
    return records


def _noting(records: Iterable[Recording], measured: dict[str, None]) -> Iterator[Recording]:
    """Yield records and put the names of their channels into `measured`."""
    for record in records:
        measured.update(dict.fromkeys(record.names))
        yield record


def _check_channels(
    setups: Sequence[Recording | Iterable[Recording]], references: Sequence[str] | None, vehicle: AnyVehicle | None
) -> None:
    """Reject set-ups that cannot be merged before the first is identified, where that shows."""
    records = [[setup] if isinstance(setup, Recording) else setup for setup in setups]
    firsts = [own[0] for own in records if isinstance(own, Sequence) and own]
    layouts = [[record.channels[record.index(name)] for name in output_channels(record, vehicle)] for record in firsts]
    if len(layouts) == len(setups) > 1:
        common_points(layouts, references=references)


def _merged(
    identifications: Sequence[Identification],
    points: Points,
    numbers: Sequence[int],
    *,
    vehicle: AnyVehicle | None,
    notes: Sequence[str],
) -> Identification:
    """Return the merged identification."""
    first = identifications[0]
    parts = [identification.modes for identification in identifications]
    members = match_modes(parts, points.rows)
    glued = []
    for row in members:
        showing = np.flatnonzero(row >= 0).tolist()
        shapes = [parts[k].mode_shapes[row[k]] for k in showing]
        glued.append(glue(shapes, [points.rows[k] for k in showing], n_points=len(points.channels)))
    modes = _modes(parts, members, glued, points)
    order = np.argsort(modes.natural_frequency)
    modes, members, glued = modes.take(order), members[order], [glued[k] for k in order]
    if np.any(members < 0):
        modes, glued = _completed(identifications, points, members, modes)
    deviations = np.array([(1 + 1j) * np.sqrt(shape.variance / 2) for shape in glued], dtype=complex)
    modes = replace(modes, mode_shape_std=deviations.reshape(modes.mode_shapes.shape))
    parts_of_result = tuple(
        SetUp(
            number=number,
            channels=tuple(points.channels[row].name for row in rows),
            identification=identification,
            members=members[:, k],
            mac=_likeness(identification.modes, members[:, k], modes.mode_shapes[:, list(rows)]),
        )
        for k, (number, rows, identification) in enumerate(zip(numbers, points.rows, identifications, strict=True))
    )
    return replace(
        first,
        channels=points.channels,
        modes=labelled(modes, points.channels, vehicle=vehicle),
        subsets=(),
        members=np.zeros((len(modes), 0), dtype=np.intp),
        harmonics=_harmonics(identifications),
        spectra=_reference_spectra([x.spectra for x in identifications], points),
        edited_spectra=None,
        refinement=None,
        sources=(),
        level_trends=None,
        notes=(*notes, *_notes(identifications, points, members, numbers)),
        setups=RovingSetups(references=points.references, parts=parts_of_result),
    )


def _modes(parts: Sequence[Modes], members: Indices, glued: Sequence[GluedShape], points: Points) -> Modes:
    """Return the merged modes with frequency and damping combined over the set-ups."""
    n_modes, showing = len(members), [np.flatnonzero(row >= 0).tolist() for row in members]

    def values(name: str) -> list[Real]:
        return [
            np.array([getattr(parts[k], name)[row[k]] for k in own]) for row, own in zip(members, showing, strict=True)
        ]

    frequency, frequency_std = _combined(values("natural_frequency"), values("natural_frequency_std"))
    ratios = values("damping_ratio")
    # A ratio that is low by chance has a low deviation (both as the root of the ratio), and would weigh too much.
    even = [std * np.sqrt(own.mean() / own) for own, std in zip(ratios, values("damping_ratio_std"), strict=True)]
    ratio, ratio_std = _combined(ratios, even)
    return Modes(
        poles=2 * np.pi * frequency * (1j * np.sqrt(1 - ratio**2) - ratio),
        mode_shapes=np.array([shape.shape for shape in glued], dtype=complex).reshape(n_modes, len(points.channels)),
        channels=tuple(channel.name for channel in points.channels),
        natural_frequency_std=frequency_std,
        damping_ratio_std=ratio_std,
        stable_rate=np.array([rates.mean() for rates in values("stable_rate")]),
        labels=(None,) * n_modes,
    )


def _combined(values: Sequence[Real], deviations: Sequence[Real]) -> tuple[Real, Real]:
    """Return means and standard deviations of the estimates of several modes."""
    pairs = [combine(*pair) for pair in zip(values, deviations, strict=True)]
    mean, std = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
    return mean, std


def _completed(
    identifications: Sequence[Identification], points: Points, members: Indices, modes: Modes
) -> tuple[Modes, list[GluedShape]]:
    """Return modes and shapes with those of set-ups that do not show a mode, fitted to their correlations."""
    shapes = [[np.zeros(0, dtype=complex)] * len(identifications) for _ in range(len(modes))]
    for k, (identification, rows) in enumerate(zip(identifications, points.rows, strict=True)):
        own = identification.modes
        fitted = _fitted_shapes(identification, modes, members[:, k], list(rows)) if np.any(members[:, k] < 0) else None
        for mode, member in enumerate(members[:, k]):
            if member >= 0:
                shapes[mode][k] = own.mode_shapes[member]
            elif fitted is not None:
                shapes[mode][k] = fitted[mode]
    glued = [glue(own, points.rows, n_points=len(points.channels)) for own in shapes]
    return replace(modes, mode_shapes=unit_shapes(np.array([shape.shape for shape in glued]))), glued


def _fitted_shapes(identification: Identification, modes: Modes, members: Indices, rows: list[int]) -> Complex:
    """Return the shapes of all modes in one set-up by least squares of its correlations, some of them unknown."""
    known = [
        column for column, point in enumerate(rows) if np.all(np.isfinite(modes.mode_shapes[:, point]))
    ]  # measured in a set-up that shows the mode
    correlations = correlations_of(identification.spectra)
    names = [correlations.channels[column] for column in known]
    shapes = modes.mode_shapes[:, [rows[column] for column in known]]
    return complete_shapes(modes.poles, shapes, correlations, names)


def correlations_of(spectra: SpectralMatrix) -> Correlations:
    """Return the correlations at short lags that belong to averaged spectra, without the effect of their window.

    Notes
    -----
    The expectation of an averaged periodogram is the transform of the correlations times the window's own correlation.
    """
    matrix = spectra.matrix.copy()
    n_samples = 2 * (matrix.shape[-1] - 1)
    rate = 2 * spectra.frequencies[-1]
    matrix[..., 1:-1] /= 2
    lagged = fft.irfft(matrix, n_samples, axis=-1) * rate
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_samples) / n_samples)
    n_lags = int(_RULES.used_share * n_samples)
    own = fft.irfft(np.abs(fft.rfft(window, 2 * n_samples)) ** 2)[:n_lags] / np.sum(window**2)
    return exact_correlations(
        lagged[..., :n_lags] / own, sampling_rate=rate, channels=spectra.names, references=spectra.names
    )


def _likeness(own: Modes, members: Indices, merged: Complex) -> Real:
    """Return the MAC of each merged mode with the set-up's own, NaN where it has none."""
    values = np.full(len(members), np.nan)
    for mode in np.flatnonzero(members >= 0):
        values[mode] = mac(own.mode_shapes[[members[mode]]], merged[[mode]])[0, 0]
    return values


def _reference_spectra(spectra: Sequence[SpectralMatrix], points: Points) -> SpectralMatrix:
    """Return the spectra of the references, averaged over the set-ups with the same frequencies as the first."""
    rows = [list(own) for own in points.rows]
    names = [channel.name for channel in points.channels]
    in_all = [name for name in points.references if all(names.index(name) in own for own in rows)]
    shown = [names.index(name) for name in in_all] or rows[0]
    picked = []
    for matrix, own in zip(spectra, rows, strict=True):
        if in_all or matrix is spectra[0]:
            columns = [own.index(row) for row in shown]
            picked.append(
                replace(matrix, matrix=matrix.matrix[np.ix_(columns, columns)], names=tuple(names[r] for r in shown))
            )
    alike = [matrix for matrix in picked if np.array_equal(matrix.frequencies, picked[0].frequencies)]
    return reduce(add, alike)


def _harmonics(identifications: Sequence[Identification]) -> tuple[Harmonic, ...]:
    """Return the lines of all set-ups, each as in the first set-up that has it."""
    lines: list[Harmonic] = []
    for identification in identifications:
        for line in identification.harmonics:
            same = (
                line.kind == known.kind and abs(line.frequency - known.frequency) <= line.resolution for known in lines
            )
            if not any(same):
                lines.append(line)
    return tuple(sorted(lines, key=lambda line: (line.kind, line.frequency)))


def _notes(
    identifications: Sequence[Identification], points: Points, members: Indices, numbers: Sequence[int]
) -> list[str]:
    """Return notes on the set-ups, on modes that some lack, and the notes of each set-up once."""
    n_setups = len(identifications)
    notes = [
        f"{n_setups} set-ups over references {', '.join(points.references)}, identified one by one; their mode shapes"
        " are glued over the references"
    ]
    if not len(members):
        notes.append("no mode was found in half of the set-ups or more: look at each set-up by itself")
    if np.any(members < 0):
        notes.append(
            f"{np.count_nonzero(np.any(members < 0, axis=1))} of {len(members)} modes were not found in every set-up:"
            " there their shape is fitted to the correlations"
        )
    low, high = np.array([identification.band for identification in identifications]).T
    notes.append(f"band of the set-ups: {low.min():.3g} to {high.max():.3g} Hz")
    said: dict[str, list[int]] = {}
    for number, identification in zip(numbers, identifications, strict=True):
        for note in identification.notes:
            if note not in identification.plan.preparation.notes[:1]:  # the band
                said.setdefault(note, []).append(number)
    for note, which in said.items():
        where = "" if len(which) == n_setups else f"set-up {', '.join(map(str, which))}: "
        notes.append(where + note)
    return notes
