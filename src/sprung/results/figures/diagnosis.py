"""Figures of corners and of a diagnosis: values, evidence, changes, components over time, changes of the modes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sprung._arrays import Booleans, Real
from sprung._display import counted
from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, Finding, Hypothesis, ModeChange, Observation
from sprung.diagnosis.baseline import mean_deviation, typical_std
from sprung.diagnosis.findings import format_time
from sprung.errors import ParameterError
from sprung.likelihood import CornerFit
from sprung.modal import INTERVAL_95
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, percent
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
    where = f"{counted(spectra.n_segments, 'segment')} of {spectra.segment_length:.3g} s"
    where += f" in {counted(spectra.counts.size, 'speed class', 'es')}"
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
    corners = list(dict.fromkeys(draw.corner_of(component) for component in components))
    n_axles = len(corners) // 2
    figure = draw.new_figure(*heading, height=1.4 + 2.1 * n_axles)
    panels = draw.panels(figure, n_axles, 2, size=STYLE.small, sharey=True)
    change, low, high = (percent(log_ratios + sign * INTERVAL_95 * deviations) for sign in (0, -1, 1))
    inner = deviations if by_chance is None else by_chance
    near, far = (percent(log_ratios + sign * INTERVAL_95 * inner) for sign in (-1, 1))
    reach = _reach(change[is_identifiable], near[is_identifiable], far[is_identifiable])
    for axes, corner in zip(panels.ravel(), corners, strict=True):
        rows = [row for row, component in enumerate(components) if draw.corner_of(component) == corner]
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
        family = next((k for k, kind in enumerate(STYLE.kinds) if name.endswith(kind)), 0)
        colour = STYLE.colours[family] if is_known else "#C8C8C8"
        axes.add_patch(Rectangle((place - 0.3, 0), 0.6, change[place], color=colour, alpha=0.75, linewidth=0))
        if is_known and change[place] >= 0:
            draw.note(axes, f"{change[place]:+z.1f} %", (place, max(far[place], 0.0)), offset=(4, 1), va="bottom")
        elif is_known:
            draw.note(axes, f"{change[place]:+z.1f} %", (place, min(near[place], 0.0)), offset=(4, -1), va="top")
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(range(len(names)), [name.replace("_", "-") for name in names], fontsize=STYLE.small)


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
    where = f"measured over fitted power, minus 1: {counted(calibration.n_windows, 'window')}, {n_segments} segments"
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


#: Colours of the usual range, with and without the scatter that corners share.
_BANDS = ("#EDEDED", "#D5D5D5")


def evidence_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the evidence of a change after every window with its threshold, and the most likely hypotheses.

    Parameters
    ----------
    diagnosis
        Diagnosis with at least one conclusive window.

    Raises
    ------
    ParameterError
        If no window was conclusive.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> axes = evidence_figure(sprung.diagnose(windows[8:], sprung.learn(windows[:8]))).axes[0]
    >>> evidence, threshold = (line.get_ydata() for line in axes.lines[:2])
    >>> round(float(threshold[0]), 1), bool(evidence[-1] > threshold[0])
    (10.8, True)
    """
    detection = diagnosis.detection
    if detection is None:
        raise ParameterError("the diagnosis has no conclusive window, but its evidence needs one: add windows")
    sentence = diagnosis.findings[0].sentence if diagnosis.findings else diagnosis.verdict.replace("_", " ")
    figure = draw.new_figure("Evidence of a change", sentence[:1].upper() + sentence[1:], height=4.2)
    left, right = draw.panels(figure, 1, 2, width_ratios=(3, 2))[0]
    minutes = detection.times / 60
    left.plot(minutes, detection.evidence, marker="o", markersize=3, color=STYLE.colours[0])
    left.axhline(detection.threshold, color=STYLE.colours[1], linewidth=1.2)
    draw.note(left, "threshold", (minutes[0], detection.threshold), offset=(0, 3), color=STYLE.colours[1])
    if diagnosis.findings:
        _draw_onset(left, diagnosis.findings[0], color=STYLE.faint, linewidth=1)
        draw.legend(left)
    left.set(xlim=_span(minutes), xlabel="start of the window [min]", ylabel="ln evidence of any change")
    best = detection.candidates[: STYLE.max_hypotheses][::-1]
    named = "+".join(finding.hypothesis for finding in diagnosis.findings) or best[-1].hypothesis.name
    right.barh(
        [candidate.hypothesis.name.replace("_", " ").replace(".", " ").replace("all ", "every ") for candidate in best],
        [candidate.log_evidence for candidate in best],
        color=[STYLE.colours[0] if candidate.hypothesis.name == named else STYLE.faint for candidate in best],
    )
    right.axvline(0, color=STYLE.ink, linewidth=0.8)
    right.set_xlabel("ln evidence of each hypothesis")
    return figure


def corner_changes_figure(diagnosis: Diagnosis, baseline: Baseline | None = None) -> Figure:
    """Draw the components of every corner against the baseline, averaged over the windows since the onset.

    Parameters
    ----------
    diagnosis
        Diagnosis with at least one conclusive window.
    baseline
        Baseline of the vehicle; None: that of the diagnosis, which is of its type or its vehicle file.

    Raises
    ------
    ParameterError
        If no window was conclusive.

    Examples
    --------
    Eight windows of a healthy vehicle, and six with a front-left spring that has lost 30 % of its stiffness:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows[:8])
    >>> figure = corner_changes_figure(sprung.diagnose(windows[8:], baseline), baseline)
    >>> figure.axes[0].get_title(loc="left"), figure.axes[0].texts[0].get_text()
    ('front left', '-29.0 %')
    """
    normal, conclusive = _normal(diagnosis, baseline, "changes of corners need")
    since = diagnosis.findings[0].since if diagnosis.findings else conclusive[0].time
    conclusive = [window for window in conclusive if window.time >= since]
    mean = mean_deviation(normal, conclusive)
    return corner_bars(
        mean.components,
        mean.log_ratios,
        mean.std,
        is_identifiable=np.ones(len(mean.components), dtype=np.bool_),
        heading=(
            f"Corners against {_name(normal)}: mean of {counted(len(conclusive), 'window')} since {format_time(since)}",
            "95 % intervals: thick: independent scatter; thin: with common effects; arrow: beyond the axis",
        ),
        by_chance=mean.std_by_chance,
    )


def _normal(diagnosis: Diagnosis, baseline: Baseline | None, needed: str) -> tuple[Baseline, list[Observation]]:
    """Return what is normal, and the windows of the change test: neither excluded ones nor those of failing sensors."""
    normal = baseline or diagnosis.baseline
    if diagnosis.detection is None or normal is None:
        raise ParameterError(f"the diagnosis has no conclusive window, but {needed} one: add windows")
    tested = set(diagnosis.detection.times.tolist())
    return normal, [window for window in diagnosis.observations if window.time in tested]


def trends_figure(diagnosis: Diagnosis, baseline: Baseline | None = None) -> Figure:
    """Draw every component over the windows with its usual range, and onset and trend of a finding.

    Parameters
    ----------
    diagnosis
        Diagnosis with at least one conclusive window.
    baseline
        Baseline of the vehicle; None: that of the diagnosis, which is of its type or its vehicle file.

    Raises
    ------
    ParameterError
        If no window was conclusive.

    Notes
    -----
    Values are corrected to the mean conditions of the baseline. The line is the mean of the baseline (0, the value of
    the vehicle file, without one); the grey band holds 95 % of usual single windows, the darker one without the
    scatter that corners share.

    Examples
    --------
    Eight windows of a healthy vehicle, and six with a front-left spring that has lost 30 % of its stiffness:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows[:8])
    >>> figure = trends_figure(sprung.diagnose(windows, baseline), baseline)
    >>> len(figure.axes), figure.axes[0].get_title(loc="left"), figure.axes[0].get_ylabel()
    (12, 'front left', 'spring [%]')
    """
    normal, conclusive = _normal(diagnosis, baseline, "trends need")
    components = normal.components
    n_corners = len({draw.corner_of(component) for component in components})
    what = "Components over time against the vehicle file, with 95 % intervals"
    where = f"Grey: 95 % of usual windows by {_name(normal)}; darker: without common effects"
    figure = draw.new_figure(what, where, width=max(9.5, 2.4 * n_corners), height=7)
    panels, shown = draw.component_panels(figure, components)
    minutes = np.array([window.time for window in conclusive]) / 60
    values = np.array([normal.mean + normal.residual(window) for window in conclusive])
    bars = INTERVAL_95 * np.sqrt([np.diag(window.covariance) for window in conclusive])
    halves = [INTERVAL_95 * std for std in (typical_std(normal), np.sqrt(np.diag(normal.covariance)))]
    for axes, row in shown:
        mean = float(normal.mean[row])
        for half, colour in zip(halves, _BANDS, strict=True):
            axes.axhspan(*percent([mean - half[row], mean + half[row]]), color=colour, zorder=0)
        axes.axhline(float(percent(mean)), color=STYLE.ink, linewidth=0.8)
        middle, low, high = (percent(values[:, row] + sign * bars[:, row]) for sign in (0, -1, 1))
        axes.errorbar(minutes, middle, (middle - low, high - middle), fmt="o", color=STYLE.colours[0], markersize=3)
        for finding in diagnosis.findings:
            if components[row] in Hypothesis("", finding.corner, finding.component).parts(components):
                _draw_onset(axes, finding, color=STYLE.colours[1], linewidth=1.2)
                _draw_trend(axes, finding, minutes, values[:, row])
                draw.legend(axes)
    panels[0, 0].set_xlim(*_span(minutes))
    for axes in panels[-1]:
        axes.set_xlabel("start of the window [min]", fontsize=STYLE.normal)
    return figure


def _draw_onset(axes: Axes, finding: Finding, **style: Any) -> None:
    """Draw the onset of a finding with its interval."""
    axes.axvspan(*(time / 60 for time in finding.since_interval), color=STYLE.attention, zorder=0.5)
    axes.axvline(finding.since / 60, label="onset, with 95 % interval", **style)


def _draw_trend(axes: Axes, finding: Finding, minutes: Real, values: Real) -> None:
    """Draw the trend of a finding through the values [ln] since its onset."""
    if finding.trend is None:
        return
    later = minutes >= finding.since / 60
    away = minutes[later] - minutes[later].mean()
    trend = values[later].mean() + np.log1p(finding.trend.per_hour) * away / 60
    label = f"{100 * finding.trend.per_hour:+z.1f} % per hour"
    axes.plot(minutes[later], percent(trend), color=STYLE.colours[1], linewidth=1.5, linestyle="--", label=label)


def _name(normal: Baseline) -> str:
    """Return what windows are compared with, in words."""
    if normal.version:
        return f"baseline {normal.version}"
    return "the type" if normal.n_windows else "the vehicle file"


def _span(minutes: Real) -> tuple[float, float]:
    """Return the limits of a time axis, also for a single window."""
    room = max(1.0, 0.05 * float(np.ptp(minutes)))
    return float(minutes[0]) - room, float(minutes[-1]) + room


def mode_changes_figure(changes: Sequence[ModeChange], *, heading: str = "") -> Figure:
    """Draw the body modes before and after a change as implied by a finding, with frequencies and MAC.

    Parameters
    ----------
    changes
        Changes of modes, at least one.
    heading
        Line below the heading, such as the finding's sentence.

    Raises
    ------
    ParameterError
        If there are no changes.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> (finding,) = sprung.diagnose(windows[8:], sprung.learn(windows[:8])).findings
    >>> changes = sprung.diagnosis.mode_changes(sprung.read_vehicle("zafira"), finding)
    >>> figure = mode_changes_figure(changes, heading=finding.sentence)
    >>> figure.axes[0].get_title()
    'bounce: 1.52 to 1.43 Hz, MAC 0.924'
    """
    if not changes:
        raise ParameterError("changes is empty, but must hold at least one change of a mode: draw it only for findings")
    figure = draw.new_figure("Body modes before and after, as the finding implies", heading, height=3.4)
    panels = draw.panels(figure, 1, len(changes), sharey=True)[0]
    for axes, change in zip(panels, changes, strict=True):
        places = np.arange(len(change.channels))
        for shift, shape, colour, label in (
            (-0.2, change.shapes[0], STYLE.faint, "before"),
            (0.2, change.shapes[1], STYLE.colours[0], "after"),
        ):
            axes.bar(places + shift, shape, 0.4, color=colour, label=label)
        names = [name.replace("acc_", "").upper() for name in change.channels]
        axes.set_xticks(places, names, fontsize=STYLE.small)
        title = f"{change.label}: {change.frequency[0]:.3g} to {change.frequency[1]:.3g} Hz, MAC {change.mac:.3f}"
        if change.measured_before is not None and change.measured_since is not None:
            title += f"\nmeasured: {change.measured_before[0]:.3g} to {change.measured_since[0]:.3g} Hz"
        draw.title(axes, title, size=STYLE.small, loc="center")
    panels[0].set(ylabel="modulus of the shape [-]", ylim=(0, 1.2))
    draw.legend(panels[-1], loc="upper right", n_columns=2)
    return figure
