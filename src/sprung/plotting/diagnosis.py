"""Pictures of a diagnosis: evidence of the hypotheses, corners, components over time, modes as a finding implies."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung.diagnosis import INTERVAL_95, Baseline, Diagnosis, Finding, ModeChange, Observation, nominal_baseline
from sprung.errors import ParameterError
from sprung.plotting.corners import corner_bars
from sprung.plotting.style import FAINT, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain
from sprung.vehicles import Component

_MOST = 8
_KINDS = ("spring", "damper", "tyre")
#: Colours of what is usual, with and without what moves corners together.
_BANDS = ("#EDEDED", "#D5D5D5")
#: Colour of the interval of an onset.
_ONSET = "#F3D9C9"


def evidence_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the evidence of a change after every window with its threshold, and the likeliest hypotheses.

    Parameters
    ----------
    diagnosis
        Diagnosis with a conclusive window.
    """
    detection = diagnosis.detection
    if detection is None:
        raise ParameterError("no window was usable: there is no evidence to draw")
    said = diagnosis.findings[0].sentence if diagnosis.findings else "no change detected"
    figure = new_figure("Evidence of a change", said[:1].upper() + said[1:], width=9.5, height=4.2)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    for axes in (left, right):
        plain(axes)
    minutes = detection.times / 60
    left.plot(minutes, detection.evidence, marker="o", markersize=3, color=MODE_COLOURS[0])
    left.axhline(detection.threshold, color=MODE_COLOURS[1], linewidth=1.2)
    left.annotate(
        "alert",
        (minutes[0], detection.threshold),
        xytext=(0, 3),
        textcoords="offset points",
        fontsize=SMALL,
        color=MODE_COLOURS[1],
    )
    if diagnosis.findings:
        left.axvspan(*(time / 60 for time in diagnosis.findings[0].since_interval), color=_ONSET, zorder=0)
        left.axvline(diagnosis.findings[0].since / 60, color=FAINT, linewidth=1, label="onset, with 95 %")
        left.legend(fontsize=SMALL, frameon=False)
    left.set_xlim(*_span(minutes))
    left.set_xlabel("begin of the window [min]", fontsize=NORMAL)
    left.set_ylabel("ln evidence of any change", fontsize=NORMAL)
    best = detection.candidates[:_MOST][::-1]
    named = diagnosis.findings[0].hypothesis if diagnosis.findings else best[-1].hypothesis.name
    right.barh(
        [one.hypothesis.name.replace("_", " ").replace(".", " ").replace("all ", "every ") for one in best],
        [one.log_evidence for one in best],
        color=[MODE_COLOURS[0] if one.hypothesis.name == named else FAINT for one in best],
    )
    right.axvline(0, color=INK, linewidth=0.8)
    right.set_xlabel("ln evidence of each hypothesis", fontsize=NORMAL)
    right.tick_params(labelsize=SMALL)
    return figure


def corner_changes_figure(diagnosis: Diagnosis, baseline: Baseline | None = None) -> Figure:
    """Draw every corner's components against the baseline, in the mean of the windows since the onset.

    Parameters
    ----------
    diagnosis
        Diagnosis with a conclusive window.
    baseline
        None: against the vehicle file.
    """
    detection = diagnosis.detection
    if detection is None:
        raise ParameterError("no window was usable: there are no corners to draw")
    conclusive = _compared(diagnosis)
    since = diagnosis.findings[0].since if diagnosis.findings else conclusive[0].time
    conclusive = [one for one in conclusive if one.time >= since]
    normal = baseline or nominal_baseline(conclusive[0].components, vehicle="")
    mean = np.mean([normal.residual(one) for one in conclusive], axis=0)
    own = np.mean([one.covariance for one in conclusive], axis=0) / len(conclusive)
    if normal.n_windows:
        own = normal.covariance * (1 / len(conclusive) + 1 / normal.n_windows)
    # What moves corners together may stay, as a payload does: a mean over windows does not take it out.
    spread = own + normal.nuisance
    against = "the vehicle file" if baseline is None else f"baseline {normal.version}"
    return corner_bars(
        normal.components,
        mean,
        np.sqrt(np.diag(spread)),
        is_identifiable=np.ones(len(mean), dtype=np.bool_),
        heading=(
            f"Corners against {against}: mean of {len(conclusive)} windows since {since / 60:.0f} min",
            "95 % intervals: thick by chance, thin with what moves corners together, such as payload",
        ),
        by_chance=np.sqrt(np.diag(own)),
    )


def trends_figure(diagnosis: Diagnosis, baseline: Baseline | None = None) -> Figure:
    """Draw every component over the windows beside what is usual, with onset and trend of a finding.

    Parameters
    ----------
    diagnosis
        Diagnosis with a conclusive window.
    baseline
        None: the vehicle file.

    Notes
    -----
    Values are those in the middle of the baseline's conditions. The line is the baseline's mean (without one 0, as the
    file says), the grey band holds 95 % of usual single windows, the darker one is without what moves corners together.
    """
    if diagnosis.detection is None:
        raise ParameterError("no window was usable: there are no trends to draw")
    conclusive = _compared(diagnosis)
    normal = baseline or nominal_baseline(conclusive[0].components, vehicle="")
    components = normal.components
    corners = list(dict.fromkeys(component.corner for component in components))
    against = "the vehicle file" if baseline is None else f"baseline {normal.version}"
    what = "Components over time against the vehicle file, with 95 % intervals"
    where = f"Grey: 95 % of usual windows by {against}; darker: without what moves corners together"
    figure = new_figure(what, where, width=max(9.5, 2.4 * len(corners)), height=7)
    panels = figure.subplots(len(_KINDS), len(corners), sharex=True, sharey="row", squeeze=False)
    minutes = np.array([one.time for one in conclusive]) / 60
    values = np.array([normal.mean + normal.residual(one) for one in conclusive])
    bars = INTERVAL_95 * np.sqrt([np.diag(one.covariance) for one in conclusive])
    own, usual = (INTERVAL_95 * np.sqrt(np.diag(c)) for c in (normal.covariance, normal.covariance + normal.nuisance))
    for line, kind in zip(panels, _KINDS, strict=True):
        line[0].set_ylabel(f"{kind} [%]", fontsize=NORMAL)
        for axes, corner in zip(line, corners, strict=True):
            plain(axes)
            if Component(corner, kind) not in components:
                continue
            row = components.index(Component(corner, kind))
            _draw_limits(axes, float(normal.mean[row]), (usual[row], own[row]))
            middle, low, high = (_percent(values[:, row] + sign * bars[:, row]) for sign in (0, -1, 1))
            axes.errorbar(minutes, middle, (middle - low, high - middle), fmt="o", color=MODE_COLOURS[0], markersize=3)
            for finding in diagnosis.findings:
                if components[row] in _parts(diagnosis, finding, components):
                    _draw_onset(axes, finding, minutes, values[:, row])
    for axes, corner in zip(panels[0], corners, strict=True):
        axes.set_title(corner.replace("_", " "), fontsize=NORMAL, loc="left", color=INK)
    panels[0, 0].set_xlim(*_span(minutes))
    for axes in panels[-1]:
        axes.set_xlabel("begin of the window [min]", fontsize=NORMAL)
    return figure


def _draw_limits(axes: Axes, mean: float, halves: tuple[float, float]) -> None:
    """Draw what is usual: its mean, and a light and a dark band of which half the widths are given [ln]."""
    for half, colour in zip(halves, _BANDS, strict=True):
        axes.axhspan(*_percent([mean - half, mean + half]), color=colour, zorder=0)
    axes.axhline(float(_percent(mean)), color=INK, linewidth=0.8)


def _draw_onset(axes: Axes, finding: Finding, minutes: Real, values: Real) -> None:
    """Draw the onset of a finding with its interval, and its trend through the values [ln] since then."""
    axes.axvspan(*(time / 60 for time in finding.since_interval), color=_ONSET, zorder=0.5)
    axes.axvline(finding.since / 60, color=MODE_COLOURS[1], linewidth=1.2, label="onset, with 95 %")
    if finding.trend is not None:
        later = minutes >= finding.since / 60
        away = minutes[later] - minutes[later].mean()
        trend = values[later].mean() + np.log1p(finding.trend.per_hour) * away / 60
        label = f"{100 * finding.trend.per_hour:+.1f} % per hour"
        axes.plot(minutes[later], _percent(trend), color=MODE_COLOURS[1], linewidth=1.5, linestyle="--", label=label)
    axes.legend(fontsize=SMALL, frameon=False)


def _compared(diagnosis: Diagnosis) -> list[Observation]:
    """Return the windows that were compared with the baseline."""
    seen = set() if diagnosis.detection is None else set(diagnosis.detection.times.tolist())
    return [one for one in diagnosis.observations if one.time in seen]


def _parts(diagnosis: Diagnosis, finding: Finding, components: tuple[Component, ...]) -> tuple[Component, ...]:
    """Return the components that a finding is about."""
    candidates = () if diagnosis.detection is None else diagnosis.detection.candidates
    return next((c.hypothesis.parts(components) for c in candidates if c.hypothesis.name == finding.hypothesis), ())


def _span(minutes: Real) -> tuple[float, float]:
    """Return the ends of an axis of time, also of a single window."""
    room = max(1.0, 0.05 * float(np.ptp(minutes)))
    return float(minutes[0]) - room, float(minutes[-1]) + room


def _percent(log_ratio: ArrayLike) -> Real:
    """Return the relative change [%] of ln values."""
    return 100 * np.expm1(log_ratio)


def mode_changes_figure(changes: Sequence[ModeChange], *, heading: str = "") -> Figure:
    """Draw the shapes of the body's modes before and after a change as the finding implies, with frequencies and MAC.

    Parameters
    ----------
    changes
        One or more.
    heading
        Such as the finding's sentence.
    """
    if not changes:
        raise ParameterError("there is no change of a mode to draw")
    figure = new_figure("Body modes before and after, as the finding implies", heading, width=9.5, height=3.4)
    panels = figure.subplots(1, len(changes), sharey=True, squeeze=False)[0]
    for axes, change in zip(panels, changes, strict=True):
        plain(axes)
        places = np.arange(len(change.channels))
        for shift, shape, colour, label in (
            (-0.2, change.shapes[0], FAINT, "before"),
            (0.2, change.shapes[1], MODE_COLOURS[0], "after"),
        ):
            axes.bar(places + shift, shape, 0.4, color=colour, label=label)
        axes.set_xticks(places, [name.replace("acc_", "").upper() for name in change.channels], fontsize=SMALL)
        title = f"{change.label}: {change.frequency[0]:.3g} to {change.frequency[1]:.3g} Hz, MAC {change.mac:.3f}"
        if change.measured_before is not None and change.measured_since is not None:
            title += f"\nmeasured: {change.measured_before[0]:.3g} to {change.measured_since[0]:.3g} Hz"
        axes.set_title(title, fontsize=SMALL)
    panels[0].set_ylabel("modulus of the shape [-]", fontsize=NORMAL)
    panels[0].set_ylim(0, 1.2)
    panels[-1].legend(fontsize=SMALL, frameon=False, loc="upper right", ncols=2)
    return figure
