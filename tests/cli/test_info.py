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


def test_channels_of_another_rate_are_named_and_the_others_shown(sprung, tmp_path):
    rows = [f"{k / 100:.2f},{k % 7},{k if k % 10 == 0 else ''},{k if k % 20 == 0 else ''}" for k in range(500)]
    path = tmp_path / "mixed.csv"
    path.write_text("time,acc,speed,heading\n" + "\n".join(rows))
    outcome = sprung("info", path)
    assert outcome.code == 0
    said = " ".join(outcome.out.split())
    assert "500 samples at 100 Hz" in said
    assert "channel 'speed' has a value in one of 10 rows only (another rate): keep the channels" in said
    assert "channel 'heading' has a value in one of 20 rows only" in said


def test_values_missing_everywhere_are_null(sprung, tmp_path):
    rows = "".join(f"{0.01 * k:.2f},{k % 7},\n" for k in range(500))
    (tmp_path / "run.csv").write_text("time,a,b\n" + rows)
    outcome = sprung("info", tmp_path / "run.csv", "--json", "-")
    dead = outcome.document()["files"][0]["channels"][1]
    assert (dead["is_dead"], dead["rms"], dead["n_values"]) == (True, None, 0)
    assert "dead, missing 100 %" in sprung("info", tmp_path / "run.csv").out


@pytest.mark.parametrize("ending", ["npy", "csv", "parquet", "mat"])
def test_rows_without_a_clock_are_shown_with_the_reason(sprung, tmp_path, ending):
    path = tmp_path / f"run.{ending}"
    values = np.random.default_rng(1).standard_normal((400, 2))
    time = 0.01 * np.arange(400)
    time[200:] = time[:200]
    if ending == "npy":
        np.save(path, values)
    else:
        columns = {"time": time, "a": values[:, 0], "b": values[:, 1]}
        if ending == "parquet":
            pq.write_table(pa.table(columns), path)
        elif ending == "mat":
            savemat(path, columns)
        else:
            np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header="time,a,b", comments="")
    outcome = sprung("info", path, "--json", tmp_path / "info.json")
    reason = "has no time column" if ending == "npy" else "time runs backwards"
    assert outcome.code == 2
    assert outcome.out.startswith(f"{path}: 400 rows without a clock")
    assert f"{values[:, 0].max():.4g}" in outcome.out
    assert reason in outcome.err
    (facts,) = json.loads((tmp_path / "info.json").read_text())["files"]
    assert (facts["sampling_rate"], facts["duration"], facts["n_samples"]) == (None, None, 400)
    assert reason in facts["history"][0]
