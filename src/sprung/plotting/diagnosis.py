"""Pictures of a diagnosis: evidence over time, likelihood of the hypotheses, trends of the components."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sprung.diagnosis import Baseline, Diagnosis, ModeChange, nominal_baseline
from sprung.errors import ParameterError
from sprung.plotting.corners import corner_bars
from sprung.plotting.style import FAINT, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain

_MOST = 8
_KINDS = ("spring", "damper", "tyre")


def evidence_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the evidence of a change after every window beside its limit, and the likeliest hypotheses.

    Parameters
    ----------
    diagnosis
        With a window that can tell.
    """
    detection = diagnosis.detection
    if detection is None:
        raise ParameterError("no window can tell: there is no evidence to draw")
    said = diagnosis.findings[0].sentence if diagnosis.findings else "nothing has changed"
    figure = new_figure("Evidence of a change", said[:1].upper() + said[1:], width=9.5, height=4.2)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    for axes in (left, right):
        plain(axes)
    minutes = detection.times / 60
    left.plot(minutes, detection.evidence, marker="o", markersize=3, color=MODE_COLOURS[0])
    left.axhline(detection.threshold, color=MODE_COLOURS[1], linewidth=1.2)
    left.annotate(
        "alarm",
        (minutes[0], detection.threshold),
        xytext=(0, 3),
        textcoords="offset points",
        fontsize=SMALL,
        color=MODE_COLOURS[1],
    )
    if diagnosis.findings:
        left.axvspan(*(time / 60 for time in diagnosis.findings[0].since_interval), color="#F3D9C9", zorder=0)
        left.axvline(diagnosis.findings[0].since / 60, color=FAINT, linewidth=1)
    left.set_xlabel("begin of the window [min]", fontsize=NORMAL)
    left.set_ylabel("ln evidence of any change", fontsize=NORMAL)
    best = detection.candidates[:_MOST][::-1]
    named = diagnosis.findings[0].hypothesis if diagnosis.findings else best[-1].hypothesis.name
    right.barh(
        [one.hypothesis.name.replace("_", " ").replace(".", " ") for one in best],
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
        With a window that can tell.
    baseline
        None: against the vehicle file.
    """
    detection = diagnosis.detection
    if detection is None:
        raise ParameterError("no window can tell: there are no corners to draw")
    since = diagnosis.findings[0].since if diagnosis.findings else 0.0
    telling = [one for one in diagnosis.observations if one.can_tell and one.time >= since]
    normal = baseline or nominal_baseline(telling[0].components, vehicle="")
    telling = [one for one in telling if one.components == normal.components]
    mean = np.mean([normal.residual(one) for one in telling], axis=0)
    spread = np.mean([one.covariance for one in telling], axis=0) / len(telling)
    if normal.n_windows:
        spread = normal.covariance * (1 / len(telling) + 1 / normal.n_windows)
    against = "the vehicle file" if baseline is None else f"baseline {normal.version}"
    return corner_bars(
        normal.components,
        mean,
        np.sqrt(np.diag(spread)),
        is_told=np.ones(len(mean), dtype=np.bool_),
        heading=(
            f"Corners against {against}",
            f"Change in {len(telling)} windows since {since / 60:.0f} min [%], with 95 % intervals",
        ),
    )


def trends_figure(diagnosis: Diagnosis) -> Figure:
    """Draw every component over the windows, with 95 % intervals.

    Parameters
    ----------
    diagnosis
        With a window that can tell.
    """
    telling = [one for one in diagnosis.observations if one.can_tell]
    if not telling:
        raise ParameterError("no window can tell: there are no trends to draw")
    names = telling[0].components
    telling = [one for one in telling if one.components == names]
    minutes = np.array([one.time for one in telling]) / 60
    values = 100 * np.expm1([one.log_ratios for one in telling])
    bars = 196 * np.sqrt([np.diag(one.covariance) for one in telling])
    figure = new_figure("Components over time", "Change against the vehicle file, 95 % intervals", width=9.5, height=7)
    panels = figure.subplots(len(_KINDS), 1, sharex=True)
    for axes, kind in zip(panels, _KINDS, strict=True):
        plain(axes)
        members = [row for row, name in enumerate(names) if name.endswith("." + kind)]
        for number, row in enumerate(members):
            label = names[row].split(".")[0].replace("_", " ")
            colour = MODE_COLOURS[number % len(MODE_COLOURS)]
            axes.errorbar(
                minutes, values[:, row], bars[:, row], color=colour, label=label, marker="o", markersize=3, linewidth=1
            )
        for finding in diagnosis.findings:
            if finding.component == kind:
                axes.axvline(finding.since / 60, color=FAINT, linewidth=1)
        axes.axhline(0, color=INK, linewidth=0.8)
        axes.set_ylabel(f"{kind} [%]", fontsize=NORMAL)
    panels[0].legend(fontsize=SMALL, frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0, 1))
    panels[-1].set_xlabel("begin of the window [min]", fontsize=NORMAL)
    return figure


def mode_changes_figure(changes: Sequence[ModeChange], *, heading: str = "") -> Figure:
    """Draw the shapes of the body's modes before and after a change, with frequencies and MAC.

    Parameters
    ----------
    changes
        One or more.
    heading
        Such as the finding's sentence.
    """
    if not changes:
        raise ParameterError("there is no change of a mode to draw")
    figure = new_figure("Body modes before and after", heading, width=9.5, height=3.4)
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
        axes.set_title(
            f"{change.label}: {change.frequency[0]:.3g} to {change.frequency[1]:.3g} Hz, MAC {change.mac:.3f}",
            fontsize=SMALL,
        )
    panels[0].set_ylabel("modulus of the shape", fontsize=NORMAL)
    panels[0].set_ylim(0, 1.2)
    panels[-1].legend(fontsize=SMALL, frameon=False, loc="upper right", ncols=2)
    return figure
