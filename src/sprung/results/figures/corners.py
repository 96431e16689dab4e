"""Figures of a corner fit and of a calibration: spectra, the vehicle from above, correlations, learnt numbers."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sprung._arrays import Booleans, Real
from sprung.calibration import Calibration
from sprung.likelihood import CornerFit
from sprung.modal import INTERVAL_95
from sprung.results.figures import draw
from sprung.results.figures.style import STYLE, percent
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
    figure = draw.new_figure("Measured and fitted spectra", where, height=1.3 + 1.9 * len(names), source=source)
    panels = draw.panels(figure, len(names), 2, size=STYLE.small, sharex=True, width_ratios=(3, 2))
    for row, name in enumerate(names):
        left, right = panels[row]
        for values, colour, label in ((measured, STYLE.faint, "measured"), (fitted, STYLE.colours[1], "fitted")):
            left.semilogy(spectra.frequencies, values[row], color=colour, label=label, linewidth=1.4)
        left.set_ylabel(f"{name}\n[{unit_of_spectra(name)}]")
        right.plot(spectra.frequencies, 100 * fit.misfit[row], color=STYLE.colours[0], linewidth=1)
        _draw_chance(right, spectra.n_segments)
        right.set_ylabel("misfit [%]")
    draw.legend(panels[0, 0])
    panels[0, 1].set_title("measured over fitted, minus 1; grey: 95 % range of chance", fontsize=STYLE.small)
    for axes in panels[-1]:
        axes.set_xlabel("Frequency [Hz]", fontsize=STYLE.normal)
    return figure


def _draw_chance(axes: Axes, n_segments: int) -> None:
    """Draw the range [%] in which the misfit of an averaged spectrum is by chance."""
    chance = INTERVAL_95 * np.sqrt(1.06 / n_segments)
    axes.axhspan(-100 * chance, 100 * chance, color=STYLE.usual, label="95 % range of chance")
    axes.axhline(0, color=STYLE.ink, linewidth=0.8)


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
    where = "Bars: change against the vehicle file [%], with 95 % intervals. Grey: not identifiable from this run."
    heading = f"Corners against nominal: {source}" if source else "Corners against nominal", where
    known = fit.is_identifiable
    return corner_bars(fit.components, fit.log_ratios, fit.log_ratios_std, is_identifiable=known, heading=heading)


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
    figure = draw.new_figure(*heading, height=1.4 + 2.1 * n_axles)
    panels = draw.panels(figure, n_axles, 2, size=STYLE.small, sharey=True)
    change, low, high = (percent(log_ratios + sign * INTERVAL_95 * deviations) for sign in (0, -1, 1))
    inner = deviations if by_chance is None else by_chance
    near, far = (percent(log_ratios + sign * INTERVAL_95 * inner) for sign in (-1, 1))
    reach = _reach(change[is_identifiable], near[is_identifiable], far[is_identifiable])
    for axes, corner in zip(panels.ravel(), corners, strict=True):
        rows = [row for row, component in enumerate(components) if component.corner == corner]
        axes.set_ylim(-reach, reach)
        kinds = [components[row].kind for row in rows]
        _draw_corner(axes, kinds, is_identifiable[rows], change[rows], (near[rows], far[rows]))
        axes.vlines(range(len(rows)), low[rows], high[rows], color=STYLE.ink, linewidth=1.3)
        draw.mark_beyond(axes, range(len(rows)), low[rows], high[rows], reach=reach)
        if by_chance is not None:
            axes.vlines(range(len(rows)), near[rows], far[rows], color=STYLE.ink, linewidth=4)
        draw.title(axes, corner.replace("_", " "))
    for axes in panels[:, 0]:
        axes.set_ylabel("change [%]")
    return figure


def _reach(change: Real, low: Real, high: Real) -> float:
    """Return the end of the axis of changes [%]: that of the changes, and of their intervals where these are narrow."""
    largest = np.abs(change).max(initial=0.0)
    ends = np.abs(np.concatenate([low, high])).max(initial=0.0)
    return float(1.35 * max(largest, min(ends, max(2.0 * largest, 10.0)), 7.5))


def _draw_corner(
    axes: Axes, names: list[str], is_identifiable: Booleans, change: Real, ends: tuple[Real, Real]
) -> None:
    """Draw the bars of one corner: the change of each component [%], grey where it is not identifiable.

    The change is written next to an end of the interval of independent scatter.
    """
    axes.axhline(0, color=STYLE.ink, linewidth=1)
    near, far = ends
    for place, (name, is_known) in enumerate(zip(names, is_identifiable, strict=True)):
        colour = STYLE.colours[STYLE.kinds.index(name) % 3] if is_known else "#C8C8C8"
        axes.add_patch(Rectangle((place - 0.3, 0), 0.6, change[place], color=colour, alpha=0.75, linewidth=0))
        if is_known and change[place] >= 0:
            draw.note(axes, f"{change[place]:+.1f} %", (place, max(far[place], 0.0)), offset=(4, 1), va="bottom")
        elif is_known:
            draw.note(axes, f"{change[place]:+.1f} %", (place, min(near[place], 0.0)), offset=(4, -1), va="top")
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(range(len(names)), names, fontsize=STYLE.small)


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
    where, size = f"Values from {STYLE.min_correlation:g} in size are printed.", 2.6 + 0.42 * count
    figure = draw.new_figure(
        "Correlation of the estimates", where, width=max(size + 1, 7.5), height=size, source=source
    )
    axes = figure.subplots()
    image = draw.matrix(axes, values, names, names, text=_correlation, max_printed=count, cmap="RdBu_r", vmin=-1)
    figure.colorbar(image, ax=axes, shrink=0.8).set_label("correlation [-]", fontsize=STYLE.normal)
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
    figure = draw.new_figure("Misfit before and after calibration", where, height=1.3 + 1.9 * len(names), source=source)
    panels = draw.panels(figure, len(names), size=STYLE.small, sharex=True)[:, 0]
    given = (calibration.misfit_before, STYLE.faint, "as given")
    for row, (name, axes) in enumerate(zip(names, panels, strict=True)):
        for misfit, colour, label in (given, (calibration.misfit_after, STYLE.colours[0], "calibrated")):
            axes.plot(calibration.frequencies, 100 * misfit[row], color=colour, label=label, linewidth=1.2)
        _draw_chance(axes, n_segments)
        axes.set_ylabel(f"{name}\n[%]")
    draw.legend(panels[0], n_columns=3)
    panels[-1].set_xlabel("Frequency [Hz]", fontsize=STYLE.normal)
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
    what, where = "Learnt numbers against the vehicle file", "in usual standard deviations, with 95 % intervals"
    height = 1.5 + 0.22 * max(len(numbers), 4)
    axes = draw.panels(draw.new_figure(what, where, width=7.5, height=height, source=source))[0, 0]
    axes.axvline(0, color=STYLE.ink, linewidth=0.8)
    centres = np.array([(number.value - (number.nominal_value or 0.0)) / number.prior_std for number in numbers])
    reaches = INTERVAL_95 * np.array([number.std / number.prior_std for number in numbers])
    intervals = (centres, centres - reaches, centres + reaches)
    draw.intervals(axes, range(len(numbers)), intervals, colour=STYLE.colours[0], size=4, width=1.5, is_flat=True)
    axes.set_yticks(range(len(numbers)), [number.name for number in numbers], fontsize=STYLE.small)
    axes.invert_yaxis()
    axes.set_xlabel("(learnt - given) / usual deviation [-]")
    return axes.figure
