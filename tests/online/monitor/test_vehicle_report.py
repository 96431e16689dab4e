"""The report of a vehicle over two months: complete, self-contained, with the numbers of the store."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from tests.online.monitor.history_store import (
    BEGIN,
    DAY,
    DEAD_DAY,
    HOSTILE,
    MISSING_DAY,
    ONSET_DAY,
    PER_DAY,
    VEHICLE,
    fill,
)

from sprung.diagnosis.baseline import mean_deviation
from sprung.errors import ParameterError
from sprung.online.monitor.exports import report_document
from sprung.online.monitor.histories import read_history
from sprung.online.monitor.vehicle_report import vehicle_report
from sprung.online.store import Progress, open_store
from sprung.results.documents import baseline_from_document, observation_from_document
from sprung.results.page import render
from sprung.results.page.page import Picture
from sprung.results.tables import Table
from sprung.results.tables.wording import Period

pytestmark = pytest.mark.slow

TITLES = [
    "Springs, dampers and tyres",
    "Trends",
    "Alerts and evidence",
    "Modes",
    "Conditions met",
    "Quality of the data",
    "Settings and versions",
    "How to read this report",
]
NS = 10**9
END = (BEGIN + 60 * DAY) * NS


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    with open_store(f"sqlite:///{tmp_path_factory.mktemp('store')}/store.sqlite") as opened:
        fill(opened)
        yield opened


@pytest.fixture(scope="module")
def whole(store):
    return vehicle_report(store, VEHICLE, period=Period(), now=END)


@pytest.fixture(scope="module")
def page(whole):
    return render(whole)


def document_at(store, since=None, until=None):
    """Report of the days from one to another as a document."""
    ends = (None if day is None else (BEGIN + day * DAY) * NS for day in (since, until))
    return report_document(read_history(store, VEHICLE, Period(*ends), now=END), now=0)


class Checker(HTMLParser):
    """Checks that elements are closed in order, and collects headings and addresses."""

    VOID = frozenset({"meta", "img", "br", "link", "input", "hr"})

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.headings, self.scripts = [], [], [], []

    def handle_starttag(self, tag, attrs):
        fields = dict(attrs)
        self.addresses += [fields[name] for name in ("src", "href", "srcset", "action") if name in fields]
        assert not any(name.startswith("on") for name in fields)
        if tag == "script":
            self.scripts.append(fields.get("type"))
        if tag == "img":
            assert fields["alt"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)


def test_page_is_valid_complete_and_needs_no_network(page) -> None:
    checker = Checker()
    checker.feed(page)
    checker.close()
    assert checker.open == []
    assert checker.headings == TITLES
    assert checker.scripts == ["application/json"]  # data, which no browser runs
    assert checker.addresses
    assert all(address.startswith("data:image/png;base64,") for address in checker.addresses)
    assert not re.search(r"https?:|@import|url\(", page)
    assert page.count("<figure>") == 4  # from above, parts, modes, findings
    assert "size: A4" in page


def test_people_and_vehicles_write_text_only(page) -> None:
    assert "<script>alert(1)" not in page
    assert "=1+1 &lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert (
        HOSTILE
        in json.loads(re.findall(r'id="result">(.*?)</script>', page, flags=re.DOTALL)[0])["alerts"][0]["history"][1][
            "comment"
        ]
    )


def test_numbers_are_those_of_the_store(store, whole, check_document) -> None:
    document = check_document(whole.document)
    entries = store.results.observations(VEHICLE)
    windows = [observation_from_document(entry.document) for entry in entries]
    baseline = baseline_from_document(store.results.baselines(VEHICLE)[0].document)
    assert document["windows"] == len(windows)
    assert document["usable"] == len(windows) - PER_DAY
    since = BEGIN + ONSET_DAY * DAY
    assert document["changes_since"] == since * NS
    mean = mean_deviation(baseline, [window for window in windows if window.time >= since])
    spring, *others = document["changes"]
    assert (spring["component"], spring["change"], spring["interval"]) == ("front_left.spring", -0.25, [-0.27, -0.23])
    np.testing.assert_allclose([change["change"] for change in others], np.expm1(mean.log_ratios[1:]))
    for name, std in (("interval", mean.std_by_chance), ("interval_with_common", mean.std)):
        ends = np.expm1(np.array([mean.log_ratios - 1.96 * std, mean.log_ratios + 1.96 * std])).T
        np.testing.assert_allclose([change[name] for change in others], ends[1:])
    stated = entries[-1].document["conclusion"]["detectable"]
    assert {change["component"]: change["detectable"] for change in document["changes"]} == stated
    frequencies = [window.modes["bounce"][0] for window in windows if window.is_conclusive]
    bounce = document["modes"]["bounce"]["natural_frequency"]
    assert (bounce["low"], bounce["high"]) == (min(frequencies), max(frequencies))
    assert bounce["median"] == pytest.approx(np.median(frequencies))
    speeds = [window.conditions["speed"] for window in windows]
    assert document["conditions"]["speed"] == {"low": min(speeds), "median": 12.0, "high": max(speeds)}
    (fault,) = document["sensor_faults"]
    first = (BEGIN + DEAD_DAY * DAY) * NS
    assert fault == {
        "channel": "acc_fl",
        "kind": "dead",
        "windows": PER_DAY,
        "first": first,
        "last": first + (PER_DAY - 1) * 600 * NS,
    }
    assert document["reasons"] == {"acc_fl is dead": PER_DAY}


def test_the_sentence_says_what_matters_in_the_period(store, whole) -> None:
    assert whole.verdict == "Front-left spring 25 % (23 to 27 %) softer; inspect before the next 500 km."
    healthy = document_at(store, 0, DEAD_DAY - 1)
    assert healthy.verdict == "no_change_detected"
    assert re.match(
        r"No change detected; a change of \d+ to \d+ % of any part would have been found\.", healthy.sentence
    )
    faulty = document_at(store, 10, DEAD_DAY + 0.5)
    assert (faulty.verdict, faulty.sentence) == ("fault", "Sensor acc_fl is dead.")
    assert document_at(store, 10, DEAD_DAY + 5).verdict == "no_change_detected"
    missing = document_at(store, MISSING_DAY, MISSING_DAY + 0.9)
    assert (missing.verdict, missing.sentence) == (
        "inconclusive",
        "Inconclusive: no change detected, but no window since its learning can be compared with the baseline.",
    )
    empty = document_at(store, 70, 80)
    assert (empty.verdict, empty.windows, empty.changes, empty.changes_since) == ("change", 0, (), None)
    before = document_at(store, -10, -5)
    assert (before.verdict, before.sentence) == (
        "inconclusive",
        "Inconclusive: no change detected, but there is no baseline to compare with.",
    )


def test_an_alert_on_old_samples_counts_from_the_onset(store) -> None:
    """As after a replay, or where a box was offline."""
    alert = next(each for each in read_history(store, VEHICLE, Period(), now=END).alerts if each.alert.number == 2)
    late = replace(alert, history=tuple(replace(event, time=event.time + 90 * DAY * NS) for event in alert.history))
    onset = (BEGIN + ONSET_DAY * DAY) * NS
    assert late.spans == [(onset, None)]
    assert (late.is_active_at(onset + DAY * NS), late.is_active_at(onset - 1)) == (True, False)


def test_changes_count_from_the_onset_or_the_baseline(store) -> None:
    early = document_at(store, 0, 4)
    assert early.changes_since == store.results.observations(VEHICLE)[12].t0
    before = document_at(store, 0, ONSET_DAY - 1)
    windows = store.results.observations(VEHICLE, until=(BEGIN + (ONSET_DAY - 1) * DAY) * NS)
    assert before.changes_since == windows[-12].t0
    assert all(change.interval_with_common[0] < 0 < change.interval_with_common[1] for change in before.changes)
    after = {change.component: change for change in document_at(store).changes}
    damper = after["front_left.damper"]
    assert damper.interval_with_common[0] < damper.interval[0] < damper.change
    assert damper.change < damper.interval[1] < damper.interval_with_common[1]


@pytest.mark.parametrize("status", [None, {"n_learnt": 4, "n_needed": 12, "is_learning": True, "window": 600.0}])
def test_a_vehicle_without_results_has_a_report(tmp_path, status) -> None:
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        opened.inbox.put_vehicle("new", configuration="", description="", channels=[], now=NS)
        if status is not None:
            old = tuple((k, k * NS, {"time": k}) for k in range(3))
            opened.results.commit(Progress("new", 1, done_seq=-1, observations=old, status=status))
        report = vehicle_report(opened, "new", period=Period(), now=NS)
        assert report.document is not None
        assert report.document["verdict"] == ("waiting" if status is None else "learning")
        assert [section.title for section in report.sections] == TITLES
        page = render(report)
        assert ("3 windows of another form cannot be read" in page) == (status is not None)
        with pytest.raises(ParameterError, match="unknown vehicle 'none'"):
            vehicle_report(opened, "none", period=Period(), now=NS)


def test_windows_are_compared_with_the_baseline_in_force(store) -> None:
    history = read_history(store, VEHICLE, Period(), now=END)
    row, first = history.baselines[0]
    assert first is not None
    later = replace(first, version=2, mean=first.mean + 1.0, learning_times=(history.windows[100].time,))
    both = replace(history, baselines=((row, first), (replace(row, version=2), later)))
    assert both.baseline_of(history.windows[99]) is first
    assert both.baseline_of(history.windows[100]) is later
    one, two = history.deviations(), both.deviations()
    assert one is not None
    assert two is not None
    changed = two.times >= history.times[100]
    np.testing.assert_allclose(two.log_ratios[~changed], one.log_ratios[~changed])
    np.testing.assert_allclose(two.log_ratios[changed], one.log_ratios[changed] - 1.0)


def test_a_monitor_that_runs_has_a_report_with_its_change_test(bench, drive, frames_of, check_document) -> None:
    """Two windows that taught and one with a soft spring, as the monitor stored them."""
    station = bench(watch={"learning_windows": 2, "identify_every_minutes": 0})
    station.describe()
    for number, fault in enumerate((None, None, "front_left.spring=-0.3")):
        station.send(frames_of(drive(number, fault), first=600 * number))
    report = vehicle_report(station.store, "car-1", period=Period(), now=station.now)
    (row,) = station.store.alerts.find(vehicle="car-1", is_active=True)
    stated = row.evidence["sentence"]
    assert report.verdict == f"{stated[:1].upper()}{stated[1:]}."
    assert report.verdict.startswith("Front-left spring ")
    document = check_document(report.document)
    (spring,) = (change for change in document["changes"] if change["component"] == "front_left.spring")
    assert spring["change"] == pytest.approx(row.evidence["change"], abs=0.05)
    assert document["alerts"][0]["evidence"] == row.evidence
    blocks = {section.title: section.blocks for section in report.sections}
    captions = [block.caption for block in blocks["Trends"] if isinstance(block, Picture)]
    assert captions[-1] == "Evidence of any change in the present change test."
    titles = [block.title for block in blocks["Alerts and evidence"] if isinstance(block, Table)]
    assert titles[-1] == "Hypotheses of a change, best first"
