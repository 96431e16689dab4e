"""Modes of a structure measured in several set-ups of roving sensors, matched and glued."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np
from scipy import fft

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_each, freeze, settings_of
from sprung.errors import DataError, ParameterError
from sprung.identification.correlation import Correlations, exact_correlations
from sprung.identification.results import Identification, RovingSetups, SetUp
from sprung.identification.roving import Points, common_points
from sprung.identification.settings import IdentificationSettings
from sprung.identification.stabilisation import complete_shapes
from sprung.identification.steps import no_report
from sprung.modal import Modes, mac, unit_shapes
from sprung.recording import Recording, each_recording
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles.labels import labelled
from sprung.vehicles.sensor_layout import AnyVehicle, check_present, output_channels


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of matching modes over set-ups and of gluing their shapes."""

    #: Frequencies of one mode differ between set-ups by this share: temperature, the mass of the sensors.
    drift: float = 0.005
    #: They differ by up to this many standard deviations of their difference.
    deviations: float = 3.0
    #: 1 - MAC on the shared points at which modes of equal frequency are two.
    other_shape: float = 0.3
    #: Squared distance of two modes of one set-up: no mean over the modes of all set-ups comes below 1.
    other_mode: float = 1e12
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
    from scipy.cluster import hierarchy

    owners = np.concatenate([np.full(len(part), k) for k, part in enumerate(parts)]).astype(np.intp)
    places = np.concatenate([np.arange(len(part)) for part in parts]).astype(np.intp)
    if len(owners) < 2:
        groups = owners + 1
    else:
        condensed = _distances(parts, rows)[np.triu_indices(len(owners), 1)]
        groups = hierarchy.fcluster(hierarchy.linkage(condensed, "average"), 1.0, "distance").astype(np.intp)
    members = np.full((groups.max(initial=0), len(parts)), -1, dtype=np.intp)
    members[groups - 1, owners] = places
    return members[np.count_nonzero(members >= 0, axis=1) >= _RULES.min_share * len(parts)]


def _distances(parts: Sequence[Modes], rows: Sequence[Sequence[int]]) -> Real:
    """Return the squared distance of all modes of all set-ups from each other; beyond any mean within a set-up."""
    edges = np.cumsum([0, *(len(part) for part in parts)])
    distance = np.full((edges[-1], edges[-1]), _RULES.other_mode)
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


def glue(shapes: Sequence[Complex], rows: Sequence[Sequence[int]], *, n_points: int) -> GluedShape:
    """Glue the shapes of one mode in several set-ups by least squares over the points they share.

    Parameters
    ----------
    shapes
        Mode shape in each set-up, of any complex scale, shape (channels of the set-up,).
    rows
        Index of the point that each channel of each set-up measures; the set-ups are connected through shared points.
    n_points
        Number of points.

    Returns
    -------
    GluedShape

    Notes
    -----
    The sum of abs(shape_j,c - scale_j shape_c)^2 over shapes of 1 at their largest channel is minimised over all scales
    and the shape, in turn. The variance is that of linear least squares at the minimum, its scale the sum of squares
    that the shared points leave.

    References
    ----------
    C. Rainieri and G. Fabbrocino (2014), Operational Modal Analysis of Civil Engineering Structures, Springer, chapter
    4 (merging of set-ups after identification).
    """
    sizes = np.array([np.abs(shape).max() for shape in shapes])
    values = np.zeros((len(shapes), n_points), dtype=np.complex128)
    is_read = np.zeros(values.shape)
    for k, (shape, own) in enumerate(zip(shapes, rows, strict=True)):
        values[k, list(own)], is_read[k, list(own)] = shape / sizes[k], 1.0
    tiny = np.finfo(float).tiny
    scales, whole = _first_scales(values, is_read > 0), np.zeros(n_points, dtype=np.complex128)
    for _ in range(_RULES.max_sweeps):
        before = scales
        whole = scales.conj() @ values / np.maximum(np.abs(scales) ** 2 @ is_read, tiny)
        whole = whole / np.abs(whole).max()
        scales = values @ whole.conj() / np.maximum(is_read @ np.abs(whole) ** 2, tiny)
        if np.abs(scales - before).max() < _RULES.converged:
            break
    largest = int(np.argmax(np.abs(whole)))
    whole, scales = whole / whole[largest], scales * whole[largest]
    variance = _variance(values, is_read > 0, whole, scales)
    is_measured = is_read.any(axis=0)
    return GluedShape(np.where(is_measured, whole, np.nan), np.where(is_measured, variance, np.nan), scales * sizes)


def _first_scales(values: Complex, is_read: Booleans) -> Complex:
    """Return scales of the set-ups, each from those before it that share most of its motion."""
    scales = np.ones(len(values), dtype=np.complex128)
    joined, waiting = values[0].copy(), set(range(1, len(values)))
    while waiting:
        best = max(sorted(waiting), key=lambda k: np.abs(np.vdot(joined, values[k])))
        shared = (joined != 0) & is_read[best]
        power = np.sum(np.abs(joined[shared]) ** 2)
        scales[best] = (np.vdot(joined[shared], values[best, shared]) / power if power else 1.0) or 1.0
        joined = np.where(joined == 0, values[best] / scales[best], joined)
        waiting.remove(best)
    return scales


def _variance(values: Complex, is_read: Booleans, shape: Complex, scales: Complex) -> Real:
    """Return the variance of the shape at all points, the largest of which is held."""
    owners, points = np.nonzero(is_read)
    rows, n_points = np.arange(len(points)), len(shape)
    jacobian = np.zeros((len(points), n_points + len(scales)), dtype=np.complex128)
    jacobian[rows, points] = scales[owners]
    jacobian[rows, n_points + owners] = shape[points]
    free = np.setdiff1d(np.flatnonzero(np.any(jacobian != 0, axis=0)), [np.argmax(np.abs(shape))])
    reduced = jacobian[:, free]
    residual = values[is_read] - scales[owners] * shape[points]
    n_spare = len(points) - len(free)
    scatter = np.sum(np.abs(residual) ** 2) / n_spare if n_spare > 0 else np.nan
    inverse = np.linalg.pinv(reduced.conj().T @ reduced, hermitian=True)
    variance = np.zeros(n_points)
    is_point = free < n_points
    variance[free[is_point]] = scatter * np.diag(inverse).real[is_point]
    return variance


def identify_setups(
    identify: Callable[..., Identification],
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
    for number, setup in enumerate(setups, start=1):
        report(f"identifying set-up {number}", 0.0)
        records = setup if isinstance(setup, Recording | Sequence) else _noting(setup, measured)
        if records is setup:
            measured.update(dict.fromkeys(name for record in each_recording(setup) for name in record.names))
        try:
            identifications.append(identify(records, settings=own, vehicle=vehicle))
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

    def combined(estimates: Sequence[Real], deviations: Sequence[Real]) -> Real:
        return np.array([combine(*pair) for pair in zip(estimates, deviations, strict=True)]).reshape(-1, 2).T

    frequency, frequency_std = combined(values("natural_frequency"), values("natural_frequency_std"))
    ratios = values("damping_ratio")
    # A ratio that is low by chance has a low deviation (both as the root of the ratio), and would weigh too much.
    even = [std * np.sqrt(own.mean() / own) for own, std in zip(ratios, values("damping_ratio_std"), strict=True)]
    ratio, ratio_std = combined(ratios, even)
    return Modes(
        poles=2 * np.pi * frequency * (1j * np.sqrt(1 - ratio**2) - ratio),
        mode_shapes=np.array([shape.shape for shape in glued], dtype=complex).reshape(n_modes, len(points.channels)),
        channels=tuple(channel.name for channel in points.channels),
        natural_frequency_std=frequency_std,
        damping_ratio_std=ratio_std,
        stable_rate=np.array([rates.mean() for rates in values("stable_rate")]),
        labels=(None,) * n_modes,
    )


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
