"""A vehicle in values and pages: changes, trends, windows, data quality, baseline."""

import numpy as np
import pytest
from tests.online.site.conftest import HOUR, NOW, PASSWORD, raise_alert

from sprung.diagnosis import Observation, SensorFault, diagnose, learn
from sprung.errors import ParameterError
from sprung.online.monitor.histories import vehicle_state
from sprung.online.monitor.ledger import window_document
from sprung.online.site.accounts import Person, Role
from sprung.online.site.shared import require_vehicle, require_window
from sprung.online.site.vehicles.baselines import baseline
from sprung.online.site.vehicles.trends import body_modes, trends
from sprung.online.site.vehicles.windows import data_quality, window
from sprung.online.store import Progress, StoredFrame
from sprung.results.documents import baseline_document, observation_document
from sprung.vehicles import Component, read_vehicle, vehicle_text

MINUTES = 600 * 10**9
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(Component(corner, kind) for corner in CORNERS for kind in ("spring", "damper", "tyre"))
COVARIANCE = 0.01**2 * (np.eye(12) + 0.2)
SPRING = COMPONENTS.index(Component("front_left", "spring"))
FIRST = NOW - 40 * MINUTES
NAME = "bus-7"
HEADERS = {"accept": "text/html"}
PERSON = Person("anna", Role.VIEWER)


def drawn(generator, start, change=0.0, **fields):
    values = generator.multivariate_normal(np.zeros(12), COVARIANCE, method="cholesky")
    values[SPRING] += np.log1p(change)
    conditions = {"speed": 12.0, "payload": 100.0, "standing": 0.1, "temperature": 10.0}
    return Observation(start / 1e9, COMPONENTS, values, COVARIANCE, conditions, {"roll": (1.6, 0.2)}, (), **fields)


def inconclusive(start, reason):
    return Observation(start / 1e9, (), np.zeros(0), np.zeros((0, 0)), {"standing": 0.9}, {}, (), reason)


def identified(labels=("bounce", "pitch", "roll")):
    sensors = [sensor for sensor in read_vehicle("zafira").sensor if not sensor.is_condition]
    at = np.array([sensor.position for sensor in sensors])
    shapes = {"bounce": np.ones(len(at)), "pitch": -at[:, 0], "roll": at[:, 1], "wheel_hop": np.ones(len(at))}
    return [
        {
            "natural_frequency": 1.2 + 0.2 * k,
            "natural_frequency_std": 0.01,
            "damping_ratio": 0.2,
            "damping_ratio_std": None,
            "mode_shape": {"real": shapes[label].tolist(), "imag": [0.0] * len(at)},
            "mpc": 1.0,
            "label": label,
            "stable_rate": 0.5,
        }
        for k, label in enumerate(labels)
    ]


@pytest.fixture
def windows():
    """Twelve healthy windows, one in which the vehicle stood, a gap, and ten windows with a softer spring."""
    generator = np.random.default_rng(0)
    every = [(FIRST + k * MINUTES, drawn(generator, FIRST + k * MINUTES)) for k in range(12)]
    stood = FIRST + 12 * MINUTES
    every.append((stood, inconclusive(stood, "the vehicle stood still for 90 % of the time")))
    return every + [(NOW - k * MINUTES, drawn(generator, NOW - k * MINUTES, -0.2)) for k in range(10, 0, -1)]


@pytest.fixture
def observed(store, windows):
    """The store with a vehicle whose front-left spring has lost a fifth (alert 3)."""
    vehicle = read_vehicle("zafira")
    channels = [[sensor.channel, sensor.quantity] for sensor in vehicle.sensor]
    store.inbox.put_vehicle(NAME, configuration="c", description=vehicle_text(vehicle), channels=channels, now=NOW)
    store.inbox.add_frames([StoredFrame(NAME, 1, 0, NOW, b"x")], now=NOW)
    baseline = learn([window for _, window in windows[:12]])
    test = diagnose([window for _, window in windows[13:]], baseline)
    since = windows[13][0] / 1e9
    sentence = "front-left spring 20 % (19 to 21 %) softer; inspect at the next service"
    finding = {"sentence": sentence, "change": -0.2, "interval": [-0.19, -0.21], "since": since}
    store.results.commit(
        Progress(
            NAME,
            1,
            done_seq=0,
            observations=tuple((k, t0, window_document(window, test)) for k, (t0, window) in enumerate(windows)),
            modes=((0, FIRST, {"modes": []}), (1, FIRST, {"modes": identified()}), (2, NOW - HOUR, {"modes": None})),
            findings=((22, windows[-1][0], finding),),
            baselines=((1, FIRST + 13 * MINUTES, "first learning", baseline_document(baseline).as_json()),),
            status={"n_learnt": 12, "n_needed": 12, "window": 600.0, "until": NOW},
            now=NOW,
        )
    )
    text = f"{sentence}; 5 % would have been found"
    raise_alert(store, NAME, "front_left.spring", 500, text, evidence=finding, now=NOW - HOUR)
    return store


@pytest.fixture
def ask(serve):
    """Function that gives what a route of the interface returns about a vehicle."""
    context, _ = serve()

    def asked(route, vehicle=NAME, **options):
        return route(context, PERSON, require_vehicle(context, vehicle), **options)

    return asked


@pytest.mark.slow
def test_the_page_of_a_window_shows_phase_shifts_near_the_limit(observed, serve) -> None:
    shifts = {"rear_left": (24.0, 4.0), "rear_right": (38.8, 9.6), "front_left": (50.0, 3.0)}
    worn = drawn(np.random.default_rng(1), NOW, phase_shifts=shifts)
    progress = Progress(NAME, 1, done_seq=0, observations=((30, NOW, observation_document(worn)),), now=NOW)
    observed.results.commit(progress)
    _, client = serve()
    found = client.get(f"/api/v1/vehicles/{NAME}/windows/1/30").json()["inspection"]
    assert [each["verdict"] for each in found] == ["fails", "near the limit", "passes"]
    assert found[1]["low"] == pytest.approx(38.8 - 1.96 * 9.6, abs=0.01)
    page = client.get(f"/vehicles/{NAME}/windows/1/30", headers=HEADERS).text
    assert "Suspension test" in page
    assert "39° (20 to 58)" in page
    assert "Suspension test" not in client.get(f"/vehicles/{NAME}/windows/1/3", headers=HEADERS).text


def state_in(store, vehicle):
    return vehicle_state(store, vehicle, now=NOW, last_seen=NOW)


def test_a_named_part_has_the_size_of_its_finding_and_the_others_their_mean(observed, windows) -> None:
    seen = state_in(observed, NAME)
    assert (seen.reference, seen.baseline, seen.n_windows, seen.since) == ("baseline 1", 1, 10, windows[13][0])
    by_name = {part.part: part for part in seen.parts}
    spring = by_name.pop("front_left.spring")
    assert (spring.change, spring.interval, spring.verdict, spring.step) == (-0.2, (-0.21, -0.19), "change", "medium")
    baseline = learn([window for _, window in windows[:12]])
    residuals = np.mean([baseline.residual(window) for _, window in windows[13:]], axis=0)
    for k, component in enumerate(COMPONENTS):
        if k == SPRING:
            continue
        part = by_name[str(component)]
        assert part.change == pytest.approx(np.expm1(residuals[k]), abs=1e-6)
        low, high = part.interval_with_common
        assert low <= part.interval[0] < part.change < part.interval[1] <= high
        std = np.sqrt(baseline.covariance[k, k] * (1 / 10 + 1 / 12))
        assert np.diff(np.log1p(part.interval)) == pytest.approx(2 * 1.96 * std, rel=1e-6)
        assert (part.alert, part.detectable is not None) == (None, True)


def found_at(store, since):
    """Raise an alert with an onset, UTC ns, more severe than those before."""
    raise_alert(store, NAME, "front_left.spring", 900, "front-left spring 21 % softer", evidence={"since": since / 1e9})


def test_the_window_of_the_onset_counts_however_its_time_is_rounded(observed) -> None:
    """Seconds since 1970 have a resolution of 238 ns in double precision."""
    rounded_up = next(time for time in range(NOW - MINUTES // 2, NOW) if round(time / 1e9 * 1e9) > time)
    window = drawn(np.random.default_rng(1), rounded_up, -0.2)
    late = ((50, rounded_up, observation_document(window)),)
    observed.results.commit(Progress(NAME, 1, done_seq=0, observations=late, now=NOW))
    found_at(observed, rounded_up)
    seen = state_in(observed, NAME)
    assert (seen.n_windows, seen.since) == (1, rounded_up)


def test_parts_have_values_before_the_windows_of_an_alert_are_stored(observed) -> None:
    found_at(observed, NOW)
    assert len(state_in(observed, NAME).parts) == 12


def test_without_a_baseline_values_are_those_of_the_vehicle_file_and_not_judged(observed, windows) -> None:
    observed.results.commit(
        Progress("bus-3", 2, done_seq=-1, observations=((0, NOW, observation_document(windows[0][1])),), now=NOW)
    )
    seen = state_in(observed, "bus-3")
    assert (seen.reference, seen.n_windows) == ("the vehicle file", 1)
    assert [part.change for part in seen.parts] == pytest.approx(np.expm1(windows[0][1].log_ratios))
    assert {(part.verdict, part.detectable) for part in seen.parts} == {("inconclusive", None)}
    assert "no baseline yet" in seen.notes[0]


def test_a_baseline_that_cannot_be_read_is_the_reason_of_doubt(observed, windows) -> None:
    stored = ((0, NOW, observation_document(windows[0][1])),)
    unreadable = ((1, NOW, "first learning", {"schema": "sprung.baseline/1"}),)
    observed.results.commit(Progress("bus-3", 2, done_seq=-1, observations=stored, baselines=unreadable, now=NOW))
    seen = state_in(observed, "bus-3")
    assert (seen.verdict, seen.baseline) == ("inconclusive", None)
    assert "the baseline cannot be read" in seen.sentence


def test_trends_have_gaps_bands_and_marks(observed, windows, ask) -> None:
    seen = ask(trends, until=NOW)
    gap = seen.windows.index(None)
    assert (len(seen.times), gap) == (len(windows) + 1, 13)
    assert seen.times[gap] == windows[12][0] + MINUTES
    spring = next(part for part in seen.parts if part.part == "front_left.spring")
    assert [spring.change[12], spring.change[13]] == [None, None]
    assert seen.remarks[12:14] == ("the vehicle stood still for 90 % of the time", "no data")
    baseline = learn([window for _, window in windows[:12]])
    residual, half = baseline.residual(windows[14][1])[SPRING], 1.96 * np.sqrt(COVARIANCE[0, 0])
    ends = [spring.change[15], spring.low[15], spring.high[15]]
    assert ends == pytest.approx(np.expm1([residual, residual - half, residual + half]))
    usual = 1.96 * np.sqrt((baseline.covariance + baseline.nuisance)[SPRING, SPRING])
    assert spring.band == pytest.approx(np.expm1([-usual, usual]))
    assert [(mark.kind, mark.link) for mark in seen.marks] == [
        ("baseline", f"/vehicles/{NAME}/baseline"),
        ("alert", "/alerts/3"),
    ]
    assert [mode.label for mode in seen.modes] == ["bounce", "pitch", "roll"]
    assert seen.modes[0].natural_frequency == (1.2, None, None)
    later = ask(trends, since=windows[13][0], until=NOW)
    assert later.times == tuple(t0 for t0, _ in windows[13:])


def test_ranges_without_windows_are_empty(observed, ask) -> None:
    for vehicle, since in ((NAME, NOW + 1), ("bus-3", None)):
        seen = ask(trends, vehicle, since=since, until=NOW + 2)
        assert (seen.times, seen.parts, seen.mode_times, seen.modes) == ((), (), (), ())


def test_the_body_moves_as_its_shapes_say(observed, ask) -> None:
    body = ask(body_modes)
    assert [mode.label for mode in body.modes] == ["bounce", "pitch", "roll"]
    bounce, pitch, roll = (np.array(mode.real) / np.max(np.abs(mode.real)) for mode in body.modes)
    np.testing.assert_allclose(bounce, bounce[0])
    assert pitch[0] == pytest.approx(pitch[1])
    assert pitch[0] * pitch[2] < 0
    assert roll[0] == pytest.approx(-roll[1])
    assert all(mode.explained == pytest.approx(1.0) for mode in body.modes)
    assert ask(body_modes, "bus-3").note == "no mode of the body has been identified yet"


def test_data_quality_counts_faults_by_check(observed, windows, ask) -> None:
    faulty = [
        Observation(
            t0 / 1e9,
            (),
            np.zeros(0),
            np.zeros((0, 0)),
            {},
            {},
            (SensorFault("acc_rr", "dead", "it is constant"), SensorFault("acc_fl", "clipped", "2 %"))[: 1 + (k == 0)],
            "too few sensors",
        )
        for k, (t0, _) in enumerate([(NOW + MINUTES, None), (NOW + 2 * MINUTES, None)])
    ]
    later = tuple((30 + k, round(window.time * 1e9), observation_document(window)) for k, window in enumerate(faulty))
    observed.results.commit(Progress(NAME, 1, done_seq=-1, observations=later, now=NOW))
    quality = ask(data_quality)
    assert (quality.n_windows, quality.n_inconclusive) == (25, 3)
    assert [channel.channel for channel in quality.channels][:2] == ["acc_rr", "acc_fl"]
    assert [channel.is_good for channel in quality.channels] == [False] + [True] * (len(quality.channels) - 1)
    found = {(c.channel, check.name): check for c in quality.channels for check in c.checks if check.n_faults}
    assert set(found) == {("acc_rr", "signal"), ("acc_fl", "clipping")}
    assert (found["acc_rr", "signal"].n_faults, found["acc_rr", "signal"].text) == (2, "dead: it is constant")
    assert not found["acc_fl", "clipping"].is_present


def test_any_window_is_opened_again(observed, windows, serve) -> None:
    context, _ = serve()

    def seen_at(number):
        row = require_vehicle(context, NAME)
        return window(context, PERSON, require_window(context, row, 1, number))

    seen = seen_at(14)
    assert (seen.before, seen.after, seen.window.t0) == ("1/13", "1/15", windows[14][0])
    assert {condition.name: (condition.value, condition.unit) for condition in seen.conditions} == {
        "speed": (12.0, "m/s"),
        "payload": (100.0, "kg"),
        "standing": (10.0, "%"),
        "temperature": (10.0, "°C"),
    }
    spring = next(part for part in seen.parts if part.part == "front_left.spring")
    assert spring.interval[0] < -0.2 < spring.interval[1]
    assert [mode.label for mode in seen.modes] == ["roll"]
    first = seen_at(0)
    assert [mode.natural_frequency for mode in first.modes] == pytest.approx([1.2, 1.4, 1.6])
    stood = seen_at(12)
    assert (stood.reason, stood.parts) == ("the vehicle stood still for 90 % of the time", ())
    last = seen_at(22)
    assert (last.after, len(last.findings)) == (None, 1)
    with pytest.raises(ParameterError, match="unknown window 1/99"):
        seen_at(99)


@pytest.mark.parametrize(
    ("end", "status", "words"), [("?range=2y", 422, "range"), ("/windows/1/99", 404, "unknown window")]
)
def test_what_does_not_exist_is_said(observed, serve, end, status, words) -> None:
    _, client = serve()
    answer = client.get(f"/vehicles/{NAME}{end}", headers=HEADERS)
    assert (answer.status_code, words in answer.text) == (status, True), answer.text
    corner = client.get(f"/vehicles/{NAME}?range=24h&corner=rear_right", headers=HEADERS).text
    assert 'data-corner="rear_right"' in corner


@pytest.mark.slow
def test_a_new_baseline_is_requested_with_a_reason_by_an_engineer(observed, serve, people) -> None:
    context, client = serve()
    path = f"/vehicles/{NAME}/baseline"
    for name, allowed in (("anna", False), ("eve", True)):
        client.post("/api/v1/session", json={"name": name, "password": PASSWORD})
        token = client.get("/api/v1/session").json()["csrf_token"]
        assert ('<form class="stack"' in client.get(path, headers=HEADERS).text) is allowed
        answer = client.post(
            path, data={"csrf_token": token, "reason": "new <b>dampers"}, headers=HEADERS, follow_redirects=False
        )
        assert answer.status_code == (303 if allowed else 403)
    page = client.get(answer.headers["location"], headers=HEADERS)
    assert f"{NAME} will learn a new baseline from its next usable windows." in page.text
    (command,) = context.store.requests.open_commands()
    assert (command.vehicle, command.act, command.detail, command.who) == (NAME, "learn", "new <b>dampers", "eve")
    empty = client.post(path, data={"csrf_token": token, "reason": " "}, headers=HEADERS)
    assert (empty.status_code, "Give a reason" in empty.text) == (422, True)
    assert client.post(path, data={"reason": "x"}, headers=HEADERS).status_code == 403


@pytest.fixture
def relearnt(observed):
    """The vehicle with a second baseline, which Anna requested."""
    (first,) = observed.results.baselines(NAME)
    now = NOW - HOUR
    number = observed.requests.add_command("anna", NAME, "learn", "new dampers", now=now)
    observed.requests.command_done(number, now + 1)
    second = (2, now + 2, "new dampers", first.document | {"version": 2, "reason": "new dampers", "n_refused": 3})
    observed.results.commit(Progress(NAME, 1, done_seq=-1, baselines=(second,), now=NOW))
    return observed


def test_versions_of_a_baseline_state_who_why_and_what_they_met(relearnt, ask) -> None:
    second, first = ask(baseline).versions
    assert (second.version, second.who, second.reason) == (2, "anna", "new dampers")
    assert (second.windows, second.refused, second.is_restorable) == (12, 3, False)
    assert (first.version, first.who, first.reason, first.is_restorable) == (1, None, "first learning", True)
    assert {(each.name, each.low, each.high, each.unit) for each in first.ranges} == {
        ("speed", 12.0, 12.0, "m/s"),
        ("payload", 100.0, 100.0, "kg"),
        ("temperature", 10.0, 10.0, "°C"),
    }


def test_an_engineer_returns_to_an_earlier_baseline(relearnt, serve, people, ask) -> None:
    _, client = serve()
    path = f"/vehicles/{NAME}/baseline"
    token = client.post("/api/v1/session", json={"name": people["engineer"], "password": PASSWORD}).json()["csrf_token"]
    for fields, words in (
        ({"version": "1", "reason": " "}, "Give a reason"),
        ({"version": "2", "reason": "x"}, "baseline 2 of bus-7 is in use"),
        ({"version": "²", "reason": "x"}, "has no baseline 0"),
    ):
        refused = client.post(f"{path}/rollback", data={**fields, "csrf_token": token}, headers=HEADERS)
        assert (refused.status_code, words in refused.text) == (422, True), words
    address, given = f"/api/v1/vehicles/{NAME}/baselines", {"reason": "broken spring"}
    headers = {"X-CSRF-Token": token}
    assert client.post(f"{address}/7/rollback", json=given, headers=headers).status_code == 409
    assert client.post(f"{address}/1/rollback", json=given, headers=headers).status_code == 202
    given = {"version": "1", "reason": "broken spring", "csrf_token": token}
    done = client.post(f"{path}/rollback", data=given, headers=HEADERS, follow_redirects=False)
    assert (done.status_code, done.headers["location"]) == (303, f"{path}?notice=rollback")
    detail = {"version": 1, "reason": "broken spring"}
    asked = [(command.act, command.who, command.detail) for command in relearnt.requests.open_commands()]
    assert asked[-1] == ("roll back", people["engineer"], detail)
    assert ask(baseline).requested_version == 1


def test_tables_are_a_form_away(observed, serve) -> None:
    """A form without dates asks for everything."""
    _, client = serve()
    given = {"what": "windows", "format": "csv", "since": "", "until": ""}
    every = client.get(f"/vehicles/{NAME}/export", params=given)
    assert every.text == client.get(f"/api/v1/vehicles/{NAME}/export").text
    assert client.get(f"/vehicles/{NAME}/export", params=given | {"since": "soon"}).status_code == 422


@pytest.mark.slow
def test_texts_of_vehicles_are_no_markup(observed, serve) -> None:
    name = "<script>alert(1)</script>"
    observed.inbox.put_vehicle(name, configuration="c", description="", channels=[["<b>a", "<i>"]], now=NOW)
    windows = ((0, NOW, observation_document(inconclusive(NOW, "<img src=x>"))),)
    observed.results.commit(Progress(name, 1, done_seq=-1, observations=windows, now=NOW))
    _, client = serve()
    path = "/vehicles/%3Cscript%3Ealert(1)%3C%2Fscript%3E"
    for end in ("", "/windows", "/windows/1/0", "/windows/1/0/diagrams", "/diagrams", "/data", "/baseline"):
        answer = client.get(path + end, headers=HEADERS)
        if answer.status_code == 200:
            assert "<script>alert" not in answer.text
            assert "<img" not in answer.text
            assert "<b>a" not in answer.text


@pytest.mark.parametrize(
    ("modes", "note"),
    [
        ([{"label": "bounce", "natural_frequency": 1.2, "damping_ratio": 0.2}], "cannot be drawn"),
        ([{**identified()[0], "mode_shape": {"real": [1.0], "imag": [0.0]}}, "roll"], "they have 1 channels"),
        ([{**identified()[0], "natural_frequency": "fast"}], "no mode of the body"),
        ("bounce", "no mode of the body"),
        ([None, 5, {"label": ["roll"]}], "no mode of the body"),
    ],
)
def test_reported_modes_that_make_no_sense_are_not_drawn(observed, serve, ask, modes, note) -> None:
    observed.results.commit(Progress("bus-3", 5, done_seq=-1, modes=((0, NOW, {"modes": modes}),), now=NOW))
    observed.inbox.put_vehicle(
        "bus-3",
        configuration="c",
        description=vehicle_text(read_vehicle("zafira")),
        channels=[[sensor.channel, sensor.quantity] for sensor in read_vehicle("zafira").sensor],
        now=NOW,
    )
    assert note in ask(body_modes, "bus-3").note
    _, client = serve()
    assert client.get("/vehicles/bus-3", headers=HEADERS).status_code == 200
    assert client.get("/api/v1/vehicles/bus-3/trends").status_code == 200
