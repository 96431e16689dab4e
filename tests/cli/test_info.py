import json

import numpy as np
import pytest

from sprung.formats import write
from sprung.recording import Channel, Gap, Recording


@pytest.fixture
def faulty(tmp_path):
    """A recording with a gap and with a dead, a clipped, a stuck and a sound channel."""
    generator = np.random.default_rng(1)
    samples = generator.standard_normal((4, 3000))
    samples[0] = 1.5
    samples[1] = np.clip(5 * np.sin(np.arange(3000) / 40), -2, 2)
    samples[2, 700:1000] = 0.25
    names = ("dead", "clipped", "stuck", "sound")
    recording = Recording(
        samples,
        100.0,
        tuple(Channel(name, "acceleration") for name in names),
        start=1_700_000_000_000_000_000,
        gaps=(Gap(1500, 2.5),),
    )
    write(recording, tmp_path / "run.parquet")
    return tmp_path / "run.parquet"


def test_facts_of_a_file(sprung, faulty):
    document = sprung("info", faulty, "--json", "-").document()
    assert document["schema"] == "sprung.info/1"
    (facts,) = document["files"]
    assert facts["path"] == str(faulty)
    assert (facts["sampling_rate"], facts["n_samples"], facts["duration"]) == (100.0, 3000, 30.0)
    assert (facts["n_gaps"], facts["gap_duration"]) == (1, pytest.approx(2.5))
    assert facts["start"] == 1_700_000_000_000_000_000
    by_name = {channel["name"]: channel for channel in facts["channels"]}
    assert [name for name, channel in by_name.items() if channel["is_dead"]] == ["dead"]
    assert [name for name, channel in by_name.items() if channel["is_clipped"]] == ["clipped"]
    assert [name for name, channel in by_name.items() if channel["is_stuck"]] == ["stuck"]
    assert by_name["dead"]["rms"] == pytest.approx(1.5)
    assert by_name["stuck"]["stuck"] == pytest.approx(0.1)
    assert by_name["sound"]["unit"] == "m/s^2"


def test_table_of_a_file(sprung, faulty):
    outcome = sprung("info", faulty)
    assert outcome.err == ""
    rows = {line.split()[0]: line for line in outcome.out.splitlines() if " m/s^2 " in line}
    assert "dead" in rows["dead"].split("1.5")[-1]
    assert "stuck 10 %" in rows["stuck"]
    assert "clipped" in rows["clipped"].split("2")[-1] or "clipped" in rows["clipped"][8:]
    assert rows["sound"].rstrip()[-1].isdigit()
    assert "1 gap of 2.5 s" in " ".join(outcome.out.split())
    assert "2023-11-14 22:13:20 UTC" in " ".join(outcome.out.split())


def test_figures_of_a_file(sprung, faulty, tmp_path):
    outcome = sprung("info", faulty, "--figures", tmp_path / "out", "--format", "svg")
    assert outcome.code == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {f"run-parquet-{kind}.svg" for kind in ("signals", "spectra", "spectrograms")}
    assert "sound" in (tmp_path / "out" / "run-parquet-spectrograms.svg").read_text()


def test_several_files_in_order(sprung, faulty, chain, tmp_path):
    sprung("info", faulty, chain, "--json", tmp_path / "info.json")
    files = json.loads((tmp_path / "info.json").read_text())["files"]
    assert [facts["path"] for facts in files] == [str(faulty), str(chain)]


def test_chosen_channels_and_stated_rate(sprung, tmp_path):
    np.savez(tmp_path / "run.npz", a=np.arange(500.0), b=np.ones(500))
    words = ("info", tmp_path / "run.npz", "--json", "-")
    (facts,) = sprung(*words, "--sampling-rate", "50", "--channels", "a").document()["files"]
    assert (facts["sampling_rate"], facts["duration"]) == (50.0, 10.0)
    assert [channel["name"] for channel in facts["channels"]] == ["a"]


def test_large_files_are_inspected_in_blocks(sprung, chain, monkeypatch):
    (whole,) = sprung("info", chain, "--json", "-").document()["files"]
    monkeypatch.setattr("sprung.formats.LARGE", 10_000)
    monkeypatch.setattr("sprung.formats.BLOCK_SAMPLES", 5_000)
    (blocks,) = sprung("info", chain, "--json", "-").document()["files"]
    assert (blocks["n_samples"], blocks["duration"]) == (whole["n_samples"], pytest.approx(whole["duration"]))
    for channel, expected in zip(blocks["channels"], whole["channels"], strict=True):
        assert channel["rms"] == pytest.approx(expected["rms"], rel=1e-9)


def test_values_missing_everywhere_are_null(sprung, tmp_path):
    rows = "".join(f"{0.01 * k:.2f},{k % 7},\n" for k in range(500))
    (tmp_path / "run.csv").write_text("time,a,b\n" + rows)
    outcome = sprung("info", tmp_path / "run.csv", "--json", "-")
    dead = outcome.document()["files"][0]["channels"][1]
    assert (dead["is_dead"], dead["rms"], dead["n_values"]) == (True, None, 0)
    assert "dead, missing 100 %" in sprung("info", tmp_path / "run.csv").out


def test_the_json_file_is_among_what_was_written(sprung, chain, tmp_path):
    path = tmp_path / "i.json"
    outcome = sprung("info", chain, "--json", path)
    assert f"wrote{path}" in "".join(outcome.out.split())
