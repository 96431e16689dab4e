"""Fits of modes in bands of frequency to the spectra of records."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.identification.correlation import deviation_of_mean
from sprung.identification.settings import Plan
from sprung.likelihood.hermitian import real_form
from sprung.likelihood.modal import ModalModel, ModalParameters
from sprung.likelihood.modal_spectra import LineSpectra, LineSums, block_sums, line_edges, line_sums
from sprung.likelihood.search import scored
from sprung.modal import Modes, unit_shapes
from sprung.recording import Channel, Recording


@dataclass(frozen=True, slots=True)
class BandRules:
    """Rules of the spectra of records, and of the fits of modes in bands of them."""

    #: Spectra begin at this share of the lowest mode that is resolved, as peaks reach below it.
    lowest: float = 0.5
    #: Spectra end at this share of the sampling rate, where decimation passes everything.
    highest: float = 0.4
    #: Duration of a stretch over the segments of its Welch spectra: one line of the stretch for each bin.
    spectrum_segments: float = 24.0
    #: Width of the bins of blocks over their frequency: scores need no finer ones.
    block_width: float = 0.004
    #: Most blocks of a record, of which a scatter is well known.
    max_blocks: int = 48
    #: Fewest blocks, if they are large, and fewest whose scatter counts.
    min_blocks: int = 8
    #: Most entries of the matrices of all blocks, about 50 MB.
    max_entries: float = 3e6
    #: Bands around the modes in half-power half-widths, widest first: the widest in which the model fits is used.
    reaches: tuple[float, ...] = (np.inf, 30.0, 12.0)
    #: Lowest frequency of a band over that of its lowest mode. Far below it accelerations fall with the square of the
    #: frequency, because restoring forces cancel the forces. A delay between the two falls with the frequency alone:
    #: forces held over samples act half a sample later on the motion than in the accelerations: not in the model.
    lowest_of_mode: float = 0.6
    #: Most modes that are fitted together: the time rises with the fourth power.
    max_together: int = 5
    #: Width of the bins over the half-width of the nearest mode: its curve is smooth over a fifth.
    bin_of_width: float = 1 / 5
    #: Width of the bins over the distance from the nearest mode.
    bin_of_distance: float = 1 / 8
    #: Bins on which the fit is judged together.
    judged_bins: int = 4
    #: A model fits below this deviation, in standard deviations of chance (true models: -0.6, scattering by 0.8).
    beyond_chance: float = 1.0
    #: A wide band is given up where scoring ends above this deviation: searches after it lower it to a quarter at most.
    hopeless: float = 300.0
    #: Largest damping ratio of a pole that oscillates.
    max_damping: float = 0.99
    #: Up to this number of channels modes are fitted to all of them ...
    few_channels: int = 6
    #: ... with more, in the space of their shapes and of this many further coordinates.
    more_coordinates: int = 2
    #: Smallest density of noise at the start over the largest of the spectra, so that matrices stay positive definite.
    min_noise: float = 1e-9
    #: Most steps by least squares to the first spectra of forces and noise.
    max_linear_steps: int = 8
    #: Change of ln noise that ends them.
    small_step: float = 0.3
    #: Fewest lines of a block in a mode's half-width whose scatter counts.
    min_lines: float = 2.0
    #: Standard deviations beyond chance from which the scatter counts.
    scatter_beyond_chance: float = 1.0


_RULES = BandRules()
#: Power of frequency from displacement to each quantity; quantities that are not stated are mostly accelerations.
_EXPONENTS = {"displacement": 0.0, "angle": 0.0, "strain": 0.0, "velocity": 1.0, "angular_velocity": 1.0}
_USUAL_EXPONENT = 2.0


@dataclass(frozen=True, eq=False, slots=True)
class RecordSpectra:
    """Spectra from which modes are refined: of whole records, and of blocks of them for their scatter.

    Parameters
    ----------
    lines
        Sums over all stretches.
    blocks
        Sums over each block.
    records
        Number of the record of each block, shape (blocks,).
    sampling_rate
        Sampling rate of the records before decimation [Hz].
    """

    lines: LineSums
    blocks: tuple[LineSums, ...]
    records: Indices
    sampling_rate: float

    def __post_init__(self) -> None:
        freeze(self, records=1, dtype=np.intp)

    def __add__(self, other: "RecordSpectra") -> "RecordSpectra":
        """Add a record; where there are too many blocks, neighbours are joined."""
        blocks = [*self.blocks, *other.blocks]
        records = np.concatenate([self.records, other.records + self.records.max(initial=-1) + 1])
        joined = replace(self, lines=self.lines + other.lines, blocks=tuple(blocks), records=records)
        return joined.with_fewer_blocks()

    def scaled(self, factors: Real) -> "RecordSpectra":
        """Return the spectra of channels multiplied by factors, shape (channels,)."""
        blocks = tuple(block.scaled(factors) for block in self.blocks)
        return replace(self, lines=self.lines.scaled(factors), blocks=blocks)

    def with_fewer_blocks(self) -> "RecordSpectra":
        """Return the spectra with at most as many blocks as the size of their matrices allows."""
        blocks, records = list(self.blocks), self.records
        if not blocks:
            return self
        most = int(np.clip(_RULES.max_entries / blocks[0].matrices.size, _RULES.min_blocks, _RULES.max_blocks))
        while len(blocks) > most:
            pairs = [blocks[k : k + 2] for k in range(0, len(blocks), 2)]
            blocks = [pair[0] + pair[1] if len(pair) == 2 else pair[0] for pair in pairs]
            records = records[::2]
        return replace(self, blocks=tuple(blocks), records=records)


def record_spectra(motion: Recording, plan: Plan) -> RecordSpectra:
    """Return the spectra of one prepared record for the refinement of modes.

    Parameters
    ----------
    motion
        Prepared record.
    plan
        Decisions of the identification; all records of one plan have the same bins.
    """
    low = _RULES.lowest * plan.mode_band[0]
    high = max(_RULES.highest * plan.preparation.decimate_to, 2 * low)
    duration = _RULES.spectrum_segments * plan.preparation.spectrum_segment
    block = max(2 * plan.segment, plan.preparation.spectrum_segment)
    edges = line_edges(low, high, duration=block, relative_width=_RULES.block_width)
    blocks = block_sums(motion, edges, duration=block)
    lines = line_sums(motion, line_edges(low, high, duration=duration))
    numbers = np.zeros(len(blocks), dtype=np.intp)
    return RecordSpectra(lines, tuple(blocks), numbers, plan.preparation.sampling_rate).with_fewer_blocks()


@dataclass(frozen=True, eq=False, slots=True)
class BandFit:
    """Fit of the modes in one band.

    Parameters
    ----------
    band
        Lowest and highest frequency [Hz].
    modes
        Numbers of the modes that are fitted together.
    is_converged
        Whether the search ended at a maximum of the likelihood.
    misfit_before, misfit
        Mean square of the whitened deviation of the measured spectra from the model over that by chance, before and
        after the search: 1 for a model that is true.
    misfit_excess
        Deviation of `misfit` from 1 in standard deviations of chance.
    """

    band: tuple[float, float]
    modes: tuple[int, ...]
    is_converged: bool
    misfit_before: float
    misfit: float
    misfit_excess: float

    @property
    def fits(self) -> bool:
        """Whether the deviation of the spectra from the model is within chance."""
        return self.misfit_excess < _RULES.beyond_chance


@dataclass(frozen=True, eq=False, slots=True)
class _Coordinates:
    """Combinations of the channels that hold the modes of a band, and the way back.

    Parameters
    ----------
    forward
        Coordinates of one unit of each channel, shape (coordinates, channels).
    back
        Channels of one unit of each coordinate, shape (channels, coordinates).
    rest
        Matrix from channels to orthonormal combinations of channels that hold noise alone, shape (rest, channels), and
        the way back, shape (channels, rest).
    exponents
        Powers of frequency, relative to the mean, by which the channels' quantities differ, shape (channels,).
    """

    forward: Complex
    back: Complex
    rest: tuple[Complex, Complex]
    exponents: Real

    def spectra(self, spectra: LineSpectra) -> LineSpectra:
        """Return spectra of the coordinates."""
        return replace(spectra, matrices=self.forward @ spectra.matrices @ self.forward.conj().T)


@dataclass(frozen=True, eq=False, slots=True)
class Observed:
    """Spectra without lines of the excitation, their channels, and the sampling rate before decimation [Hz]."""

    spectra: LineSpectra
    channels: tuple[Channel, ...]
    sampling_rate: float


@dataclass(frozen=True, eq=False, slots=True)
class FittedBand:
    """Maximum of the likelihood in one band, and the tilted spectra of all channels behind it."""

    model: ModalModel
    parameters: Real
    modes: Indices
    band: BandFit
    coordinates: _Coordinates
    spectra: LineSpectra


def fits_of_bands(modes: Modes, observed: Observed, *, is_refinable: Booleans) -> list[FittedBand]:
    """Return the fits of all bands, each in the widest band in which the model fits.

    Parameters
    ----------
    modes
        Modes at which the searches start.
    observed
        Spectra without lines of the excitation.
    is_refinable
        Mask of the modes of interest, shape (modes,): bands without any are not fitted.
    """
    half_widths = modes.damping_ratio * modes.natural_frequency
    pending, fits = np.arange(len(modes)), []
    for reach in _RULES.reaches:
        left = []
        for group in _overlapping(modes.natural_frequency, reach * half_widths, pending):
            is_last = reach == _RULES.reaches[-1]
            if not is_refinable[group].any():
                continue
            for part in np.array_split(group, -(-len(group) // _RULES.max_together)) if is_last else [group]:
                fit = None if len(part) > _RULES.max_together else _fit(modes, part, reach, observed)
                if fit is not None and (is_last or fit.band.fits):
                    fits.append(fit)
                else:
                    left.append(part)
        pending = np.concatenate([np.zeros(0, dtype=np.intp), *left])
    return fits


def _overlapping(frequencies: Real, reaches: Real, chosen: Indices) -> list[Indices]:
    """Return the chosen modes in groups whose bands overlap."""
    ends = np.maximum.accumulate((frequencies + reaches)[chosen])
    return np.split(chosen, 1 + np.flatnonzero((frequencies - reaches)[chosen[1:]] > ends[:-1]))


def _fit(modes: Modes, chosen: Indices, reach: float, observed: Observed) -> FittedBand | None:
    """Return the fit of some modes in the band around them, their neighbours held near their values; None without."""
    frequencies, half_widths = modes.natural_frequency, modes.damping_ratio * modes.natural_frequency
    low = np.min(frequencies[chosen] - reach * half_widths[chosen])
    high = np.max(frequencies[chosen] + reach * half_widths[chosen])
    low = max(low, _RULES.lowest_of_mode * frequencies[chosen[0]])
    data, channels = observed.spectra, observed.channels
    inside = data.take((low <= data.frequencies) & (data.frequencies <= high))
    if not inside.frequencies.size:
        return None
    joined = inside.joined(_bins(inside.frequencies, frequencies, half_widths))
    neighbours = [k for k in (chosen[0] - 1, chosen[-1] + 1) if 0 <= k < len(modes)]
    together = np.concatenate([chosen, np.array(neighbours, dtype=np.intp)])
    together_modes = modes.take(together)
    tilted, coordinates = _coordinates(together_modes, joined, channels)
    try:
        model = _started(together_modes, tilted, coordinates, channels)
        model = replace(model, n_held=len(neighbours), sampling_rate=observed.sampling_rate)
        if 2 * model.start.size > joined.counts.size * model.n_channels**2:
            return None
        is_vain = None if reach == _RULES.reaches[-1] else partial(_is_hopeless, model)
        parameters, is_converged = scored(model, model.start, is_vain=is_vain)
        misfit, excess = _misfit(model, parameters)
    except np.linalg.LinAlgError:
        return None
    band = BandFit(
        band=(float(joined.frequencies[0]), float(joined.frequencies[-1])),
        modes=tuple(int(k) for k in chosen),
        is_converged=is_converged,
        misfit_before=_misfit(model, model.start)[0],
        misfit=misfit,
        misfit_excess=excess,
    )
    return FittedBand(model, parameters, chosen, band, coordinates, tilted)


def _coordinates(modes: Modes, spectra: LineSpectra, channels: Sequence[Channel]) -> tuple[LineSpectra, _Coordinates]:
    """Return the spectra as if all channels had one quantity, and the coordinates in which the modes are fitted.

    Notes
    -----
    With many channels: the channels over the square roots of their noise, projected on the space of the shapes and of
    the largest remaining motion. The rest holds noise alone, and what the shapes have there follows by regression.
    """
    exponents = _exponents(channels) - _exponents(channels).mean()
    tilted = spectra.tilted(-exponents)
    n_channels, n_kept = len(channels), len(modes) + _RULES.more_coordinates
    if n_channels <= max(n_kept, _RULES.few_channels):
        nothing = np.zeros((0, n_channels), dtype=np.complex128)
        unit = np.eye(n_channels, dtype=np.complex128)
        return tilted, _Coordinates(unit, unit, (nothing, nothing.T), exponents)
    noise = np.sqrt(_least_densities(tilted))
    shapes = (_tilted_shapes(modes, tilted.middle, -exponents) / noise).T
    basis = np.linalg.qr(shapes)[0]
    relative = tilted.matrices / np.outer(noise, noise)
    mean = np.mean(relative / np.einsum("bii->b", relative)[:, None, None], axis=0)
    beyond = np.eye(n_channels) - basis @ basis.conj().T
    directions = np.linalg.eigh(beyond @ mean @ beyond.conj().T)[1][:, ::-1]
    basis = np.linalg.qr(np.hstack([basis, directions[:, : n_kept - len(modes)]]), mode="complete")[0]
    kept, rest = basis[:, :n_kept], basis[:, n_kept:]
    return tilted, _Coordinates(
        forward=np.asarray(kept.conj().T / noise, dtype=np.complex128),
        back=np.asarray(noise[:, None] * kept, dtype=np.complex128),
        rest=(
            np.asarray(rest.conj().T / noise, dtype=np.complex128),
            np.asarray(noise[:, None] * rest, dtype=np.complex128),
        ),
        exponents=exponents,
    )


def _least_densities(spectra: LineSpectra) -> Real:
    """Return a low quantile of the densities of each channel, at least a trace of the largest one."""
    densities = np.einsum("bii->bi", spectra.matrices).real
    return np.asarray(np.maximum(np.quantile(densities, 0.1, axis=0), _RULES.min_noise * densities.max(axis=0)))


def _tilted_shapes(modes: Modes, middle: float, exponents: Real) -> Complex:
    """Return the mode shapes as if the channels had other quantities."""
    return np.asarray(modes.mode_shapes * (modes.natural_frequency[:, None] / middle) ** exponents)


def _bins(frequencies: Real, peaks: Real, half_widths: Real) -> Indices:
    """Return the number of the wider bin of each bin: narrow against the peaks, wider away from them."""
    distances = np.abs(frequencies[:, None] - peaks)
    widths = np.min(np.maximum(_RULES.bin_of_width * half_widths, _RULES.bin_of_distance * distances), axis=1)
    steps = np.diff(frequencies, prepend=frequencies[0]) / np.minimum(widths, frequencies / 4)
    return np.unique(np.floor(np.cumsum(steps)), return_inverse=True)[1]


def _exponents(channels: Sequence[Channel]) -> Real:
    """Return the power of frequency from displacement to the quantity of each channel."""
    return np.array([_EXPONENTS.get(channel.quantity, _USUAL_EXPONENT) for channel in channels])


def _started(modes: Modes, tilted: LineSpectra, coordinates: _Coordinates, channels: Sequence[Channel]) -> ModalModel:
    """Return the model that starts at the modes, with the force and noise spectra that fit best."""
    exponent = float(_exponents(channels).mean())
    spectra = coordinates.spectra(tilted)
    shapes = unit_shapes(_tilted_shapes(modes, tilted.middle, -coordinates.exponents) @ coordinates.forward.T)
    is_whole = len(spectra.matrices[0]) == len(channels)
    power = np.empty(len(modes))
    for k, (frequency, damping) in enumerate(zip(modes.natural_frequency, modes.damping_ratio, strict=True)):
        nearest = np.argsort(np.abs(spectra.frequencies - frequency))[:5]
        peak = np.average(spectra.matrices[nearest], axis=0, weights=spectra.counts[nearest])
        x = spectra.frequencies[nearest].mean() / frequency
        response = x**exponent / np.abs(1 - x**2 + 2j * damping * x)
        power[k] = (shapes[k].conj() @ peak @ shapes[k]).real / (np.sum(np.abs(shapes[k]) ** 2) * response) ** 2
    begin = ModalParameters(
        natural_frequency=modes.natural_frequency,
        damping_ratio=modes.damping_ratio,
        common_exponent=np.zeros(1),
        force_exponents=np.zeros(len(modes)),
        mode_shapes=shapes,
        forces=np.diag(power).astype(np.complex128),
        noise=_least_densities(spectra) / 2,
        noise_exponents=-2 * coordinates.exponents if is_whole else np.zeros(spectra.matrices.shape[-1]),
    )
    model = ModalModel(spectra, begin, exponent)
    for _ in range(_RULES.max_linear_steps):
        before = model.begin.noise
        model = replace(model, begin=_with_linear_step(model))
        if np.max(np.abs(np.log(model.begin.noise / before))) < _RULES.small_step:
            break
    return model


def _with_linear_step(model: ModalModel) -> ModalParameters:
    """Return the parameters of a model with force and noise spectra by weighted least squares."""
    start = model.start
    rows = np.concatenate([model.rows["forces"], model.rows["noise"]])
    slopes = model.whitened_densities(start).reshape(-1, len(rows))
    residuals = real_form(model.residuals(start)) * np.sqrt(model.spectra.counts)
    step = np.linalg.lstsq(slopes.T @ slopes, residuals.ravel() @ slopes, rcond=1e-12)[0]
    n_forces, moved = model.n_modes**2, start.copy()
    moved[rows[:n_forces]] += step[:n_forces]
    moved[rows[n_forces:]] += np.log(np.clip(1 + step[n_forces:], 0.1, 10.0))
    values = model.unpacked(moved)
    scale = np.outer(model.scale, model.scale)
    powers, directions = np.linalg.eigh(values.forces / scale)
    powers = np.maximum(powers, 1e-3 * powers.max())
    return replace(values, forces=(directions * powers) @ directions.conj().T * scale)


def _misfit(model: ModalModel, parameters: Real) -> tuple[float, float]:
    """Return the mean square of the deviation of the spectra over that by chance, and its excess in deviations."""
    counts, size = model.spectra.counts, model.n_channels**2
    starts = np.arange(0, counts.size, _RULES.judged_bins)
    n = np.add.reduceat(counts, starts)
    deviations = np.add.reduceat(counts[:, None, None] * model.residuals(parameters), starts) / n[:, None, None]
    total = float(np.sum(n * np.sum(np.abs(deviations) ** 2, axis=(1, 2))))
    degrees = max(n.size * size - parameters.size, n.size * size / 2)
    variance = float(np.sum(2 * size * (1 + 3 * model.n_channels / n)))
    return total / degrees, (total - degrees) / np.sqrt(variance)


def _is_hopeless(model: ModalModel, parameters: Real) -> bool:
    return _misfit(model, parameters)[1] > _RULES.hopeless


def refined_modes(fit: FittedBand, modes: Modes, spectra: RecordSpectra) -> Modes:
    """Return the modes of a fit, with standard deviations.

    Parameters
    ----------
    fit
        Maximum of the likelihood in one band.
    modes
        Modes at which the search started, of all bands.
    spectra
        Spectra of the records, with those of blocks.

    Notes
    -----
    The variances are multiplied by the misfit of the band where it is above 1, as spectra that deviate from the model
    move its parameters too, or by the scatter of the blocks where that is more.

    References
    ----------
    P. McCullagh and J. A. Nelder, Generalized Linear Models, 2nd edition, Chapman and Hall, 1989, section 9.2
    (dispersion of quasi-likelihood).
    """
    model, n = fit.model, len(fit.modes)
    values = model.unpacked(fit.parameters)
    information = model.information(fit.parameters) + np.diag(1 / model.prior_std**2)
    covariance: Real = np.asarray(np.linalg.inv(information), dtype=np.float64)
    scatter = _scatter(fit, covariance, spectra)
    dispersion = max(fit.band.misfit, 1.0)
    deviations = np.sqrt(np.diag(covariance) * np.maximum(scatter, dispersion))
    covariance *= dispersion
    rest, variances = _rest_of_shapes(fit)
    coordinates = fit.coordinates
    shapes, shape_stds = [], []
    f, xi = values.natural_frequency[:n], np.minimum(values.damping_ratio[:n], _RULES.max_damping)
    for k in range(n):
        tilt = (f[k] / fit.spectra.middle) ** coordinates.exponents
        shape = tilt * (coordinates.back @ values.mode_shapes[k] + coordinates.rest[1] @ rest[k])
        normalised = _normalising(shape) * tilt
        within = _as_real(normalised @ coordinates.back)
        beyond = normalised @ coordinates.rest[1]
        variance = np.einsum("ij,jk,ik->i", within, model.shape_covariance(k, covariance), within).reshape(-1, 2)
        variance = variance + (np.sum(np.abs(beyond) ** 2 * variances[k], axis=1) / 2)[:, None]
        stds = np.sqrt(np.maximum(variance, 0.0))
        stds[np.argmax(np.abs(shape))] = 0.0
        shapes.append(shape)
        shape_stds.append(stds[:, 0] + 1j * stds[:, 1])
    return replace(
        modes.take(fit.modes),
        poles=2 * np.pi * f * (1j * np.sqrt(1 - xi**2) - xi),
        mode_shapes=unit_shapes(np.array(shapes)),
        natural_frequency_std=f * deviations[model.rows["natural_frequency"][:n]],
        damping_ratio_std=xi * deviations[model.rows["damping_ratio"][:n]],
        mode_shape_std=np.array(shape_stds),
    )


def _rest_of_shapes(fit: FittedBand) -> tuple[Complex, Real]:
    """Return the shapes in the combinations of channels beyond the coordinates, and their variances.

    Notes
    -----
    The cross spectra of the rest with the coordinates are the shapes times those of the modal motions: weighted least
    squares with the inverse of the coordinates' spectral matrix and the rest's own densities.
    """
    model, (forward, _) = fit.model, fit.coordinates.rest
    forced = model.forced(fit.parameters)
    weighted = model.spectra.counts[:, None, None] * np.linalg.inv(model.matrix(fit.parameters))
    weighted = weighted @ forced.conj().swapaxes(-1, -2)
    inverse = np.linalg.inv(np.sum(forced @ weighted, axis=0))
    cross = forward @ fit.spectra.matrices @ fit.coordinates.forward.conj().T
    shapes = np.sum(cross @ weighted, axis=0) @ inverse
    densities = np.einsum("ri,bij,rj->br", forward, fit.spectra.matrices, forward.conj()).real
    noise = np.average(densities, axis=0, weights=model.spectra.counts) if forward.size else np.zeros(0)
    return np.asarray(shapes.T), np.outer(np.diag(inverse).real, noise)


def _normalising(shape: Complex) -> Complex:
    """Return the derivative of a shape over its largest channel, d(s_i / s_j) = (ds_i - (s_i / s_j) ds_j) / s_j."""
    largest = int(np.argmax(np.abs(shape)))
    slopes = np.eye(len(shape), dtype=np.complex128)
    slopes[:, largest] -= shape / shape[largest]
    return slopes / shape[largest]


def _as_real(matrix: Complex) -> Real:
    """Return the matrix that acts on real and imaginary parts in turn as a complex one does."""
    real = np.kron(matrix.real, np.eye(2)) + np.kron(matrix.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))
    return np.asarray(real, dtype=np.float64)


def _scatter(fit: FittedBand, covariance: Real, spectra: RecordSpectra) -> Real:
    """Return the variance of the parameters by the scatter of the blocks' scores over that of the model, at least 1.

    Notes
    -----
    The influence of a block is the covariance times its score; the sum over the blocks has the variance of the
    sandwich. It counts where it is beyond chance.
    """
    n_blocks = len(spectra.blocks)
    ones = np.ones(len(covariance))
    values = fit.model.unpacked(fit.parameters)
    half_widths = values.natural_frequency * values.damping_ratio
    if n_blocks < _RULES.min_blocks or spectra.blocks[0].longest * half_widths.max() < _RULES.min_lines:
        return ones
    n_lines = np.array([block.moments[0] for block in spectra.blocks])
    total = np.sum(n_lines, axis=0)
    edges = spectra.blocks[0].edges
    centres = (edges[1:] + edges[:-1]) / 2
    used = np.flatnonzero((total > 0) & (fit.band.band[0] <= centres) & (centres <= fit.band.band[1]))
    if used.size < 4:
        return ones
    groups = _bins(centres[used], values.natural_frequency, half_widths)
    mean = LineSpectra(
        centres[used],
        np.zeros(used.size),
        total[used],
        sum(block.matrices[used] for block in spectra.blocks) / total[used, None, None],
    )
    coordinates = fit.coordinates
    joined = mean.joined(groups).tilted(-coordinates.exponents, middle=fit.spectra.middle)
    model = replace(fit.model, spectra=coordinates.spectra(joined))
    inverse = np.linalg.inv(np.linalg.cholesky(model.matrix(fit.parameters)))
    slopes = model.whitened_derivatives(fit.parameters) / np.sqrt(joined.counts)[:, None]
    slopes = slopes.reshape(-1, fit.parameters.size)
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    tilt = (joined.frequencies[:, None] / fit.spectra.middle) ** -coordinates.exponents
    inverse = inverse @ (coordinates.forward * tilt[:, None, :])
    scores = []
    for block, lines in zip(spectra.blocks, n_lines, strict=True):
        sums = np.add.reduceat(block.matrices[used], starts)
        counts = np.add.reduceat(lines[used], starts)
        deviation = inverse @ sums @ inverse.conj().swapaxes(-1, -2) - counts[:, None, None] * np.eye(model.n_channels)
        scores.append(real_form(deviation).ravel() @ slopes)
    influences = np.array(scores) @ covariance
    centred = (influences - influences.mean(axis=0)) * np.sqrt(n_blocks / (n_blocks - 1))
    variances = deviation_of_mean(centred, spectra.records) ** 2
    ratios = variances / np.diag(covariance)
    counts_for_it = ratios > 1 + _RULES.scatter_beyond_chance * np.sqrt(2 / n_blocks)
    for name in ("natural_frequency", "damping_ratio"):
        counts_for_it[model.rows[name]] &= spectra.blocks[0].longest * half_widths >= _RULES.min_lines
    return np.where(counts_for_it, ratios, 1.0)
