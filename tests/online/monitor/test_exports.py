"""What is exported equals what the store holds, in every format."""

import csv
import io
import json
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.online.monitor.history_store import HOSTILE, VEHICLE, fill, finding

from sprung.errors import ParameterError
from sprung.online.monitor.exports import FORMATS, WHATS, export
from sprung.online.store import Progress, open_store
from sprung.results.tables.wording import Period

pandas: Any = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    with open_store(f"sqlite:///{tmp_path_factory.mktemp('store')}/store.sqlite") as opened:
        fill(opened)
        yield opened


def frame_of(store, what, file_format, **settings):
    """Export, and read back by pandas."""
    content = b"".join(export(store, VEHICLE, what, file_format=file_format, **settings))
    if file_format == "parquet":
        return pandas.read_parquet(io.BytesIO(content))
    if file_format == "csv":
        return pandas.read_csv(io.BytesIO(content), float_precision="round_trip")
    document = json.loads(content)
    return pandas.DataFrame(document["rows"], columns=document["columns"])


@pytest.mark.parametrize("file_format", FORMATS)
def test_windows_are_those_of_the_store(store, file_format) -> None:
    frame = frame_of(store, "windows", file_format)
    entries = store.results.observations(VEHICLE)
    assert len(frame) == len(entries) > 200
    times = pandas.to_datetime(frame["start_utc"], utc=True).astype("datetime64[ns, UTC]").astype("int64")
    assert times.tolist() == [entry.t0 for entry in entries]
    assert frame["window"].tolist() == [entry.number for entry in entries]
    for number, entry in enumerate(entries):
        document = entry.document
        row = frame.iloc[number]
        assert row["speed_m_per_s"] == document["conditions"]["speed"]
        assert row["is_conclusive"] == ("no" if document["reason"] else "yes")
        if document["reason"]:
            assert row["sensor_faults"] == "acc_fl dead"
            assert pandas.isna(row["front_left_spring_ln_ratio"])
            continue
        assert row["roughness_m3"] == document["conditions"]["roughness"]
        for k, component in enumerate(document["components"]):
            name = component.replace(".", "_")
            assert row[f"{name}_ln_ratio"] == document["log_ratios"][k]
            assert row[f"{name}_ln_ratio_std"] == pytest.approx(np.sqrt(document["covariance"][k][k]))
        assert (row["bounce_natural_frequency_hz"], row["bounce_damping_ratio"]) == tuple(document["modes"]["bounce"])


@pytest.mark.parametrize("file_format", FORMATS)
def test_modes_and_findings_are_those_of_the_store(store, file_format) -> None:
    frame = frame_of(store, "modes", file_format)
    modes = [mode for entry in store.results.modes(VEHICLE) for mode in entry.document["modes"]]
    assert frame["natural_frequency_hz"].tolist() == [mode["natural_frequency"] for mode in modes]
    assert frame["damping_ratio_std"].tolist() == [mode["damping_ratio_std"] for mode in modes]
    assert frame["mode"].tolist() == [1, 2] * (len(modes) // 2)
    frame = frame_of(store, "findings", file_format)
    documents = [entry.document for entry in store.results.findings(VEHICLE)]
    np.testing.assert_allclose(frame["change_percent"], [100 * document["change"] for document in documents])
    np.testing.assert_allclose(frame["change_low_percent"], [100 * document["interval"][0] for document in documents])
    since = pandas.to_datetime(frame["since_utc"], utc=True)
    assert {time.timestamp() for time in since} == {document["since"] for document in documents}


@pytest.mark.parametrize("file_format", FORMATS)
def test_alerts_have_their_last_verdict(store, file_format) -> None:
    frame = frame_of(store, "alerts", file_format)
    assert frame["alert"].tolist() == [2, 1]
    spring = frame.iloc[0]
    assert (spring["cause"], spring["severity"], spring["state"]) == ("front_left.spring", "high", "acknowledged")
    assert spring["change_percent"] == pytest.approx(100 * finding(-0.25)["change"])
    assert spring["verdict"] == "not looked at"
    assert spring["verdict_action"] == ("'-no bay free" if file_format == "csv" else "-no bay free")


def test_texts_that_spreadsheets_would_run_are_harmless_in_csv(store) -> None:
    document = {"modes": [{"label": text} for text in (HOSTILE, "@a", "+a", "-a", "\ta", "\ra", "a=b")]}
    store.results.commit(Progress(VEHICLE, 1, done_seq=0, modes=((9999, 10**18, document),)))
    period = Period(10**18, 10**18)
    text = b"".join(export(store, VEHICLE, "modes", period=period)).decode()
    labels = [row["label"] for row in csv.DictReader(io.StringIO(text, newline=""))]
    assert labels == [f"'{HOSTILE}", "'@a", "'+a", "'-a", "'\ta", "'\ra", "a=b"]
    rows = json.loads(b"".join(export(store, VEHICLE, "modes", file_format="json", period=period)))["rows"]
    assert rows[0]["label"] == HOSTILE


def test_a_period_cuts_windows_and_alerts(store) -> None:
    entries = store.results.observations(VEHICLE)
    period = Period(entries[10].t0, entries[19].t0)
    assert frame_of(store, "windows", "csv", period=period)["window"].tolist() == list(range(10, 20))
    assert frame_of(store, "alerts", "csv", period=period).empty
    assert frame_of(store, "findings", "parquet", period=period).empty


def test_windows_of_one_time_are_neither_lost_nor_doubled(tmp_path) -> None:
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        same = tuple((number, 5, {"place": k}) for number in range(3) for k in range(2))
        opened.results.commit(Progress("a", 1, done_seq=-1, findings=same))
        opened.results.commit(Progress("a", 2, done_seq=-1, findings=same))
        for size in (1, 2, 3, 5, 12, 13):
            entries = [entry for piece in opened.results.pieces("findings", "a", size=size) for entry in piece]
            assert entries == opened.results.findings("a"), size


@pytest.mark.parametrize("what", WHATS)
def test_a_vehicle_without_results_has_a_table_without_rows(tmp_path, what) -> None:
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        opened.inbox.put_vehicle(VEHICLE, configuration="", description="", channels=[], now=1)
        table = pq.read_table(io.BytesIO(b"".join(export(opened, VEHICLE, what, file_format="parquet"))))
        assert table.num_rows == 0
        assert "vehicle" in table.column_names
        document = json.loads(b"".join(export(opened, VEHICLE, what, file_format="json")))
        assert document["rows"] == []


def test_documents_follow_their_schema(store, check_document) -> None:
    for what in WHATS:
        check_document(json.loads(b"".join(export(store, VEHICLE, what, file_format="json"))))


def test_what_is_unknown_is_refused(store) -> None:
    for vehicle, what, file_format, message in (
        ("none", "windows", "csv", "unknown vehicle 'none'"),
        (VEHICLE, "frames", "csv", "what 'frames' is not one of alerts, findings, modes, windows"),
        (VEHICLE, "windows", "xls", "format 'xls' is not one of csv, json, parquet"),
    ):
        with pytest.raises(ParameterError, match=message):
            export(store, vehicle, what, file_format=file_format)
