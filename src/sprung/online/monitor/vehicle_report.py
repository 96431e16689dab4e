"""The report of a vehicle and period: one page that reads without a monitor."""

import platform
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from sprung import __version__
from sprung.online.alerts import STEPS
from sprung.online.monitor.vehicle_document import report_document
from sprung.online.monitor.vehicle_history import VehicleHistory, read_history
from sprung.online.monitor.vehicle_sections import (
    alert_section,
    condition_section,
    data_section,
    in_percent,
    mode_section,
    reading_section,
    setting_section,
)
from sprung.online.store import Store
from sprung.results.documents import ReportDocument
from sprung.results.documents.monitoring import ReportedAlert
from sprung.results.page.page import Block, Paragraph, Picture, Report, Section, picture
from sprung.results.periods import Period
from sprung.results.tables import Table, counted, time_in_words
from sprung.results.tables.table import in_words
from sprung.vehicles import Component

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Resolution of the figures [dots per inch].
_RESOLUTION = 120


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
    sections = (
        _state_section(history, document),
        _trend_section(history),
        alert_section(history, document),
        mode_section(history, document),
        condition_section(history, document),
        data_section(history, document),
        setting_section(history),
        reading_section(),
    )
    return Report(
        f"{vehicle}: report {_period_in_words(period, history)}",
        document.sentence,
        sections,
        document=document.as_json(),
        footer=_footer(now),
    )


def _state_section(history: VehicleHistory, document: ReportDocument) -> Section:
    """Return the section on the changes of all components."""
    if not document.changes or document.changes_since is None:
        why = "no baseline yet" if document.baseline is None else "no window that can be compared with the baseline"
        return Section("Springs, dampers and tyres", (Paragraph(f"There is {why}: changes are not known."),))
    since = time_in_words(document.changes_since)
    rows = tuple(
        (
            in_words(change.component),
            in_percent(change.change),
            " to ".join(map(in_percent, change.interval)),
            "" if change.detectable is None else f"{100 * change.detectable:.0f}",
            _alert_of_part(document.alerts, change.component),
        )
        for change in document.changes
    )
    columns = ("part", "change [%]", "95 % interval [%]", "detectable loss [%]", "alert")
    caption = (
        f"Mean of {counted(history.state.n_windows, 'window')} since {since} UTC against baseline {document.baseline},"
        " under the conditions of each; of a part that an alert names, the size of its finding. Common effects such as"
        " payload and temperature may move all corners alike: compare left with right. Detectable: with 95 % power."
    )
    return Section("Springs, dampers and tyres", (_plan(history, document), Table("", columns, rows, caption=caption)))


def _plan(history: VehicleHistory, document: ReportDocument) -> Picture:
    """Return the vehicle from above."""
    from sprung.results.figures import plan_figure

    state = history.state
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
    return _picture(figure, f"The vehicle from above, and the change of every part. {signs}")


def _trend_section(history: VehicleHistory) -> Section:
    """Return the section on components, body modes and findings over dates."""
    from sprung.diagnosis.deviations import usual_std
    from sprung.results.figures import (
        Stretch,
        components_history_figure,
        evidence_history_figure,
        findings_history_figure,
        modes_history_figure,
    )

    blocks: list[Block] = []
    deviations = history.deviations()
    if deviations is not None:
        end = int(history.times[-1])
        figure = components_history_figure(
            deviations.times,
            deviations.log_ratios,
            deviations.std,
            components=deviations.baseline.components,
            usual=usual_std(deviations.baseline),
            alerts=[
                Stretch(alert.row.cause, begin, end if stop is None else stop)
                for alert in history.alerts
                for begin, stop in alert.spans
            ],
            baselines=[round(1e9 * min(own.taught)) for _, own in history.baselines[1:] if own and own.taught],
        )
        blocks.append(_picture(figure, "Every part over time. A new baseline sets the change back to zero."))
    modes = _modes_over_time(history)
    if modes:
        blocks.append(_picture(modes_history_figure(modes), "Body modes of the fitted vehicle."))
    sizes = _sizes_over_time(history)
    if sizes:
        blocks.append(_picture(findings_history_figure(sizes), "Size of each finding after every window."))
    detection = None if history.diagnosis is None else history.diagnosis.detection
    if detection is not None:
        times = np.round(1e9 * detection.times).astype(np.int64)
        shown = np.ones(len(times), dtype=np.bool_) if history.period.since is None else times >= history.period.since
        if shown.any():
            figure = evidence_history_figure(times[shown], detection.evidence[shown], threshold=detection.threshold)
            blocks.append(_picture(figure, "Evidence of any change in the present change test."))
    return Section("Trends", tuple(blocks) or (Paragraph("There is no usable window to draw."),))


def _modes_over_time(history: VehicleHistory) -> dict[str, Any]:
    """Return times, frequencies and damping ratios of each body mode."""
    labels = dict.fromkeys(label for window in history.windows for label in window.modes)
    found = {}
    for label in labels:
        numbers = [k for k, window in enumerate(history.windows) if label in window.modes]
        values = np.array([history.windows[k].modes[label] for k in numbers])
        found[label] = (history.times[numbers], values[:, 0], values[:, 1])
    return found


def _sizes_over_time(history: VehicleHistory) -> dict[str, Any]:
    """Return times, and size with interval, of each finding that has a size."""
    sizes: dict[str, list[tuple[int, list[float]]]] = {}
    for entry in history.findings:
        document = entry.document
        if document.get("change") is not None and document.get("interval"):
            name = f"{document['corner']}.{document['component']}"
            sizes.setdefault(name, []).append((entry.t0, [document["change"], *document["interval"]]))
    return {
        name: (np.array([time for time, _ in each], dtype=np.int64), np.array([values for _, values in each]))
        for name, each in sizes.items()
    }


def _alert_of_part(alerts: Iterable[ReportedAlert], component: str) -> str:
    """Return number and state of the alert of a component; empty without one."""
    return "; ".join(f"{each.alert.number}: {each.alert.state}" for each in alerts if each.alert.cause == component)


def _period_in_words(period: Period, history: VehicleHistory) -> str:
    """Return the period in words."""
    begin = period.since if period.since is not None else int(history.times[0]) if len(history.times) else None
    end = period.until if period.until is not None else int(history.times[-1]) if len(history.times) else None
    # Whole seconds: a day that ends a nanosecond before midnight is that day.
    parts = [
        f"{word} {time_in_words(time // 10**9 * 10**9)}"
        for word, time in (("from", begin), ("to", end))
        if time is not None
    ]
    return f"{' '.join(parts)} UTC" if parts else "of a period without windows"


def _picture(figure: "Figure", caption: str) -> Picture:
    """Return a figure as a picture."""
    return picture(figure, caption, resolution=_RESOLUTION)


def _footer(now: int) -> str:
    """Return versions and time of a report in a line."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "matplotlib"))
    written = f"{datetime.fromtimestamp(now // 10**9, tz=UTC):%Y-%m-%d %H:%M} UTC"
    return f"sprung {__version__} (Python {platform.python_version()}, {packages}); written {written}"
