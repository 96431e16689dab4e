"""Spread of a quantity over many runs, with its true and its published value."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sprung._arrays import Real
from sprung.results.figures.style import INK, MODE_COLOURS, NORMAL, SMALL, new_figure, panel_grid, plain


@dataclass(frozen=True, eq=False, slots=True)
class Spread:
    """One quantity in many runs of several methods.

    Parameters
    ----------
    name
        Name of the quantity, with its unit.
    rows
        Names of the methods.
    values
        Values, shape (rows, runs); NaN where a run has none.
    truth
        True value; NaN if unknown.
    published
        Published value of each row; NaN without one.
    """

    name: str
    rows: tuple[str, ...]
    values: Real
    truth: float
    published: tuple[float, ...] = ()


def runs_figure(spreads: Sequence[Spread], *, title: str) -> Figure:
    """Draw every run as a point, a panel for each quantity, a row for each method.

    Parameters
    ----------
    spreads
        Quantities, at least one.
    title
        Heading of the figure.

    Examples
    --------
    Three runs, of which one did not find the mode:

    >>> import numpy as np
    >>> from sprung.results.figures import Spread
    >>> values = np.array([[1.48, 1.52, np.nan]])
    >>> figure = runs_figure([Spread("f [Hz]", ("Cov-SSI",), values, 1.5, (1.5,))], title="Bounce")
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['2 of 3']
    """
    n_rows, n_columns = panel_grid(len(spreads), most_columns=3)
    longest = max(len(name) for spread in spreads for name in spread.rows)
    height = 1.3 + n_rows * (0.9 + 0.33 * len(spreads[0].rows))
    figure = new_figure(
        title, "Points: runs. Bar: median. Line: true value. Diamond: published.", width=9.5, height=height
    )
    panels = figure.subplots(n_rows, n_columns, squeeze=False, sharey=longest > 0).ravel()
    for axes in panels[len(spreads) :]:
        axes.set_visible(False)
    for axes, spread in zip(panels, spreads, strict=False):
        plain(axes)
        _draw(axes, spread)
    return figure


def _draw(axes: Axes, spread: Spread) -> None:
    """Draw one quantity."""
    for row, values in enumerate(spread.values):
        finite = values[np.isfinite(values)]
        offsets = 0.22 * np.sin(np.arange(finite.size) * 2.399)  # the golden angle spreads them evenly
        axes.plot(finite, row + offsets, ".", color=MODE_COLOURS[0], markersize=3, alpha=0.5)
        if finite.size:
            axes.plot([np.median(finite)] * 2, [row - 0.35, row + 0.35], color=INK, linewidth=1.5)
        remark = f"{finite.size} of {values.size}"
        axes.annotate(remark, (0.995, row), xycoords=("axes fraction", "data"), fontsize=SMALL, ha="right", va="center")
        if row < len(spread.published) and np.isfinite(spread.published[row]):
            axes.plot(spread.published[row], row, "D", color=MODE_COLOURS[1], markersize=5)
    if np.isfinite(spread.truth):
        axes.axvline(spread.truth, color=MODE_COLOURS[2], linewidth=1)
    low, high = axes.get_xlim()
    axes.set_xlim(low, high + 0.25 * (high - low))
    axes.set_yticks(range(len(spread.rows)), spread.rows, fontsize=SMALL)
    axes.set_ylim(len(spread.rows) - 0.5, -0.5)
    axes.set_xlabel(spread.name, fontsize=NORMAL)
