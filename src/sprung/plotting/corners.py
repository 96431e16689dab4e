"""Pictures of a fit of the corners: spectra, the vehicle from above, correlations."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sprung.diagnosis import INTERVAL_95
from sprung.likelihood import CornerFit
from sprung.plotting.style import FAINT, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain
from sprung.vehicles import Component

_UNITS = {"bounce": "(m/s²)²/Hz", "pitch": "(rad/s²)²/Hz", "roll": "(rad/s²)²/Hz"}
_COMPONENTS = ("spring", "damper", "tyre")


def fitted_spectra_figure(fit: CornerFit, *, source: str = "") -> Figure:
    """Draw measured and fitted spectra of every coordinate, averaged over the speed classes, and their misfit.

    Parameters
    ----------
    fit
        Any.
    source
        Name of the recording, for the heading.
    """
    spectra, names = fit.model.spectra, fit.model.layout.coordinates
    fitted = np.einsum("cfii->cif", fit.model.matrix(fit.parameters)).real
    measured = np.einsum("cfii->cif", spectra.matrices).real
    what = f"Measured and fitted spectra: {source}" if source else "Measured and fitted spectra"
    where = f"{spectra.n_segments} segments of {spectra.segment_length:.3g} s in {spectra.counts.size} speed classes"
    figure = new_figure(what, where, width=9.5, height=1.3 + 1.9 * len(names))
    panels = figure.subplots(len(names), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
    chance = INTERVAL_95 * np.sqrt(1.06 / spectra.n_segments)
    for row, name in enumerate(names):
        left, right = panels[row]
        for axes in (left, right):
            plain(axes)
        for values, colour, label in ((measured, FAINT, "measured"), (fitted, MODE_COLOURS[1], "fitted")):
            mean = np.average(values[:, row], axis=0, weights=spectra.counts)
            left.semilogy(spectra.frequencies, mean, color=colour, label=label, linewidth=1.4)
        left.set_ylabel(f"{name}\n[{_UNITS.get(name, 'squared units/Hz')}]", fontsize=SMALL)
        right.axhspan(-100 * chance, 100 * chance, color="#E6E6E6")
        right.plot(spectra.frequencies, 100 * fit.misfit[row], color=MODE_COLOURS[0], linewidth=1)
        right.axhline(0, color=INK, linewidth=0.8)
        right.set_ylabel("misfit [%]", fontsize=SMALL)
    panels[0, 0].legend(fontsize=SMALL, frameon=False)
    panels[0, 1].set_title("measured over fitted, less 1; grey: 95 % by chance", fontsize=SMALL)
    for axes in panels[-1]:
        axes.set_xlabel("Frequency [Hz]", fontsize=NORMAL)
    return figure


def corners_figure(fit: CornerFit, *, source: str = "") -> Figure:
    """Draw the vehicle from above with each corner's components as bars against nominal, with 95 % intervals.

    Parameters
    ----------
    fit, source
        As for `fitted_spectra_figure`.
    """
    what = f"Corners against nominal: {source}" if source else "Corners against nominal"
    where = "Bars: change against the vehicle file [%], with 95 % intervals. Grey: not identifiable from this run."
    return corner_bars(
        fit.components, fit.log_ratios, fit.log_ratios_std, is_identifiable=fit.is_identifiable, heading=(what, where)
    )


def corner_bars(
    components: Sequence[Component],
    log_ratios: np.ndarray,
    deviations: np.ndarray,
    *,
    is_identifiable: np.ndarray,
    heading: tuple[str, str],
    by_chance: np.ndarray | None = None,
) -> Figure:
    """Draw the vehicle from above with bars of every component.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the corners.
    log_ratios, deviations
        ln of value over reference, and its standard deviation, shape (components,).
    is_identifiable
        Which are known well enough to be coloured.
    heading
        And what stands below it.
    by_chance
        The part of the deviations that every component has for itself, drawn as a thicker line; None: not drawn.
    """
    corners = list(dict.fromkeys(component.corner for component in components))
    n_axles = len(corners) // 2
    figure = new_figure(*heading, width=9.5, height=1.4 + 2.1 * n_axles)
    panels = figure.subplots(n_axles, 2, squeeze=False, sharey=True)
    change, low, high = (100 * np.expm1(log_ratios + sign * INTERVAL_95 * deviations) for sign in (0, -1, 1))
    reach = max(10.0, 1.3 * np.abs(np.concatenate([low[is_identifiable], high[is_identifiable], [5.0]])).max())
    thick = (
        None if by_chance is None else [100 * np.expm1(log_ratios + sign * INTERVAL_95 * by_chance) for sign in (-1, 1)]
    )
    for axes, corner in zip(panels.ravel(), corners, strict=True):
        rows = [row for row, component in enumerate(components) if component.corner == corner]
        words = [components[row].kind for row in rows]
        _draw_corner(axes, words, is_identifiable[rows], change[rows], low[rows], high[rows])
        if thick is not None:
            axes.vlines(range(len(rows)), thick[0][rows], thick[1][rows], color=INK, linewidth=4)
        axes.set_title(corner.replace("_", " "), fontsize=NORMAL, loc="left", color=INK)
        axes.set_ylim(-reach, reach)
    for axes in panels[:, 0]:
        axes.set_ylabel("change [%]", fontsize=SMALL)
    return figure


def _draw_corner(axes: Axes, names: list[str], is_identifiable: np.ndarray, *changes: np.ndarray) -> None:
    """Draw the bars of one corner: components, whether they are identifiable, change and its interval [%]."""
    plain(axes)
    axes.axhline(0, color=INK, linewidth=1)
    for place, (name, told, change, low, high) in enumerate(zip(names, is_identifiable, *changes, strict=True)):
        colour = MODE_COLOURS[_COMPONENTS.index(name) % 3] if told else "#C8C8C8"
        axes.add_patch(Rectangle((place - 0.3, 0), 0.6, change, color=colour, alpha=0.75, linewidth=0))
        axes.vlines(place, low, high, color=INK, linewidth=1.3)
        if told:
            above = change >= 0
            axes.annotate(
                f"{change:+.1f} %",
                (place, high if above else low),
                xytext=(0, 3 if above else -3),
                textcoords="offset points",
                ha="center",
                va="bottom" if above else "top",
                fontsize=SMALL,
            )
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(range(len(names)), names, fontsize=SMALL)


def correlation_figure(fit: CornerFit, *, source: str = "") -> Figure:
    """Draw the correlation of the components' estimates; parameters as for `fitted_spectra_figure`."""
    count = len(fit.components)
    deviations = np.sqrt(np.diag(fit.covariance))[:count]
    values = fit.covariance[:count, :count] / np.outer(deviations, deviations)
    names = [f"{component.corner.replace('_', ' ')} {component.kind}" for component in fit.components]
    what = f"Correlation of the estimates: {source}" if source else "Correlation of the estimates"
    size = 2.6 + 0.42 * count
    figure = new_figure(what, "", width=max(size + 1, 7.5), height=size)
    axes = figure.subplots()
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1)
    axes.set_xticks(range(count), names, fontsize=SMALL, rotation=90)
    axes.set_yticks(range(count), names, fontsize=SMALL)
    for (row, column), value in np.ndenumerate(values):
        if row != column and abs(value) >= 0.3:
            axes.text(column, row, f"{value:.1f}", ha="center", va="center", fontsize=SMALL - 1)
    figure.colorbar(image, ax=axes, shrink=0.8).set_label("correlation [-]", fontsize=NORMAL)
    return figure
