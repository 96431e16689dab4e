"""Several monitors on one store: each vehicle is worked for by one of them, and nothing is lost or stored twice."""

from pathlib import Path

import pytest
from sqlalchemy import create_engine, make_url, text

from sprung.link import checked_map, message, parse_topic, topic
from sprung.online.monitor.shards import Shards
from sprung.online.store import LeaseLostError, StoreError, open_store
from sprung.vehicles import vehicle_text

WATCH = {
    "watch": {
        "window_minutes": 1.0,
        "identify_every_minutes": 0.0,
        "learning_windows": 2,
        "takeover_seconds": 3600.0,  # the database's clock is not that of the tests
    },
    "keep": {"raw_days": 0},
}
#: With two monitors, the first holds the lower half of the shards: those of the first two vehicles.
VEHICLES = ["car-2", "zafira", "car-1", "car-3"]


@pytest.fixture
def new_shards(postgresql_url):
    """A function that returns the shards of a monitor, and a list whose element is the time on their timer."""
    seconds = [0.0]
    with open_store(postgresql_url) as store:
        yield lambda name: Shards(store, patience=30.0, timer=lambda: seconds[0], name=name), seconds


def test_shards_are_renewed_every_two_seconds_and_nothing_is_sent_after_the_patience(new_shards) -> None:
    made, seconds = new_shards
    own = made("a")
    with pytest.raises(LeaseLostError, match="car-1 was taken over by another monitor"):
        own.fence("car-1")
    assert len(own.renew().gained) == 256
    assert own.holds("car-1")
    assert own.is_first
    seconds[0] = 1.9
    assert own.renew().gained == ()
    seconds[0] = 29.9
    assert own.is_first
    seconds[0] = 30.0
    assert not own.is_first
    assert own.holds("car-1")  # writing is for the store to refuse
    own.renew()
    assert own.is_first


def test_second_monitor_gains_what_the_first_loses(new_shards) -> None:
    made, seconds = new_shards
    first, second = made("a"), made("b")
    first.renew(), second.renew()
    seconds[0] = 2.0
    lost = first.renew().lost
    gained = second.renew().gained
    assert set(lost) == set(gained) == set(range(128, 256))
    assert (first.holds("car-2"), second.holds("car-2")) == (True, False)
    assert (first.holds("car-1"), second.holds("car-1")) == (False, True)
    assert (first.is_first, second.is_first) == (True, False)
    first.close()
    seconds[0] = 4.0
    assert set(second.renew().gained) == set(range(128))


class Fleet:
    """Monitors on one store, and a broker that gives each frame to one of them in turn, and the rest to all."""

    def __init__(self, monitors, url):
        self.monitors, self.turn = monitors, 0
        self.engine = create_engine(make_url(url).set(drivername="postgresql+psycopg"))

    def send(self, name, payload):
        if "$share/sprung/sprung/v1/+/" + parse_topic(name)[1] in self.monitors[0].link.topics:
            self.turn = (self.turn + 1) % len(self.monitors)
            self.monitors[self.turn].link.on_message(name, payload)
        else:
            for monitor in self.monitors:
                monitor.link.on_message(name, payload)

    def describe(self, vehicle, car):
        quantities = self.monitors[0].quantities
        self.send(
            topic(vehicle, "meta"),
            message({0: 1, 14: "c", "description": vehicle_text(car), "quantities": quantities}),
        )

    def work(self, *monitors):
        """Let monitors take in, and then look into the store, until none has anything to do."""
        for _ in range(3):
            for monitor in monitors or self.monitors:
                monitor.look(2.0)

    def silence(self, monitor):
        """Let the database believe that it has heard nothing of a monitor for two hours."""
        name = monitor.station._shards._name
        with self.engine.begin() as connection:
            passed = {"name": name}
            connection.execute(text("UPDATE monitors SET seen = seen - 7200000000000 WHERE monitor = :name"), passed)


@pytest.fixture
def fleet(bench, postgresql_url, tmp_path: Path):
    made = Fleet([bench(tmp_path / str(number), url=postgresql_url, **WATCH) for number in range(2)], postgresql_url)
    yield made
    made.engine.dispose()


def results(store, vehicle):
    return [(row.t0, row.document) for row in store.results.observations(vehicle)]


def events(store, vehicle):
    return [
        (alert.cause, alert.is_active, [(event.what, event.comment) for event in store.alerts.history(alert.id or 0)])
        for alert in store.alerts.find(vehicle=vehicle)
    ]


@pytest.fixture(scope="module")
def runs(drive, frames_of):
    """Two minutes of each vehicle in frames of 5 s."""
    return {vehicle: frames_of(drive(0), vehicle, length=5.0)[:24] for vehicle in VEHICLES}


@pytest.fixture
def expected(runs, car, bench, tmp_path: Path):
    """What one undisturbed monitor stores."""
    one = bench(tmp_path / "alone", **WATCH)
    for vehicle, payloads in runs.items():
        one.describe(vehicle)
        one.send(payloads, vehicle)
    return {vehicle: (results(one.store, vehicle), events(one.store, vehicle)) for vehicle in VEHICLES}


def stored(fleet):
    store = fleet.monitors[0].store
    return {vehicle: (results(store, vehicle), events(store, vehicle)) for vehicle in VEHICLES}


def windows(monitor):
    return monitor.station.figures()["sprung_windows_total"]


@pytest.mark.slow
def test_two_monitors_share_the_work_and_store_what_one_would(fleet, runs, expected, alike, car) -> None:
    fleet.work()
    for vehicle, payloads in runs.items():
        fleet.describe(vehicle, car)
        for payload in payloads:
            fleet.send(topic(vehicle, "raw"), payload)
    fleet.work()
    assert alike(stored(fleet), expected)
    assert [windows(monitor) for monitor in fleet.monitors] == [4, 4]
    assert fleet.monitors[0].store.inbox.boots("car-1") == []


@pytest.mark.slow
def test_monitor_that_was_held_up_stores_nothing_after_its_shards_were_taken_over(
    fleet, runs, expected, alike, car
) -> None:
    """The first monitor is stopped with outcomes that it has not stored; the second computes them again."""
    first, second = fleet.monitors
    fleet.work()
    for vehicle, payloads in runs.items():
        fleet.describe(vehicle, car)
        for payload in payloads:
            first.link.on_message(topic(vehicle, "raw"), payload)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(first.workers, "outcomes", lambda *, timeout=0.0: [])
        first.station.step()
        assert len(first.workers.done) == 2
        fleet.silence(first)
        fleet.work(second)
        assert alike(stored(fleet), expected)
    fleet.work(first)
    fleet.work()
    assert first.workers.done == []
    assert alike(stored(fleet), expected)
    (alert,) = second.store.alerts.find(vehicle="monitor")
    assert "stopped unexpectedly: others have taken over its vehicles" in alert.text
    assert first.station.troubles() == []


def test_description_that_another_monitor_stored_opens_the_vehicle_anew(fleet, runs, car) -> None:
    first, second = fleet.monitors
    fleet.work()
    fleet.describe("car-2", car)
    for payload in runs["car-2"][:2]:
        fleet.send(topic("car-2", "raw"), payload)
    fleet.work()
    opened = first.workers.watched["car-2"]
    heavier = car.model_copy(update={"body": car.body.model_copy(update={"mass": 2 * car.body.mass})})
    second.link.on_message(
        topic("car-2", "meta"),
        message({0: 1, 14: "d", "description": vehicle_text(heavier), "quantities": first.quantities}),
    )
    fleet.work(second)
    assert first.workers.watched["car-2"] is opened
    fleet.describe("car-2", heavier)
    for payload in runs["car-2"][2:4]:
        fleet.send(topic("car-2", "raw"), payload)
    fleet.work()
    assert first.workers.watched["car-2"] is not opened


@pytest.mark.slow
def test_commands_and_silence_are_left_to_the_holder(fleet, runs, car) -> None:
    first, second = fleet.monitors
    fleet.work()
    for vehicle in VEHICLES:
        fleet.describe(vehicle, car)
        fleet.send(topic(vehicle, "raw"), runs[vehicle][0])
    fleet.work()
    for vehicle in VEHICLES:
        first.store.requests.add_command("operator", vehicle, "raw", {"from": 0, "to": 1}, now=0)
    fleet.work()
    asked = [
        [
            parse_topic(name)[0]
            for name, payload in monitor.link.published
            if name.endswith("cmd") and checked_map(payload)["do"] == "raw"
        ]
        for monitor in (first, second)
    ]
    assert asked == [VEHICLES[:2], VEHICLES[2:]]
    fleet.send(topic("car-1", "state"), message({0: 1, 2: 1, "boots": [], "is_leaving": True}))
    fleet.work()
    for monitor in fleet.monitors:
        monitor.now += 2 * 3600 * 10**9
    fleet.work()
    silent = {row.vehicle for row in first.store.alerts.find() if row.cause == "silent"}
    assert silent == set(VEHICLES) - {"car-1"}
    assert [len(first.store.alerts.history(row.id or 0)) for row in first.store.alerts.find()] == [1, 1, 1]


def test_second_monitor_on_a_file_is_refused_and_disturbs_nothing(bench, tmp_path: Path, new_bench, car, drive) -> None:
    first = bench(tmp_path)
    with pytest.raises(StoreError, match=r"used by another monitor \(.*, process \d+.*: stop that one first"):
        new_bench(tmp_path, car, drive(0))
    assert [row.act for row in first.store.requests.audited()] == ["started"]
    assert first.store.alerts.find() == []
