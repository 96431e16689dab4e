"""Figures of a diagnosis: evidence, changes of the corners, components over time, implied changes of the modes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sprung._arrays import Real
from sprung.diagnosis import Baseline, Diagnosis, Finding, Hypothesis, ModeChange, Observation
from sprung.diagnosis.baseline import mean_deviation, typical_std
from sprung.diagnosis.findings import format_time
from sprung.errors import ParameterError
from sprung.modal import INTERVAL_95
from sprung.results.figures import draw
from sprung.results.figures.corners import corner_bars
from sprung.results.figures.style import STYLE, percent

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
            f"Corners against {_name(normal)}: mean of {len(conclusive)} windows since {format_time(since)}",
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
    n_corners = len({component.corner for component in components})
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
    label = f"{100 * finding.trend.per_hour:+.1f} % per hour"
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
