"""What comes of jobs is stored together with how far they came."""

from pathlib import Path

import pytest

from sprung.online.monitor import Identified, Site, VehicleStatus
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.jobs import Outcome
from sprung.online.monitor.ledger import Ledger
from sprung.online.store import RefusedError, StoredFrame, StoreError, open_store

NOW = 1_795_219_200_000_000_000


@pytest.fixture
def store(sqlite_url):
    with open_store(sqlite_url) as opened:
        opened.inbox.add_frames([StoredFrame("car-1", 1, seq, NOW, b"x") for seq in range(5)], now=NOW)
        yield opened


@pytest.fixture
def ledger(store, tmp_path: Path):
    site = Site.model_validate({"store": f"sqlite:///{tmp_path}/store.sqlite"})
    return Ledger(Context(site, store, lambda: NOW))


def outcome(*events, state=None) -> Outcome:
    return Outcome("car-1", 3, events, state, VehicleStatus())


def modes_of(vehicle: str, number: int, frequency: float) -> Outcome:
    event = Identified(number, NOW, ({"natural_frequency": frequency},))
    return Outcome(vehicle, 3, (event,), None, VehicleStatus(n_learnt=number))


def stored(store, vehicle: str) -> list[tuple[int, float]]:
    return [(row.number, row.document["modes"][0]["natural_frequency"]) for row in store.results.modes(vehicle)]


def test_modes_of_many_vehicles_are_stored_in_one_transaction(ledger, store, monkeypatch: pytest.MonkeyPatch) -> None:
    from sprung.online.store.results import Results

    commits: list[int] = []
    commit = Results.commit

    def counted(self, progress, *before) -> None:
        commits.append(1 + len(before))
        commit(self, progress, *before)

    monkeypatch.setattr(Results, "commit", counted)
    for number in range(3):
        for vehicle in ("car-1", "car-2"):
            ledger.commit(modes_of(vehicle, number, 1.5), 1, 2)
    assert commits == []
    ledger.flush()
    ledger.flush()
    assert commits == [6]
    assert stored(store, "car-1") == stored(store, "car-2") == [(0, 1.5), (1, 1.5), (2, 1.5)]
    assert store.results.status("car-2")["n_learnt"] == 2


def test_a_state_goes_with_the_modes_before_it(ledger, store) -> None:
    """The status is that after the state, and modes of others wait on."""
    ledger.commit(modes_of("car-1", 4, 1.5), 1, 1)
    ledger.commit(modes_of("car-2", 4, 1.5), 1, 1)
    assert ledger.commit(outcome(state=b"state"), 1, 2)
    assert (stored(store, "car-1"), stored(store, "car-2")) == ([(4, 1.5)], [])
    ledger.flush()
    assert stored(store, "car-2") == [(4, 1.5)]
    assert store.results.status("car-1")["n_learnt"] == 0


def test_modes_after_a_restart_replace_those_before_it(ledger, store) -> None:
    """Late frames of an earlier boot come first then, and take the numbers of those that were analysed before them."""
    for boot, number, frequency in ((1, 0, 1.5), (3, 1, 1.7), (3, 2, 1.8)):
        ledger.commit(modes_of("car-1", number, frequency), boot, 1)
    ledger.commit(modes_of("car-2", 1, 1.5), 3, 1)
    ledger.flush()
    ledger.commit(modes_of("car-1", 3, 1.9), 3, 1)  # waits, and is identified again
    ledger.reopen("car-1")
    ledger.commit(outcome(state=b"state"), 1, 2)
    assert stored(store, "car-1") == [(0, 1.5), (1, 1.7), (2, 1.8)]
    ledger.commit(modes_of("car-1", 1, 1.6), 2, 1)
    ledger.commit(modes_of("car-1", 2, 1.7), 3, 1)
    ledger.flush()
    assert stored(store, "car-1") == [(0, 1.5), (1, 1.6), (2, 1.7)]
    assert stored(store, "car-2") == [(1, 1.5)]


def test_modes_that_the_store_refuses_do_not_keep_others_out(ledger, store, caplog) -> None:
    ledger.commit(modes_of("car-1", 0, float("nan")), 1, 1)
    ledger.commit(modes_of("car-2", 0, 1.5), 1, 1)
    ledger.flush()
    assert (stored(store, "car-1"), stored(store, "car-2")) == ([], [(0, 1.5)])
    assert "modes were not stored" in caplog.text


def test_modes_wait_where_the_store_cannot_write_each_alone(ledger, store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes were lost if the store was busy for the transaction of all, and once more for one vehicle."""
    from sprung.online.store.results import Results

    commit = Results.commit
    errors = [
        StoreError("the store is busy"),
        RefusedError("the store cannot hold this"),
        None,
        StoreError("the disk is full"),
    ]

    def faulty(self, progress, *before) -> None:
        error = errors.pop(0) if errors else None
        if error is not None:
            raise error
        commit(self, progress, *before)

    for vehicle in ("car-1", "car-2", "car-3"):
        ledger.commit(modes_of(vehicle, 0, 1.5), 1, 1)
    with monkeypatch.context() as patch:
        patch.setattr(Results, "commit", faulty)
        with pytest.raises(StoreError, match="is busy"):
            ledger.flush()
        with pytest.raises(StoreError, match="disk is full"):  # refused as a whole, car-1 alone is stored, car-2 is not
            ledger.flush()
    assert [len(stored(store, vehicle)) for vehicle in ("car-1", "car-2", "car-3")] == [1, 0, 0]
    ledger.flush()
    assert [stored(store, vehicle) for vehicle in ("car-1", "car-2", "car-3")] == [[(0, 1.5)]] * 3


def test_numbers_are_stored_with_the_digits_that_mean_something(ledger, store) -> None:
    ledger.commit(modes_of("car-1", 0, 1.23456789), 1, 1)
    ledger.commit(outcome(Identified(1, NOW, (), "the window is shorter than 120 s")), 1, 1)
    ledger.flush()
    assert stored(store, "car-1") == [(0, 1.23457)]
