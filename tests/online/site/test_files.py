"""Reports and exports by HTTP."""

import io
import threading
from typing import Any

import pytest
from starlette.testclient import TestClient
from tests.online.monitor.history_store import BEGIN, DAY, VEHICLE, fill
from tests.online.site.conftest import NOW

from sprung.online.monitor import Site
from sprung.online.monitor.vehicle_report import vehicle_report
from sprung.online.site import Context, application
from sprung.online.site.vehicles import files
from sprung.online.store import open_store

pandas: Any = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    with open_store(f"sqlite:///{tmp_path_factory.mktemp('store')}/store.sqlite") as opened:
        fill(opened)
        yield opened


@pytest.fixture(scope="module")
def client(store):
    context = Context(store, Site(), figures=dict, problems=list, clock=lambda: NOW)
    with TestClient(application(context), base_url="http://127.0.0.1:8737", raise_server_exceptions=False) as opened:
        yield opened


@pytest.mark.slow
def test_page_and_interface_give_the_same_report(client) -> None:
    address = f"/vehicles/{VEHICLE}/report"
    shown = client.get(address, params={"until": "2026-10-10"})
    assert shown.status_code == 200
    assert shown.headers["content-disposition"].startswith(f'inline; filename="{VEHICLE}-report.html"')
    assert "No change detected" in shown.text
    assert "<h1>bus-17: report from 2026-09-22 00:00 to 2026-10-10 23:59 UTC</h1>" in shown.text
    until = (BEGIN + 19 * DAY) * 10**9 - 1
    kept = client.get(f"/api/v1{address}", params={"until": until})
    assert kept.headers["content-disposition"].startswith("attachment; ")
    assert kept.text == shown.text


def test_exports_are_files(client, store) -> None:
    for file_format, read in (("csv", pandas.read_csv), ("parquet", pandas.read_parquet)):
        settings = {"what": "windows", "format": file_format}
        answer = client.get(f"/api/v1/vehicles/{VEHICLE}/export", params=settings)
        assert answer.status_code == 200
        name = f'filename="{VEHICLE}-windows.{file_format}"'
        assert name in answer.headers["content-disposition"]
        assert len(read(io.BytesIO(answer.content))) == store.results.n_observations(VEHICLE)
    answer = client.get(f"/api/v1/vehicles/{VEHICLE}/export", params={"what": "alerts", "format": "json"})
    assert [row["cause"] for row in answer.json()["rows"]] == ["front_left.spring", "sensor:acc_fl"]


@pytest.mark.parametrize(
    ("address", "status", "words"),
    [
        ("/api/v1/vehicles/none/report", 404, "unknown vehicle"),
        ("/api/v1/vehicles/none/export", 404, "unknown vehicle"),
        ("/api/v1/vehicles/bus-17/export?what=all", 422, "windows"),
        ("/api/v1/vehicles/bus-17/export?format=xls", 422, "csv"),
        ("/api/v1/vehicles/bus-17/export?since=2&until=1", 422, "swap since and until"),
        ("/api/v1/vehicles/bus-17/report?since=2&until=1", 422, "swap since and until"),
        ("/vehicles/bus-17/report?since=yesterday", 422, "write 2026-11-21"),
        ("/vehicles/none/report", 404, "unknown vehicle"),
    ],
)
def test_what_is_impossible_is_refused(client, address, status, words) -> None:
    answer = client.get(address)
    assert answer.status_code == status
    assert words in answer.text


@pytest.mark.slow
def test_one_report_is_written_at_a_time(client, monkeypatch) -> None:
    begun, wanted = threading.Event(), threading.Event()
    drawn = vehicle_report

    def slow(*values, **settings):
        begun.set()
        assert wanted.wait(20)
        return drawn(*values, **settings)

    monkeypatch.setattr(files, "vehicle_report", slow)
    address = f"/api/v1/vehicles/{VEHICLE}/report"
    answers = []
    first = threading.Thread(target=lambda: answers.append(client.get(address).status_code))
    first.start()
    assert begun.wait(20)
    refused = client.get(address)
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "10")
    assert refused.json() == {"detail": "another report is being written: try again in 10 s"}
    shown = client.get(f"/vehicles/{VEHICLE}/report", headers={"accept": "text/html"})
    assert shown.status_code == 503
    assert "One report at a time" in shown.text
    wanted.set()
    first.join(20)
    assert answers == [200]
    monkeypatch.setattr(files, "vehicle_report", drawn)
    assert client.get(address).status_code == 200


@pytest.mark.parametrize("name", ["bus-1.csv", 'a"b\r\nc.csv', "büs ☃.csv"])
def test_names_of_files_stay_in_their_header(name) -> None:
    header = files._headers("attachment", name)["content-disposition"]
    assert header.isascii()
    assert header.isprintable()
    assert header.count('"') == 2
