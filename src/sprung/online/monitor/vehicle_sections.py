"""Sections of the report of a vehicle that need no figures: alerts, modes, conditions, data, settings."""

import numpy as np

from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.online.monitor.vehicle_history import VehicleHistory
from sprung.online.store import Entry
from sprung.results.documents import ReportDocument
from sprung.results.documents.monitoring import RangeEntry
from sprung.results.page.page import Block, Paragraph, Section, Sentences
from sprung.results.tables import Table, alert_history_table, counted, hypotheses_table, time_in_words, with_deviation
from sprung.results.tables.table import in_words
from sprung.state import AlertState

#: Alerts of a report with all that happened to them, and gaps in the data that are listed.
_MOST_ALERTS, _MOST_GAPS = 20, 5
#: Distance of windows that is a gap, in lengths of a window.
_GAP = 1.5
#: Conditions that are shown in per cent.
_SHARES = {"standing": "%", "model_error": "%"}


def alert_section(history: VehicleHistory, document: ReportDocument) -> Section:
    """Return the section on alerts: evidence, history, verdicts."""
    if not document.alerts:
        return Section("Alerts and evidence", (Paragraph("No alert was active in this period."),))
    blocks: list[Block] = []
    for state, reported in zip((each.state for each in history.alerts), document.alerts[:_MOST_ALERTS], strict=False):
        alert = reported.alert
        cause = in_words(alert.cause) if state.is_of_suspension else alert.cause.replace(":", " ")
        title = f"Alert {alert.number}: {cause}"
        blocks.append(Table(title, ("fact", "value"), tuple(_facts(state))))
        fields = {"history": [event.as_json() for event in reported.history]}
        blocks.append(Table(f"History of alert {alert.number}", *_content(alert_history_table(fields)), n_words=3))
        if reported.verdicts:
            rows = tuple(
                (time_in_words(each.time), each.verdict, each.part, each.action, each.who) for each in reported.verdicts
            )
            columns = ("time (UTC)", "verdict", "part", "what was done", "by")
            blocks.append(Table(f"Verdicts on alert {alert.number}", columns, rows, n_words=4))
    left = len(document.alerts) - _MOST_ALERTS
    if left > 0:
        blocks.append(Paragraph(f"{counted(left, 'further alert')} of lower severity: see the export of alerts."))
    detection = None if history.diagnosis is None else history.diagnosis.detection
    if detection is not None:
        blocks.append(hypotheses_table(detection))
        numbers = f"ln evidence {detection.evidence[-1]:.1f}; threshold of an alert {detection.threshold:.1f}."
        blocks.append(Paragraph(f"Present change test: {numbers}"))
    return Section("Alerts and evidence", tuple(blocks))


def _facts(alert: AlertState) -> list[tuple[str, str]]:
    """Return what is known about an alert, by name."""
    score, losses = alert.evidence.get("score"), alert.detectable.values()
    ends = [f"{100 * end:.0f}" for end in (min(losses), max(losses))] if losses else []
    since, span = (alert.evidence.get(name) for name in ("since", "since_interval"))
    facts = {
        "finding": alert.text,
        "state": alert.state,
        "severity": f"{alert.step} ({alert.severity} of 1000)",
        "raised (UTC)": f"{time_in_words(alert.raised)}, occurrence {alert.count}",
        "cleared (UTC)": "" if alert.cleared is None else time_in_words(alert.cleared),
        "assigned to": alert.assignee or "nobody",
        "change [%]": "" if alert.change is None else in_percent(alert.change),
        "95 % interval [%]": " to ".join(map(in_percent, alert.interval or ())),
        "size over standard deviation": "" if score is None else _with_minus(f"{score:.1f}"),
        "since (UTC)": _dated(since) if since else "",
        "onset between (UTC)": " and ".join(map(_dated, span or ())),
        "second hypothesis": alert.runner_up,
        "detectable loss of any part [%]": " to ".join(dict.fromkeys(ends)),
    }
    return [(name, value) for name, value in facts.items() if value]


def mode_section(history: VehicleHistory, document: ReportDocument) -> Section:
    """Return the section on body modes and identified modes."""
    tables = [_body_modes_table(document)] if document.modes else []
    if history.modes is not None and history.modes.document.get("modes"):
        tables.append(_last_modes_table(history.modes))
    return Section("Modes", tuple(tables) or (Paragraph("No mode was identified in this period."),))


def _body_modes_table(document: ReportDocument) -> Table:
    """Return the table of the body modes over the period."""
    rows = tuple(
        (
            in_words(label),
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
    return Table("Body modes", columns, rows, ends_in_words=False, caption=caption)


def _last_modes_table(entry: Entry) -> Table:
    """Return the table of the modes of an identification."""
    rows = tuple(
        (
            str(number),
            in_words(mode.get("label") or ""),
            with_deviation(mode["natural_frequency"], mode.get("natural_frequency_std") or 0.0),
            with_deviation(100 * mode["damping_ratio"], 100 * (mode.get("damping_ratio_std") or 0.0)),
            "" if mode.get("mpc") is None else f"{mode['mpc']:.2f}",
        )
        for number, mode in enumerate(entry.document["modes"], start=1)
    )
    columns = ("number", "label", "frequency [Hz]", "damping [%]", "MPC")
    title = f"Modes identified last, from {time_in_words(entry.t0)} UTC"
    caption = "± is one standard deviation. MPC: modal phase collinearity, 1 for a shape without phase differences."
    return Table(title, columns, rows, n_words=2, ends_in_words=False, caption=caption)


def condition_section(history: VehicleHistory, document: ReportDocument) -> Section:
    """Return the section on the conditions met, next to those of the baseline."""
    if not document.conditions:
        return Section("Conditions met", (Paragraph("There is no window with known conditions."),))
    learnt = {} if history.baseline is None else history.baseline.ranges
    rows = tuple(
        (
            in_words(name),
            _SHARES.get(name, CONDITION_UNITS.get(name, "")).replace("^2", "²").replace("^3", "³"),
            *_in_unit(name, met),
            " to ".join(_value(name, end) for end in learnt[name]) if name in learnt else "",
        )
        for name, met in document.conditions.items()
    )
    columns = ("condition", "unit", "lowest", "median", "highest", "in the baseline")
    caption = "Means of windows. Conditions outside those of the baseline are allowed for, but widen the intervals."
    return Section("Conditions met", (Table("", columns, rows, n_words=2, ends_in_words=False, caption=caption),))


def _in_unit(name: str, met: RangeEntry) -> tuple[str, str, str]:
    """Return lowest, median and highest value of a condition in its unit."""
    return _value(name, met.low), _value(name, met.median), _value(name, met.high)


def _value(name: str, value: float) -> str:
    """Return the value of a condition in its unit."""
    return _with_minus(f"{100 * value if name in _SHARES else value:.3g}")


def data_section(history: VehicleHistory, document: ReportDocument) -> Section:
    """Return the section on the quality of the data."""
    n_windows = document.windows
    share = f" ({100 * document.usable / n_windows:.0f} %)" if n_windows else ""
    sentences = [f"{document.usable} of {counted(n_windows, 'window')} were usable{share}."]
    if n_windows:
        first, last = (time_in_words(int(history.times[k])) for k in (0, -1))
        sentences.append(f"The first window began at {first}, the last one at {last} UTC.")
    if history.n_earlier:
        sentences.append(f"{history.n_earlier} earlier windows of the period are left out: choose a shorter period.")
    if history.n_unreadable:
        sentences.append(f"{counted(history.n_unreadable, 'window')} of another form cannot be read by this version.")
    if history.aside:
        reasons = "; ".join(dict.fromkeys(each.reason for each in history.aside))
        n_aside = len(history.aside)
        what = "frame or state was" if n_aside == 1 else "frames or states were"
        sentences.append(f"{n_aside} {what} set aside: {reasons}.")
    blocks: list[Block] = [Sentences(tuple(sentences))]
    if document.sensor_faults:
        blocks.append(_faults_table(document))
    else:
        blocks.append(Paragraph("No sensor fault was detected in the windows of this period."))
    if document.reasons:
        rows = tuple((reason, str(count)) for reason, count in document.reasons.items())
        blocks.append(Table("Why windows were not usable", ("reason", "windows"), rows, ends_in_words=False))
    gaps = _gaps(history)
    if gaps:
        blocks.append(_gaps_table(gaps))
    return Section("Quality of the data", tuple(blocks))


def _faults_table(document: ReportDocument) -> Table:
    """Return the table of sensor faults."""
    rows = tuple(
        (each.channel, in_words(each.kind), str(each.windows), time_in_words(each.first), time_in_words(each.last))
        for each in document.sensor_faults
    )
    columns = ("channel", "fault", "windows", "first (UTC)", "last (UTC)")
    return Table("Sensor faults", columns, rows, n_words=2, ends_in_words=False)


def _gaps_table(gaps: list[tuple[float, int, int]]) -> Table:
    """Return the table of times without windows."""
    rows = tuple((time_in_words(begin), time_in_words(end), f"{hours:.1f}") for hours, begin, end in gaps)
    columns = ("from the window at (UTC)", "to the next one at (UTC)", "hours")
    caption = "Nothing is interpolated across a gap. A vehicle that is parked or switched off has gaps, too."
    return Table("Longest times without windows", columns, rows, n_words=2, ends_in_words=False, caption=caption)


def _gaps(history: VehicleHistory) -> list[tuple[float, int, int]]:
    """Return length [h], begin and end (UTC ns) of the longest times without windows."""
    times = history.times
    if len(times) < 2:
        return []
    steps = np.diff(times)
    status = history.status
    length = 1e9 * status.window if status is not None and status.window else float(np.median(steps))
    longest = sorted(np.flatnonzero(steps > _GAP * length), key=lambda k: -steps[k])[:_MOST_GAPS]
    return [(float(steps[k]) / 3600e9, int(times[k]), int(times[k + 1])) for k in longest]


def setting_section(history: VehicleHistory) -> Section:
    """Return the section on settings and versions."""
    vehicle = history.vehicle
    facts = [
        ("vehicle", vehicle.vehicle),
        ("channels", ", ".join(f"{name} ({quantity})" for name, quantity in dict(vehicle.channels).items())),
        ("configuration of its box", vehicle.configuration),
        ("first seen (UTC)", time_in_words(vehicle.first_seen)),
        ("last seen (UTC)", time_in_words(vehicle.last_seen)),
        (
            "length of a window",
            f"{history.status.window / 60:g} min" if history.status and history.status.window else "",
        ),
        ("rate of false alarms", f"{history.diagnosis.false_alarms:g} per day of driving" if history.diagnosis else ""),
    ]
    blocks: list[Block] = [Table("", ("setting", "value"), tuple((name, value) for name, value in facts if value))]
    if history.baselines:
        rows = tuple(
            (
                str(row.version),
                time_in_words(row.created),
                str(row.document.get("n_windows", "")),
                "" if own is None or not own.model_error else f"{100 * own.model_error:.0f}",
                row.reason,
            )
            for row, own in history.baselines
        )
        columns = ("version", "learnt (UTC)", "windows", "model error [%]", "reason")
        blocks.append(Table("Baselines", columns, rows))
    last = history.baseline
    if last is not None and last.notes:
        blocks.append(Sentences(last.notes))
    return Section("Settings and versions", tuple(blocks))


def reading_section() -> Section:
    """Return the section on how to read the report."""
    lines = (
        "A change is relative to the vehicle's own baseline: -20 % of a spring is a fifth of its stiffness lost. Of a"
        " damper it is damping, of a tyre stiffness.",
        "The 95 % interval contains the true value in 95 of 100 cases. A change whose interval contains 0 may be"
        " chance.",
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
    return Section("How to read this report", (Sentences(lines),))


def _content(table: Table) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return columns and rows of a table."""
    return table.columns, table.rows


def in_percent(ratio: float) -> str:
    """Return a relative change in percent with its sign."""
    return _with_minus(f"{100 * ratio:+.1f}")


def _with_minus(number: str) -> str:
    """Return a number with the sign of printing."""
    return f"−{number[1:]}" if number.startswith("-") else number


def _dated(seconds: float) -> str:
    """Return a time [s] in words."""
    return time_in_words(round(1e9 * seconds))
