"""What the thesis prints, its settings, its modes matched with ours, and numbers, tables and pictures for its pages."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from sprung._arrays import Real
from sprung.excitation import Excitation
from sprung.identification import Identification
from sprung.modal import Modes, mac
from sprung.recording import Recording
from sprung.reproduce.chapter import SetUp, data
from sprung.results import figures
from sprung.results.page.page import Picture, picture, pictures
from sprung.results.tables import Table
from sprung.simulation import simulate
from sprung.vehicles import Structure


def published(chapter: str) -> dict[str, Any]:
    """Return the numbers that a chapter prints, as arrays: frequencies [Hz], damping [%]; NaN where it found no mode."""
    chapters: dict[str, Any] = _with_arrays(data("published")[f"chapter_{chapter}"])
    return chapters


def _with_arrays(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _with_arrays(own) for name, own in value.items()}
    return np.array(value) if isinstance(value, list) else value


def simulated(
    vehicle: Structure,
    excitation: Excitation,
    setup: SetUp,
    seed: Sequence[int],
    *,
    snr: float | None = None,
) -> list[Recording]:
    """Return the records of a set: each has the seed and its number."""
    return [
        simulate(
            vehicle,
            excitation,
            duration=setup.duration,
            sampling_rate=setup.rate,
            snr=snr,
            seed=np.random.default_rng([*seed, number]),
        )
        for number in range(setup.n_records)
    ]


# Cost of an unmatched mode; a match costs 1 - MAC plus its relative distance over the reach.
_UNMATCHED = 2.0


@dataclass(frozen=True, eq=False, slots=True)
class Match:
    """Identified modes of each true mode.

    Parameters
    ----------
    natural_frequency, damping_ratio, mac
        Values of the identified modes, shape (true modes,); NaN where a mode was not found.
    n_others
        Number of identified modes that match no true one.
    """

    natural_frequency: Real
    damping_ratio: Real
    mac: Real
    n_others: int

    @property
    def rows(self) -> Real:
        """Frequency, damping ratio, MAC and the number of others, shape (4, true modes)."""
        return np.array([self.natural_frequency, self.damping_ratio, self.mac, np.full(self.mac.shape, self.n_others)])


def matched(modes: Modes, truth: Modes, *, reach: float = 0.12) -> Match:
    """Return for each true mode the identified one that is nearest in shape and frequency.

    Parameters
    ----------
    modes
        Identified modes.
    truth
        True modes of the same channels.
    reach
        Largest relative difference of frequency; the MAC must also be above 0.5.
    """
    values = np.full((3, len(truth)), np.nan)
    if len(modes):
        apart = np.abs(modes.natural_frequency / truth.natural_frequency[:, None] - 1)
        alike = mac(truth.mode_shapes, modes.mode_shapes)
        is_possible = (apart <= reach) & (alike > 0.5)
        cost = np.where(is_possible, 1 - alike + apart / reach, _UNMATCHED)
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            if is_possible[row, column]:
                values[:, row] = modes.natural_frequency[column], modes.damping_ratio[column], alike[row, column]
    return Match(values[0], values[1], values[2], len(modes) - int(np.isfinite(values[0]).sum()))


def theoretical(structure: Structure, *, labels: tuple[str, ...] = ()) -> Modes:
    """Return the exact modes of a structure in the form of identified ones.

    Parameters
    ----------
    structure
        Structure with sensors.
    labels
        Labels of the modes to return; none: all modes.
    """
    exact = structure.modes()
    n = exact.poles.size
    modes = Modes(
        poles=exact.poles,
        mode_shapes=exact.mode_shapes,
        channels=exact.channels,
        natural_frequency_std=np.zeros(n),
        damping_ratio_std=np.zeros(n),
        stable_rate=np.ones(n),
        labels=exact.labels,
    )
    return modes.take(np.flatnonzero([not labels or label in labels for label in exact.labels]))


def at_channels(modes: Modes, names: Sequence[str]) -> Modes:
    """Return modes at some of their channels."""
    columns = [modes.channels.index(name) for name in names]
    return replace(
        modes,
        mode_shapes=modes.mode_shapes[:, columns],
        mode_shape_std=modes.mode_shape_std[:, columns],
        channels=tuple(names),
    )


BODY_MODES = ("bounce", "pitch", "roll")
#: Row of results, name, factor and true values of what is compared over the runs.
QUANTITIES: tuple[tuple[int, str, float, Callable[[Modes], Real]], ...] = (
    (0, "frequency [Hz]", 1.0, lambda truth: truth.natural_frequency),
    (1, "damping [%]", 100.0, lambda truth: 100 * truth.damping_ratio),
)


def worst_error(values: ArrayLike, truth: ArrayLike) -> float:
    """Return the largest relative error of the medians over the runs; columns without values do not count.

    Parameters
    ----------
    values
        Values, shape (runs, ..., modes), NaN where a run has none.
    truth
        True values, shape (modes,), above 0.
    """
    relative = np.asarray(values) / np.asarray(truth)
    columns = relative.reshape(len(relative), -1).T
    medians = [np.median(column[np.isfinite(column)]) for column in columns if np.isfinite(column).any()]
    return float(np.max(np.abs(np.array(medians) - 1), initial=0.0))


def share(values: ArrayLike) -> float:
    """Return the share of the runs with a value."""
    return float(np.isfinite(np.asarray(values)).mean())


def spread(values: ArrayLike, *, digits: int = 2) -> str:
    """Return the median of runs with the range of 90 % of them; a dash where none has a value.

    Examples
    --------
    >>> spread([1.0, 2.0, 3.0, float("nan")])
    '2.00 (1.10 to 2.90)'
    """
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return "–"
    low, middle, high = np.percentile(finite, [5, 50, 95])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


#: Heading and cells of a column.
Column = tuple[str, Sequence[str]]


def column_table(title: str, columns: Sequence[Column], *, remark: str = "") -> Table:
    """Return a table of columns with as many formatted numbers each, the names of the rows first."""
    headings, cells = zip(*columns, strict=True)
    return Table(title, tuple(headings), tuple(zip(*cells, strict=True)), ends_in_words=False, caption=remark)


def numbers(values: ArrayLike, *, digits: int = 2) -> list[str]:
    """Return the cells of a column of numbers, in the order of an array, a dash where there is none.

    Examples
    --------
    >>> numbers([7.013, float("nan")])
    ['7.01', '–']
    """
    flat = np.asarray(values, dtype=np.float64).ravel()
    return [f"{value:.{digits}f}" if np.isfinite(value) else "–" for value in flat]


def in_runs(values: Real, *, digits: int = 2) -> list[str]:
    """Return the cells of a column of numbers of many runs, shape (runs, ...): found in, median and range.

    Examples
    --------
    >>> in_runs(np.array([2.0, 2.0, np.nan]))
    ['2 of 3: 2.00 (2.00 to 2.00)']
    """
    columns = values.reshape(len(values), -1).T
    return [f"{np.isfinite(own).sum()} of {own.size}: {spread(own, digits=digits)}" for own in columns]


def shares(values: Real, names: Sequence[object] = ()) -> str:
    """Return the shares of the runs with a value, shape (runs, modes), each after its name, if any, in words."""
    texts = [f"{100 * share(own):.0f} %" for own in values.T]
    return ", ".join([f"{name} {text}" for name, text in zip(names, texts, strict=True)] if names else texts)


def deviations(ours: ArrayLike, published: ArrayLike) -> list[str]:
    """Return the cells of a column of relative deviations from published numbers, a dash where there is none.

    Examples
    --------
    >>> deviations([7.03, float("nan")], [7.01, 2.0])
    ['+0.29 %', '–']
    """
    printed = np.asarray(published, dtype=np.float64)
    relative = 100 * (np.asarray(ours) / np.where(printed == 0, np.nan, printed) - 1)
    return [f"{value:+z.2f} %" if np.isfinite(value) else "–" for value in relative.ravel()]


def theory_table(
    title: str,
    names: Sequence[str],
    frequencies: tuple[ArrayLike, ArrayLike],
    dampings: tuple[ArrayLike, ArrayLike],
    *,
    digits: tuple[int, int, int, int] = (2, 4, 2, 4),
    remark: str = "",
) -> Table:
    """Return the table of theoretical modes, published next to ours.

    Parameters
    ----------
    title
        Title with the number of the thesis' table or figure.
    names
        Names of the modes.
    frequencies, dampings
        Published and our natural frequencies [Hz], and damping ratios [%].
    digits
        Decimals of published and our frequencies, and of published and our damping ratios.
    remark
        Sentence below the table.
    """
    columns: list[Column] = [("", names)]
    for symbol, unit, (published, ours), (few, many) in (
        ("f", "Hz", frequencies, digits[:2]),
        ("ξ", "%", dampings, digits[2:]),
    ):
        columns += [
            (f"{symbol} published [{unit}]", numbers(published, digits=few)),
            (f"{symbol} ours [{unit}]", numbers(ours, digits=many)),
            ("deviation", deviations(ours, published)),
        ]
    return column_table(title, columns, remark=remark)


def mode_pictures(
    identification: Identification,
    captions: Mapping[str, str],
    *,
    source: str = "",
    name: str = "",
    parts: Sequence[tuple[str, Modes]] = (),
    truth: Modes | None = None,
    title: str = "MAC of theory (rows) and identified shapes",
) -> tuple[Picture, ...]:
    """Return the pictures of an identification that have captions: `diagram`, `rates`, `shapes` and `mac`.

    Parameters
    ----------
    source
        Name of the records in diagram and rates.
    name
        Name of the method or the records with the shapes; default: `source`.
    parts
        Modes that are compared with the true ones; none: those identified.
    truth, title
        True modes, and the heading of that comparison.
    """
    modes, name = identification.modes, name or source
    drawn = {
        "diagram": lambda: figures.stabilisation_figure(identification, source=source),
        "rates": lambda: figures.stable_rates_figure(identification, source=source),
        "shapes": lambda: figures.shapes_figure(modes, identification.channels, source=name),
        "mac": lambda: figures.reference_mac_figure(parts or [(name, modes)], truth or modes, title=title),
    }
    return pictures({caption: drawn[kind]() for kind, caption in captions.items()})


def cepstrum_picture(
    recording: Recording, quefrency: float, caption: str, *, title: str, pulse_period: float
) -> Picture:
    """Return the cepstrum of the first channel with a short-pass lifter up to a quefrency [s]."""
    samples = recording.samples[0] - recording.samples[0].mean()
    spectrum = np.abs(np.fft.fft(samples))
    cepstrum = np.fft.ifft(np.log(np.maximum(spectrum, 1e-12 * spectrum.max()))).real
    quefrencies = np.arange(1500) / recording.sampling_rate
    lifter = (quefrencies < quefrency).astype(float)
    figure = figures.cepstrum_figure(quefrencies, cepstrum[:1500], lifter, title=title, pulse_period=pulse_period)
    return picture(figure, caption)


def subset_parts(identification: Identification) -> list[tuple[str, Modes]]:
    """Return the modes of the subsets of CoSS-SSI by name."""
    return [(f"subset {k + 1}", subset.modes) for k, subset in enumerate(identification.subsets)]


def spreads(
    names: Sequence[str],
    rows: tuple[str, ...],
    values: Real,
    truth: ArrayLike,
    printed: Real | None = None,
    *,
    quantity: str = "frequency [Hz]",
) -> list[figures.Spread]:
    """Return a quantity of modes over the runs, shape (runs, rows, modes), with the true one.

    Parameters
    ----------
    names
        Names of the modes.
    rows
        Names of the methods or cases.
    values
        Values of the quantity.
    truth
        True ones, shape (modes,).
    printed
        Published ones, shape (rows, modes).
    """
    drawn = []
    for k, (name, true) in enumerate(zip(names, np.asarray(truth, dtype=np.float64).tolist(), strict=True)):
        published = () if printed is None else (tuple(printed[:, k]),)
        drawn.append(figures.Spread(f"{name}: {quantity}", rows, values[:, :, k].T, true, *published))
    return drawn
