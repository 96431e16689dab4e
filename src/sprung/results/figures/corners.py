"""Figures of a corner fit and of a calibration: spectra, the vehicle from above, correlations, learnt numbers."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.patches import Rectangle

from sprung._arrays import Booleans, Real
from sprung.calibration import Calibration
from sprung.likelihood import CornerFit
from sprung.results.figures.style import (
    FAINT,
    HALF_WIDTH_95,
    INK,
    KINDS,
    MODE_COLOURS,
    NORMAL,
    SMALL,
    STYLE,
    draw_matrix,
    new_figure,
    percent,
    plain,
)
from sprung.vehicles import Component

_UNITS = {"bounce": "(m/s²)²/Hz", "pitch": "(rad/s²)²/Hz", "roll": "(rad/s²)²/Hz"}


def fitted_spectra_figure(fit: CornerFit, *, source: str = "") -> Figure:
    """Draw measured and fitted spectra of every coordinate, averaged over the speed classes, and their misfit.

    Parameters
    ----------
    fit
        Result of a corner fit.
    source
        Name of the recording, for the heading.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> figure = fitted_spectra_figure(fit)
    >>> measured, fitted = (line.get_ydata() for line in figure.axes[0].lines)
    >>> bool(0.9 < np.median(measured / fitted) < 1.1)
    True
    """
    spectra, names = fit.model.spectra, fit.model.layout.coordinates
    measured, fitted = mean_spectra(fit)
    where = f"{spectra.n_segments} segments of {spectra.segment_length:.3g} s in {spectra.counts.size} speed classes"
    figure = new_figure("Measured and fitted spectra", where, width=9.5, height=1.3 + 1.9 * len(names), source=source)
    panels = figure.subplots(len(names), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
    chance = HALF_WIDTH_95 * np.sqrt(1.06 / spectra.n_segments)
    for row, name in enumerate(names):
        left, right = panels[row]
        for axes in (left, right):
            plain(axes)
        for values, colour, label in ((measured, FAINT, "measured"), (fitted, MODE_COLOURS[1], "fitted")):
            left.semilogy(spectra.frequencies, values[row], color=colour, label=label, linewidth=1.4)
        left.set_ylabel(f"{name}\n[{unit_of_spectra(name)}]", fontsize=SMALL)
        right.axhspan(-100 * chance, 100 * chance, color="#E6E6E6")
        right.plot(spectra.frequencies, 100 * fit.misfit[row], color=MODE_COLOURS[0], linewidth=1)
        right.axhline(0, color=INK, linewidth=0.8)
        right.set_ylabel("misfit [%]", fontsize=SMALL)
    panels[0, 0].legend(fontsize=SMALL, frameon=False)
    panels[0, 1].set_title("measured over fitted, minus 1; grey: 95 % range of chance", fontsize=SMALL)
    for axes in panels[-1]:
        axes.set_xlabel("Frequency [Hz]", fontsize=NORMAL)
    return figure


def mean_spectra(fit: CornerFit) -> tuple[Real, Real]:
    """Return measured and fitted power spectral densities of every coordinate, averaged over the speed classes.

    Returns
    -------
    tuple of numpy.ndarray
        Measured and fitted, both of shape (coordinates, frequencies).
    """
    spectra = fit.model.spectra
    every = (np.einsum("cfii->cif", matrices).real for matrices in (spectra.matrices, fit.model.matrix(fit.parameters)))
    measured, fitted = (np.average(values, axis=0, weights=spectra.counts) for values in every)
    return measured, fitted


def unit_of_spectra(coordinate: str) -> str:
    """Return the unit of the power spectral density of a coordinate."""
    return _UNITS.get(coordinate, "squared units/Hz")


def corners_figure(fit: CornerFit, *, source: str = "") -> Figure:
    """Draw the vehicle from above with each corner's components as bars against nominal, with 95 % intervals.

    Parameters
    ----------
    fit, source
        As for `fitted_spectra_figure`.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> axes = corners_figure(fit).axes[0]
    >>> axes.get_title(loc="left"), [label.get_text() for label in axes.get_xticklabels()]
    ('front left', ['spring', 'damper', 'tyre'])
    """
    what = f"Corners against nominal: {source}" if source else "Corners against nominal"
    where = "Bars: change against the vehicle file [%], with 95 % intervals. Grey: not identifiable from this run."
    return corner_bars(
        fit.components, fit.log_ratios, fit.log_ratios_std, is_identifiable=fit.is_identifiable, heading=(what, where)
    )


def corner_bars(
    components: Sequence[Component],
    log_ratios: Real,
    deviations: Real,
    *,
    is_identifiable: Booleans,
    heading: tuple[str, str],
    by_chance: Real | None = None,
) -> Figure:
    """Draw the vehicle from above with bars of every component.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the corners.
    log_ratios, deviations
        ln(value / reference) of each component, and its standard deviation, shape (components,).
    is_identifiable
        Whether each component is known well enough to be coloured, shape (components,).
    heading
        Heading of the figure, and the line below it.
    by_chance
        Part of the deviations that is independent between components, drawn as a thicker line; None: not drawn.

    Notes
    -----
    The axis is scaled to the changes: an interval that reaches far beyond them is cut off, with an arrow at its end.
    """
    corners = list(dict.fromkeys(component.corner for component in components))
    n_axles = len(corners) // 2
    figure = new_figure(*heading, width=9.5, height=1.4 + 2.1 * n_axles)
    panels = figure.subplots(n_axles, 2, squeeze=False, sharey=True)
    change, low, high = (percent(log_ratios + sign * HALF_WIDTH_95 * deviations) for sign in (0, -1, 1))
    inner = deviations if by_chance is None else by_chance
    near, far = (percent(log_ratios + sign * HALF_WIDTH_95 * inner) for sign in (-1, 1))
    reach = _reach(change[is_identifiable], near[is_identifiable], far[is_identifiable])
    for axes, corner in zip(panels.ravel(), corners, strict=True):
        rows = [row for row, component in enumerate(components) if component.corner == corner]
        words = [components[row].kind for row in rows]
        axes.set_ylim(-reach, reach)
        intervals = np.array([low[rows], near[rows], far[rows], high[rows]])
        _draw_corner(axes, words, is_identifiable[rows], change[rows], intervals)
        if by_chance is not None:
            axes.vlines(range(len(rows)), intervals[1], intervals[2], color=INK, linewidth=4)
        axes.set_title(corner.replace("_", " "), fontsize=NORMAL, loc="left", color=INK)
    for axes in panels[:, 0]:
        axes.set_ylabel("change [%]", fontsize=SMALL)
    return figure


def _reach(change: Real, low: Real, high: Real) -> float:
    """Return the end of the axis of changes [%]: that of the changes, and of their intervals where these are narrow."""
    largest = np.abs(change).max(initial=0.0)
    ends = np.abs(np.concatenate([low, high])).max(initial=0.0)
    return float(1.35 * max(largest, min(ends, max(2.0 * largest, 10.0)), 7.5))


def _draw_corner(axes: Axes, names: list[str], is_identifiable: Booleans, change: Real, intervals: Real) -> None:
    """Draw the bars of one corner: the change of each component [%], grey where it is not identifiable.

    Intervals are the ends of those of all and of independent scatter [%], rising, shape (4, components); one that goes
    beyond the axis ends in an arrow.
    """
    plain(axes)
    axes.axhline(0, color=INK, linewidth=1)
    bottom, top = axes.get_ylim()
    for place, (name, is_known) in enumerate(zip(names, is_identifiable, strict=True)):
        low, near, far, high = intervals[:, place]
        colour = MODE_COLOURS[KINDS.index(name) % 3] if is_known else "#C8C8C8"
        axes.add_patch(Rectangle((place - 0.3, 0), 0.6, change[place], color=colour, alpha=0.75, linewidth=0))
        axes.vlines(place, low, high, color=INK, linewidth=1.3)
        for is_beyond, limit, marker in ((low < bottom, bottom, CARETDOWN), (high > top, top, CARETUP)):
            if is_beyond:
                axes.plot(place, limit, marker=marker, color=INK, markersize=6, clip_on=False, gid="cut off")
        if is_known:
            above = change[place] >= 0
            axes.annotate(
                f"{change[place]:+.1f} %",
                (place, max(far, 0.0) if above else min(near, 0.0)),
                xytext=(4, 1 if above else -1),
                textcoords="offset points",
                ha="left",
                va="bottom" if above else "top",
                fontsize=SMALL,
            )
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(range(len(names)), names, fontsize=SMALL)


def correlation_figure(fit: CornerFit, *, source: str = "") -> Figure:
    """Draw the correlation of the components' estimates; parameters as for `fitted_spectra_figure`.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> (image,) = correlation_figure(fit).axes[0].get_images()
    >>> image.get_array().shape, bool(np.allclose(np.diag(image.get_array()), 1))
    ((12, 12), True)
    """
    count = len(fit.components)
    deviations = np.sqrt(np.diag(fit.covariance))[:count]
    values = fit.covariance[:count, :count] / np.outer(deviations, deviations)
    names = [f"{component.corner.replace('_', ' ')} {component.kind}" for component in fit.components]
    size = 2.6 + 0.42 * count
    figure = new_figure(
        "Correlation of the estimates",
        f"Values from {STYLE.min_correlation:g} in size are printed.",
        width=max(size + 1, 7.5),
        height=size,
        source=source,
    )
    axes = figure.subplots()
    image = draw_matrix(axes, values, names, names, text=_correlation, max_printed=count, cmap="RdBu_r", vmin=-1)
    figure.colorbar(image, ax=axes, shrink=0.8).set_label("correlation [-]", fontsize=NORMAL)
    return figure


def _correlation(value: float) -> str:
    """Return a correlation as it is printed: neither a small one, nor that of a component with itself."""
    is_printed = STYLE.min_correlation <= abs(value) < 1 - 1e-9
    return f"{value:.2f}".replace("0.", ".").replace("-", "−") if is_printed else ""


def misfit_figure(calibration: Calibration, *, source: str = "") -> Figure:
    """Draw the misfit of each coordinate by frequency, with the vehicle file as given and as completed.

    Parameters
    ----------
    calibration
        Vehicle completed from drives.
    source
        Name of the recordings, for the heading.

    Examples
    --------
    A misfit of 50 % with the file as given, and of 10 % as completed:

    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> before, after = (line.get_ydata() for line in misfit_figure(calibration).axes[0].lines[:2])
    >>> float(before[0]), float(after[0])
    (50.0, 10.0)
    """
    names = calibration.coordinates
    n_segments = sum(calibration.n_segments)
    where = f"measured over fitted power, minus 1: {calibration.n_windows} windows, {n_segments} segments"
    figure = new_figure(
        "Misfit before and after calibration", where, width=9.5, height=1.3 + 1.9 * len(names), source=source
    )
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    chance = HALF_WIDTH_95 * np.sqrt(1.06 / n_segments)
    for row, (name, axes) in enumerate(zip(names, panels, strict=True)):
        plain(axes)
        axes.axhspan(-100 * chance, 100 * chance, color="#E6E6E6", label="95 % range of chance")
        for misfit, colour, label in (
            (calibration.misfit_before, FAINT, "as given"),
            (calibration.misfit_after, MODE_COLOURS[0], "calibrated"),
        ):
            axes.plot(calibration.frequencies, 100 * misfit[row], color=colour, label=label, linewidth=1.2)
        axes.axhline(0, color=INK, linewidth=0.8)
        axes.set_ylabel(f"{name}\n[%]", fontsize=SMALL)
    panels[0].legend(fontsize=SMALL, frameon=False, ncols=3)
    panels[-1].set_xlabel("Frequency [Hz]", fontsize=NORMAL)
    return figure


def learnt_figure(calibration: Calibration, *, source: str = "") -> Figure:
    """Draw how far the numbers that the drives determine are from the given ones, in prior standard deviations.

    Parameters
    ----------
    calibration, source
        As for `misfit_figure`.

    Examples
    --------
    A sensor is 0.08 m ahead of its place in the file:

    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> [label.get_text() for label in learnt_figure(calibration).axes[0].get_yticklabels()]
    ['acc_fl.x']
    """
    known = (number for number in calibration.learnt if number.is_identifiable and number.nominal_value is not None)
    numbers = list(known)[: STYLE.max_numbers]
    where = "in usual standard deviations, with 95 % intervals"
    figure = new_figure(
        "Learnt numbers against the vehicle file",
        where,
        width=7.5,
        height=1.5 + 0.22 * max(len(numbers), 4),
        source=source,
    )
    axes = figure.subplots()
    plain(axes)
    axes.axvline(0, color=INK, linewidth=0.8)
    for row, number in enumerate(numbers):
        centre = (number.value - (number.nominal_value or 0.0)) / number.prior_std
        reach = HALF_WIDTH_95 * number.std / number.prior_std
        axes.hlines(row, centre - reach, centre + reach, color=MODE_COLOURS[0], linewidth=1.5)
        axes.plot(centre, row, "o", color=MODE_COLOURS[0], markersize=4)
    axes.set_yticks(range(len(numbers)), [number.name for number in numbers], fontsize=SMALL)
    axes.invert_yaxis()
    axes.set_xlabel("(learnt - given) / usual deviation [-]", fontsize=NORMAL)
    return figure
