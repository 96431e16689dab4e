import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat


def test_large_files_are_inspected_in_blocks(sprung, chain, monkeypatch):
    (whole,) = sprung("info", chain, "--json", "-").document()["files"]
    monkeypatch.setattr("sprung.formats.LARGE", 10_000)
    monkeypatch.setattr("sprung.formats.BLOCK_SAMPLES", 5_000)
    (blocks,) = sprung("info", chain, "--json", "-").document()["files"]
    assert (blocks["n_samples"], blocks["duration"]) == (whole["n_samples"], pytest.approx(whole["duration"]))
    for channel, expected in zip(blocks["channels"], whole["channels"], strict=True):
        assert channel["rms"] == pytest.approx(expected["rms"], rel=1e-9)


def table_file(path, columns):
    """Write columns, the first of which is the time, in the format of the ending; an array of NumPy has no names."""
    match path.suffix:
        case ".npy":
            np.save(path, np.stack(list(columns.values()), axis=1))
        case ".npz":
            np.savez(path, **columns)
        case ".parquet":
            pq.write_table(pa.table(columns), path)
        case ".mat":
            savemat(path, columns)
        case _:
            every = zip(*columns.values(), strict=True)
            rows = (",".join("" if np.isnan(value) else f"{value:.9g}" for value in row) for row in every)
            path.write_text("\n".join([",".join(columns), *rows]))
    return path


@pytest.mark.parametrize("ending", ["csv", "parquet", "mat", "npz", "npy"])
def test_a_channel_of_another_rate_is_a_row_with_its_reason(sprung, tmp_path, monkeypatch, ending):
    monkeypatch.setenv("COLUMNS", "120")
    samples = np.random.default_rng(1).standard_normal((3, 500))
    for row, step in ((1, 10), (2, 20)):
        samples[row, np.arange(500) % step > 0] = np.nan
    columns = dict(zip(("time", "acc", "speed", "heading"), [np.arange(500) / 100, *samples], strict=True))
    path = table_file(tmp_path / f"mixed.{ending}", columns)
    outcome = sprung("info", path, "--json", tmp_path / "info.json")
    (facts,) = json.loads((tmp_path / "info.json").read_text())["files"]
    assert (outcome.code, facts["sampling_rate"], facts["n_samples"]) == (0, 100.0, 500)
    acc, speed, heading = facts["channels"]
    assert acc["reason"] == ""
    assert speed["reason"] == "left out: a value in one of 10 rows only, 10 Hz"
    assert heading["reason"] == "left out: a value in one of 20 rows only, 5 Hz"
    assert (speed["n_values"], speed["maximum"]) == (50, pytest.approx(np.nanmax(samples[1]), rel=1e-6))
    assert speed["reason"] in outcome.out
    assert "another rate" not in outcome.out


@pytest.mark.parametrize("ending", ["csv", "parquet", "mat", "npz", "npy"])
def test_infinite_values_are_the_reason_in_the_row_of_their_channel(sprung, tmp_path, ending):
    first, second = np.random.default_rng(1).standard_normal((2, 500))
    second[100:140] = -np.inf
    columns = {"time": np.arange(500) / 100, "a": first, "b": second, "c": np.full(500, -np.inf)}
    outcome = sprung("info", table_file(tmp_path / f"run.{ending}", columns), "--json", tmp_path / "info.json")
    (facts,) = json.loads((tmp_path / "info.json").read_text())["files"]
    a, b, c = facts["channels"]
    word, place = {"csv": ("line", 1), "parquet": ("row", 0)}.get(ending, ("sample", 0))
    assert (a["reason"], a["n_values"], b["n_values"]) == ("", 460, 460)
    assert b["reason"] == f"-inf in {word} {101 + place}, the first of 40 values"
    assert c["reason"] == f"-inf in {word} {1 + place}, the first of 500 values"
    assert c["is_dead"]
    assert b["reason"] in outcome.out


@pytest.mark.parametrize("ending", ["mat", "npz"])
@pytest.mark.parametrize("n_short", [50, 400])
def test_an_array_of_another_length_is_a_row_with_its_reason(sprung, tmp_path, ending, n_short):
    samples = np.random.default_rng(1).standard_normal(500)
    arrays = {"fs": np.array(100.0), "acc": samples, "speed": samples[:n_short], "gain": np.ones(3)}
    path = table_file(tmp_path / f"run.{ending}", arrays)
    (facts,) = sprung("info", path, "--json", "-").document()["files"]
    acc, speed = facts["channels"]
    assert (acc["n_values"], speed["n_values"]) == (500, n_short)
    assert speed["reason"] == f"left out: {n_short} samples, others have 500"
    (chosen,) = sprung("info", path, "--channels", "acc", "--json", "-").document()["files"]
    assert [channel["name"] for channel in chosen["channels"]] == ["acc"]


def test_values_missing_everywhere_are_null(sprung, tmp_path):
    rows = "".join(f"{0.01 * k:.2f},{k % 7},\n" for k in range(500))
    (tmp_path / "run.csv").write_text("time,a,b\n" + rows)
    outcome = sprung("info", tmp_path / "run.csv", "--json", "-")
    dead = outcome.document()["files"][0]["channels"][1]
    assert (dead["is_dead"], dead["rms"], dead["n_values"]) == (True, None, 0)
    assert "dead, missing 100 %" in sprung("info", tmp_path / "run.csv").out


_ROWS = {"csv": "line 202", "parquet": "row 201", "mat": "sample 201"}


@pytest.mark.parametrize("ending", ["npy", "csv", "parquet", "mat"])
def test_rows_without_a_clock_are_shown_with_the_reason(sprung, tmp_path, ending):
    path = tmp_path / f"run.{ending}"
    values = np.random.default_rng(1).standard_normal((400, 2))
    time = 0.01 * np.arange(400)
    time[200:] = time[:200]
    if ending == "npy":
        np.save(path, values)
    else:
        table_file(path, {"time": time, "a": values[:, 0], "b": values[:, 1]})
    outcome = sprung("info", path, "--json", tmp_path / "info.json")
    reason = "has no time column" if ending == "npy" else "time runs backwards"
    assert outcome.code == 2
    assert outcome.out.startswith(f"{path}: 400 rows without a clock")
    assert f"{values[:, 0].max():.4g}" in outcome.out
    assert reason in outcome.err
    (facts,) = json.loads((tmp_path / "info.json").read_text())["files"]
    assert (facts["sampling_rate"], facts["duration"], facts["n_samples"]) == (None, None, 400)
    assert reason in facts["history"][0]
    if ending != "npy":  # whose columns have no names
        clock = facts["channels"][0]
        assert (clock["name"], clock["rms"], clock["is_dead"]) == ("time", None, False)
        assert clock["reason"] == f"{_ROWS[ending]}: {reason}"
