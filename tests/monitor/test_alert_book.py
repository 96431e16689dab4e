"""Trouble with monitoring itself is one alert, however often it is reported."""

from pathlib import Path

import pytest

from sprung.alerting import AlertSettings
from sprung.monitor import AlertBook
from sprung.storage import open_store

NOW = 1_795_219_200_000_000_000


@pytest.fixture
def store(tmp_path: Path):
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        yield opened


def test_trouble_that_stays_the_same_is_named_once(store) -> None:
    book = AlertBook(store, AlertSettings())
    for second in range(5):
        book.report("car-1", "silent", "car-1 has sent nothing", now=NOW + second)
    assert store.alerts.n_open() == 1
    book.clear("car-1", "silent", now=NOW + 10)
    book.clear("car-1", "silent", now=NOW + 11)
    assert store.alerts.n_open() == 2
    (row,) = store.alerts.find()
    assert [entry.what for entry in store.alerts.history(row.id)] == ["raised", "cleared"]
