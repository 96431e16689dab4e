"""The report of a vehicle and period, a page that reads without a monitor, and the picture that goes with an alert."""

import io
import logging
import platform
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from sprung import __version__
from sprung.diagnosis.baseline import typical_std
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.errors import SprungError
from sprung.online.monitor.exports import grouped, report_document
from sprung.online.monitor.histories import VehicleHistory, assessed, read_history
from sprung.online.store import Store
from sprung.results.documents import ReportDocument
from sprung.results.page.page import Block, Paragraph, Picture, Report, Section, Sentences, picture
from sprung.results.tables import Table, alert_history_table, counted, hypotheses_table
from sprung.results.tables.wording import Period, format_estimate, format_name, format_time
from sprung.state import STEPS, AlertState, is_of_suspension
from sprung.vehicles import Component

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOG = logging.getLogger("sprung.monitor")

#: Resolution of the figures of a report [dots per inch].
_RESOLUTION = 120
#: Resolution of the picture of an alert: 950 pixels wide, which mail programs show whole.
_MAIL_RESOLUTION = 100
#: Alerts of a report with all that happened to them.
_MAX_ALERTS = 20
#: Longest gaps in the data that are listed.
_MAX_GAPS = 5
#: Distance of windows that is a gap, in lengths of a window.
_GAP = 1.5
#: Conditions that are shown in per cent.
_SHARES = {"standing": "%", "model_error": "%"}
_READING = (
    "A change is relative to the vehicle's own baseline: -20 % of a spring is a fifth of its stiffness lost. Of a"
    " damper it is damping, of a tyre stiffness.",
    "The 95 % interval contains the true value in 95 of 100 cases. A change whose interval contains 0 may be chance.",
    "An alert is raised where the evidence of all windows together exceeds a threshold, not where a single window"
    " leaves the grey range: 1 in 20 does so by chance.",
    "'No change detected' refers to losses of at least the detectable size; smaller ones may be present.",
    "Severity counts the part of a change that is certain: low below 10 %, medium from 10 %, high from 20 %,"
    " critical from 40 %.",
    "Modes change with payload and temperature, too: a changed frequency is not yet damage.",
    "Parts that are not in the model (mounts, bushings, joints, wheels) are not diagnosed. The report does not"
    " replace an inspection.",
    "Times are UTC.",
)


def vehicle_report(store: Store, vehicle: str, *, period: Period, now: int) -> Report:
    """Return the report of a vehicle and period.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    period
        Period.
    now
        Present time, UTC ns.

    Returns
    -------
    Report
        Sentence, changes from above, trends, alerts with evidence and verdicts, modes, conditions, quality of the data,
        settings and how to read it; its document is a `sprung.report/1`.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    StoreError
        If the store cannot be read.

    Notes
    -----
    It draws figures, which takes seconds and some 100 MB: write one at a time.
    """
    history = read_history(store, vehicle, period, now=now)
    document = report_document(history, now=now)
    begin, end = (int(history.times[k]) if len(history.times) else None for k in (0, -1))
    # Whole seconds: a day that ends a nanosecond before midnight is that day.
    ends = [
        f"{word} {format_time(time // 10**9 * 10**9)}"
        for word, time in (
            ("from", begin if period.since is None else period.since),
            ("to", end if period.until is None else period.until),
        )
        if time is not None
    ]
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "matplotlib"))
    written = f"{datetime.fromtimestamp(now // 10**9, tz=UTC):%Y-%m-%d %H:%M} UTC"
    contents: dict[str, Callable[[VehicleHistory, ReportDocument], Sequence[Block]]] = {
        "Springs, dampers and tyres": _parts,
        "Trends": _trends,
        "Alerts and evidence": _alerts,
        "Modes": _modes,
        "Conditions met": _conditions,
        "Quality of the data": _data,
        "Settings and versions": _settings,
        "How to read this report": lambda *_: [Sentences(_READING)],
    }
    return Report(
        f"{vehicle}: report {' '.join(ends)} UTC" if ends else f"{vehicle}: report of a period without windows",
        document.sentence,
        tuple(Section(title, tuple(blocks(history, document))) for title, blocks in contents.items()),
        document=document.as_json(),
        footer=f"sprung {__version__} (Python {platform.python_version()}, {packages}); written {written}",
    )


def alert_picture(store: Store, vehicle: str, cause: str) -> bytes:
    """Return the springs, dampers and tyres of a vehicle against its baseline as PNG, since the onset of a finding.

    Returns
    -------
    bytes
        The picture; empty for an alert that is not of the suspension, and where the store has no diagnosis. A picture
        that cannot be drawn is only logged: it must not keep the alert from being sent.
    """
    if not is_of_suspension(cause):
        return b""
    try:
        present = assessed(store, vehicle)
        if present is None:
            return b""
        from sprung.results.figures import corner_changes_figure

        file = io.BytesIO()
        corner_changes_figure(*present).savefig(file, format="png", dpi=_MAIL_RESOLUTION)
        return file.getvalue()
    except (SprungError, ValueError, OSError) as error:
        LOG.warning("an alert is sent without a picture", extra={"vehicle": vehicle, "reason": str(error)})
        return b""


def _parts(history: VehicleHistory, document: ReportDocument) -> list[Block]:
    """Return the changes of all parts, from above and as a table."""
    from sprung.results.figures import plan_figure

    state = history.state
    if not document.changes or document.changes_since is None:
        why = "no baseline yet" if document.baseline is None else "no window that can be compared with the baseline"
        return [Paragraph(f"There is {why}: changes are not known.")]
    figure = plan_figure(
        [Component.parse(part.part) for part in state.parts],
        np.array([part.change for part in state.parts]),
        np.array([part.interval for part in state.parts]),
        steps={part.part: STEPS.index(part.step) for part in state.parts if part.step},
        detectable=state.detectable,
        heading=(
            f"Changes against baseline {document.baseline}",
            f"Mean of {counted(state.n_windows, 'window')}; 95 % intervals; grey: detectable",
        ),
    )
    signs = "Signs of active alerts: ○ note, △ low, ◇ medium, ■ high, ✖ critical."
    rows = tuple(
        (
            format_name(change.component),
            _in_percent(change.change),
            " to ".join(map(_in_percent, change.interval)),
            "" if change.detectable is None else f"{100 * change.detectable:.0f}",
            "; ".join(
                f"{each.alert.number}: {each.alert.state}"
                for each in document.alerts
                if each.alert.cause == change.component
            ),
        )
        for change in document.changes
    )
    columns = ("part", "change [%]", "95 % interval [%]", "detectable loss [%]", "alert")
    since = format_time(document.changes_since)
    caption = (
        f"Mean of {counted(state.n_windows, 'window')} since {since} UTC against baseline {document.baseline},"
        " under the conditions of each; of a part that an alert names, the size of its finding. Common effects such as"
        " payload and temperature may move all corners alike: compare left with right. Detectable: with 95 % power."
    )
    plan = _picture(figure, f"The vehicle from above, and the change of every part. {signs}")
    return [plan, Table("", columns, rows, caption=caption)]


def _trends(history: VehicleHistory, _: ReportDocument) -> list[Block]:
    """Return parts, body modes, findings and evidence over dates."""
    from sprung.results import figures

    blocks: list[Block] = []
    deviations = history.deviations()
    if deviations is not None:
        end = int(history.times[-1])
        figure = figures.components_history_figure(
            deviations.times,
            deviations.log_ratios,
            deviations.std,
            components=deviations.baseline.components,
            usual=typical_std(deviations.baseline),
            alerts=[
                figures.Stretch(each.alert.cause, begin, end if stop is None else stop)
                for each in history.alerts
                for begin, stop in each.spans
            ],
            baselines=[
                round(1e9 * min(own.learning_times)) for _, own in history.baselines[1:] if own and own.learning_times
            ],
        )
        blocks.append(_picture(figure, "Every part over time. A new baseline sets the change back to zero."))
    modes = grouped(
        (label, (time, *values))
        for time, window in zip(history.times.tolist(), history.windows, strict=True)
        for label, values in window.modes.items()
    )
    if modes:
        courses = {label: _columns(rows) for label, rows in modes.items()}
        blocks.append(_picture(figures.modes_history_figure(courses), "Body modes of the fitted vehicle."))
    sizes = grouped(
        (f"{found['corner']}.{found['component']}", (entry.t0, [found["change"], *found["interval"]]))
        for entry in history.findings
        for found in (entry.document,)
        if found.get("change") is not None and found.get("interval")
    )
    if sizes:
        courses = {name: _columns(rows) for name, rows in sizes.items()}
        blocks.append(_picture(figures.findings_history_figure(courses), "Size of each finding after every window."))
    detection = None if history.diagnosis is None else history.diagnosis.detection
    if detection is not None:
        times = np.round(1e9 * detection.times).astype(np.int64)
        shown = np.ones(len(times), dtype=np.bool_) if history.period.since is None else times >= history.period.since
        if shown.any():
            figure = figures.evidence_history_figure(
                times[shown], detection.evidence[shown], threshold=detection.threshold
            )
            blocks.append(_picture(figure, "Evidence of any change in the present change test."))
    return blocks or [Paragraph("There is no usable window to draw.")]


def _alerts(history: VehicleHistory, document: ReportDocument) -> list[Block]:
    """Return the alerts with evidence, history and verdicts."""
    if not document.alerts:
        return [Paragraph("No alert was active in this period.")]
    blocks: list[Block] = []
    for each, reported in zip(history.alerts, document.alerts[:_MAX_ALERTS], strict=False):
        alert = each.alert
        cause = format_name(alert.cause) if alert.is_of_suspension else alert.cause.replace(":", " ")
        facts = tuple((name, value) for name, value in _facts(alert).items() if value)
        blocks.append(Table(f"Alert {alert.number}: {cause}", ("fact", "value"), facts))
        events = alert_history_table({"history": [event.as_json() for event in reported.history]})
        blocks.append(Table(f"History of alert {alert.number}", events.columns, events.rows, n_words=3))
        if reported.verdicts:
            rows = tuple(
                (format_time(given.time), given.verdict, given.part, given.action, given.who)
                for given in reported.verdicts
            )
            columns = ("time (UTC)", "verdict", "part", "what was done", "by")
            blocks.append(Table(f"Verdicts on alert {alert.number}", columns, rows, n_words=4))
    left = len(document.alerts) - _MAX_ALERTS
    if left > 0:
        blocks.append(Paragraph(f"{counted(left, 'further alert')} of lower severity: see the export of alerts."))
    detection = None if history.diagnosis is None else history.diagnosis.detection
    if detection is not None:
        blocks.append(hypotheses_table(detection))
        numbers = f"ln evidence {detection.evidence[-1]:.1f}; threshold of an alert {detection.threshold:.1f}."
        blocks.append(Paragraph(f"Present change test: {numbers}"))
    return blocks


def _facts(alert: AlertState) -> dict[str, str]:
    """Return what is known about an alert, by name; empty where it is unknown."""
    score, losses = alert.evidence.get("score"), alert.detectable.values()
    span = [round(1e9 * end) for end in alert.evidence.get("since_interval") or ()]
    since = alert.evidence.get("since")
    ends = (f"{100 * end:.0f}" for end in (min(losses), max(losses))) if losses else ()
    return {
        "finding": alert.text,
        "state": alert.state,
        "severity": f"{alert.step} ({alert.severity} of 1000)",
        "raised (UTC)": f"{format_time(alert.raised)}, occurrence {alert.count}",
        "cleared (UTC)": "" if alert.cleared is None else format_time(alert.cleared),
        "assigned to": alert.assignee or "nobody",
        "change [%]": "" if alert.change is None else _in_percent(alert.change),
        "95 % interval [%]": " to ".join(map(_in_percent, alert.interval or ())),
        "size over standard deviation": "" if score is None else _with_minus(f"{score:.1f}"),
        "since (UTC)": format_time(round(1e9 * since)) if since else "",
        "onset between (UTC)": " and ".join(map(format_time, span)),
        "second hypothesis": alert.runner_up or "",
        "detectable loss of any part [%]": " to ".join(dict.fromkeys(ends)),
    }


def _modes(history: VehicleHistory, document: ReportDocument) -> list[Block]:
    """Return the body modes over the period, and the modes that were identified last."""
    blocks: list[Block] = []
    if document.modes:
        rows = tuple(
            (
                format_name(label),
                str(mode.windows),
                f"{mode.natural_frequency.median:.3f}",
                f"{mode.natural_frequency.low:.3f} to {mode.natural_frequency.high:.3f}",
                f"{100 * mode.damping_ratio.median:.1f}",
                f"{100 * mode.damping_ratio.low:.1f} to {100 * mode.damping_ratio.high:.1f}",
            )
            for label, mode in document.modes.items()
        )
        columns = ("mode", "windows", "frequency [Hz]", "range [Hz]", "damping [%]", "range [%]")
        caption = "Of the fitted vehicle: median, lowest and highest value of the windows."
        blocks.append(Table("Body modes", columns, rows, ends_in_words=False, caption=caption))
    last = history.modes
    if last is not None and last.document.get("modes"):
        identified = tuple(
            (
                str(number),
                format_name(mode.get("label") or ""),
                format_estimate(mode["natural_frequency"], mode.get("natural_frequency_std") or 0.0),
                format_estimate(100 * mode["damping_ratio"], 100 * (mode.get("damping_ratio_std") or 0.0)),
                "" if mode.get("mpc") is None else f"{mode['mpc']:.2f}",
            )
            for number, mode in enumerate(last.document["modes"], start=1)
        )
        names = ("number", "label", "frequency [Hz]", "damping [%]", "MPC")
        title = f"Modes identified last, from {format_time(last.t0)} UTC"
        caption = "± is one standard deviation. MPC: modal phase collinearity, 1 for a shape without phase differences."
        blocks.append(Table(title, names, identified, n_words=2, ends_in_words=False, caption=caption))
    return blocks or [Paragraph("No mode was identified in this period.")]


def _conditions(history: VehicleHistory, document: ReportDocument) -> list[Block]:
    """Return the conditions met, next to those of the baseline."""
    if not document.conditions:
        return [Paragraph("There is no window with known conditions.")]
    learnt = {} if history.baseline is None else history.baseline.ranges

    def shown(name: str, value: float) -> str:
        return _with_minus(f"{100 * value if name in _SHARES else value:.3g}")

    rows = tuple(
        (
            format_name(name),
            _SHARES.get(name, CONDITION_UNITS.get(name, "")).replace("^2", "²").replace("^3", "³"),
            *(shown(name, value) for value in (met.low, met.median, met.high)),
            " to ".join(shown(name, end) for end in learnt.get(name, ())),
        )
        for name, met in document.conditions.items()
    )
    columns = ("condition", "unit", "lowest", "median", "highest", "in the baseline")
    caption = "Means of windows. Conditions outside those of the baseline are allowed for, but widen the intervals."
    return [Table("", columns, rows, n_words=2, ends_in_words=False, caption=caption)]


def _data(history: VehicleHistory, document: ReportDocument) -> list[Block]:
    """Return what is known of the quality of the data."""
    n_windows, times = document.windows, history.times
    share = f" ({100 * document.usable / n_windows:.0f} %)" if n_windows else ""
    sentences = [f"{document.usable} of {counted(n_windows, 'window')} were usable{share}."]
    if n_windows:
        first, last = (format_time(int(times[k])) for k in (0, -1))
        sentences.append(f"The first window began at {first}, the last one at {last} UTC.")
    if history.n_earlier:
        sentences.append(f"{history.n_earlier} earlier windows of the period are left out: choose a shorter period.")
    if history.n_unreadable:
        sentences.append(f"{counted(history.n_unreadable, 'window')} of another form cannot be read by this version.")
    if history.quarantined:
        reasons = "; ".join(dict.fromkeys(each.reason for each in history.quarantined))
        what = "frame or state was" if len(history.quarantined) == 1 else "frames or states were"
        sentences.append(f"{len(history.quarantined)} {what} quarantined: {reasons}.")
    blocks: list[Block] = [Sentences(tuple(sentences))]
    if document.sensor_faults:
        faults = tuple(
            (each.channel, format_name(each.kind), str(each.windows), format_time(each.first), format_time(each.last))
            for each in document.sensor_faults
        )
        columns = ("channel", "fault", "windows", "first (UTC)", "last (UTC)")
        blocks.append(Table("Sensor faults", columns, faults, n_words=2, ends_in_words=False))
    else:
        blocks.append(Paragraph("No sensor fault was detected in the windows of this period."))
    if document.reasons:
        reasons_met = tuple((reason, str(count)) for reason, count in document.reasons.items())
        blocks.append(Table("Why windows were not usable", ("reason", "windows"), reasons_met, ends_in_words=False))
    steps = np.diff(times)
    window = 1e9 * history.status.window if history.status is not None else 0.0
    usual = window or (float(np.median(steps)) if len(steps) else 0.0)
    gaps = tuple(
        (format_time(int(times[k])), format_time(int(times[k + 1])), f"{steps[k] / 3600e9:.1f}")
        for k in sorted(np.flatnonzero(steps > _GAP * usual), key=lambda k: -steps[k])[:_MAX_GAPS]
    )
    if gaps:
        names = ("from the window at (UTC)", "to the next one at (UTC)", "hours")
        caption = "Nothing is interpolated across a gap. A vehicle that is parked or switched off has gaps, too."
        title = "Longest times without windows"
        blocks.append(Table(title, names, gaps, n_words=2, ends_in_words=False, caption=caption))
    return blocks


def _settings(history: VehicleHistory, _: ReportDocument) -> list[Block]:
    """Return settings and versions."""
    vehicle, status, diagnosis, last = history.vehicle, history.status, history.diagnosis, history.baseline
    facts = {
        "vehicle": vehicle.vehicle,
        "channels": ", ".join(f"{name} ({quantity})" for name, quantity in dict(vehicle.channels).items()),
        "configuration of its box": vehicle.configuration,
        "first seen (UTC)": format_time(vehicle.first_seen),
        "last seen (UTC)": format_time(vehicle.last_seen),
        "length of a window": f"{status.window / 60:g} min" if status and status.window else "",
        "rate of false alarms": f"{diagnosis.false_alarms:g} per day of driving" if diagnosis else "",
    }
    known = tuple((name, value) for name, value in facts.items() if value)
    blocks: list[Block] = [Table("", ("setting", "value"), known)]
    if history.baselines:
        rows = tuple(
            (
                str(row.version),
                format_time(row.created),
                str(row.document.get("n_windows", "")),
                "" if own is None or not own.model_error else f"{100 * own.model_error:.0f}",
                row.reason,
            )
            for row, own in history.baselines
        )
        columns = ("version", "learnt (UTC)", "windows", "model error [%]", "reason")
        blocks.append(Table("Baselines", columns, rows))
    if last is not None and last.notes:
        blocks.append(Sentences(last.notes))
    return blocks


def _columns(rows: Sequence[Sequence[Any]]) -> tuple[Any, ...]:
    """Return the columns of rows as arrays."""
    return tuple(map(np.array, zip(*rows, strict=True)))


def _in_percent(ratio: float) -> str:
    """Return a relative change in percent with its sign."""
    return _with_minus(f"{100 * ratio:+z.1f}")


def _with_minus(number: str) -> str:
    """Return a number with the sign of printing."""
    return f"−{number[1:]}" if number.startswith("-") else number


def _picture(figure: "Figure", caption: str) -> Picture:
    """Return a figure as a picture."""
    return picture(figure, caption, resolution=_RESOLUTION)
