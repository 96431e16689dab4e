"""Rate of stable points over frequency, by which the thesis selects modes."""

import numpy as np
from matplotlib.figure import Figure

from sprung.identification import Identification, SubsetModes
from sprung.results.figures.frequency import frequency_range
from sprung.results.figures.style import FAINT, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, origin, plain


def stable_rates_figure(identification: Identification, *, source: str = "", threshold: float | None = None) -> Figure:
    """Draw the rate of stable points of every alignment over its frequency, a panel for each subset.

    Parameters
    ----------
    identification
        Result of any method.
    source
        Name of the recording, for the heading.
    threshold
        Smallest rate of a mode; None: that of the settings.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> axes = stable_rates_figure(identification).axes[0]
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('Frequency [Hz]; dashed: threshold', 'rate [-]')
    """
    wanted = identification.settings.criteria.stable_rate if threshold is None else threshold
    subsets = identification.subsets
    what = f"Rate of stable points: {source}" if source else "Rate of stable points"
    figure = new_figure(what, origin(identification), width=9.5, height=1.5 + 1.7 * len(subsets))
    panels = figure.subplots(len(subsets), 1, sharex=True, squeeze=False)[:, 0]
    shown = frequency_range(identification)
    for number, (axes, subset) in enumerate(zip(panels, subsets, strict=True)):
        plain(axes)
        shown.put_on(axes)
        frequency, rate = alignment_rates(subset)
        is_kept = rate >= wanted
        for chosen, colour in ((~is_kept, FAINT), (is_kept, MODE_COLOURS[0])):
            axes.vlines(frequency[chosen], 0, rate[chosen], color=colour, linewidth=2.5)
        for place, height in zip(frequency[is_kept], rate[is_kept], strict=True):
            axes.annotate(f"{place:.2f}", (place, height), fontsize=SMALL, ha="center", va="bottom", color=INK)
        axes.axhline(wanted, color=MODE_COLOURS[1], linewidth=1, linestyle="--")
        axes.set_ylim(0, 1.15)
        name = "" if subset.level is None else f"subset {number + 1}\n{subset.n_segments} segments\n"
        axes.set_ylabel(f"{name}rate [-]", fontsize=NORMAL)
    panels[-1].set_xlabel("Frequency [Hz]; dashed: threshold", fontsize=NORMAL)
    return figure


def alignment_rates(subset: SubsetModes) -> tuple[np.ndarray, np.ndarray]:
    """Return mean frequency [Hz] and rate of stable points of every alignment of a subset's first diagram.

    References
    ----------
    F. Liu (2020), eq. 3-57 (stable rate).

    Examples
    --------
    Each mode is an alignment that is stable at most model orders:

    >>> import numpy as np
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> frequency, rate = alignment_rates(identification.subsets[0])
    >>> nearest = [np.abs(frequency - mode).argmin() for mode in identification.modes.natural_frequency]
    >>> frequency[nearest].round().tolist(), bool(rate[nearest].min() > 0.5)
    ([7.0, 20.0, 28.0], True)
    """
    if not subset.diagrams:
        return np.zeros(0), np.zeros(0)
    diagram = subset.diagrams[0]
    numbers = np.unique(diagram.alignments[diagram.alignments >= 0])
    frequency, rate = np.empty(numbers.size), np.empty(numbers.size)
    for row, number in enumerate(numbers):
        members = diagram.alignments == number
        frequency[row] = diagram.poles.natural_frequency[members].mean()
        rate[row] = np.unique(diagram.poles.rungs[members]).size / len(diagram.poles.ladder)
    return frequency, rate
