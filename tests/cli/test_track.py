import json
import re

import numpy as np
import pytest

from sprung import write
from sprung.recording import join
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain as chain_of


@pytest.fixture(scope="module")
def softened(tmp_path_factory):
    """A minute of the chain four times, then four times with springs 10 % softer."""
    parts = []
    for k in range(8):
        vehicle = chain_of(stiffness=9800.0 * (1.0 if k < 4 else 0.9))
        parts.append(simulate(vehicle, usual_excitation(vehicle), duration=60.0, sampling_rate=150.0, snr=20.0, seed=k))
    path = tmp_path_factory.mktemp("softened") / "run.parquet"
    write(join(parts), path)
    return path


@pytest.mark.slow
def test_windows_of_a_file(monkeypatch, sprung, softened, tmp_path) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    outcome = sprung(
        "track", softened, "--window", 60, "--json", tmp_path / "t.json", "--figures", tmp_path / "figures"
    )
    assert outcome.code == 0, outcome.err
    assert "3 modes followed over 8 windows with modes, of 8" in outcome.out
    assert len(re.findall(r"-5\.?\d? % at ", outcome.out)) == 3
    assert (tmp_path / "figures" / "tracks.png").stat().st_size > 20_000
    document = outcome.check_document(json.loads((tmp_path / "t.json").read_text()))
    assert document["time_unit"] == "s"
    assert [window["time"] for window in document["windows"]] == [60.0 * k for k in range(8)]
    assert {window["source"] for window in document["windows"]} == {"run.parquet"}
    exact = chain_of().modes().natural_frequency
    for track, frequency in zip(document["tracks"], exact, strict=True):
        assert len(track["points"]) == 8
        (jump,) = track["jumps"]
        assert jump["window"] == 4
        assert jump["before"] == pytest.approx(frequency, rel=0.01)
        assert jump["after"] == pytest.approx(frequency * np.sqrt(0.9), rel=0.01)
        assert track["presence"] == 1.0
        assert min(point["mac"] for point in track["points"]) > 0.98


@pytest.mark.slow
def test_identifications_as_files(sprung, chain, bogie, tmp_path) -> None:
    for number, method in enumerate(("cov", "acs", "coss")):
        assert sprung("identify", chain, "--method", method, "--json", tmp_path / f"{number}.json").code == 0
    files = [tmp_path / f"{number}.json" for number in range(3)]
    document = sprung("track", *files, "--json", "-").document()
    assert document["time_unit"] == "windows"
    assert [window["time"] for window in document["windows"]] == [0, 1, 2]
    expected = [mode["natural_frequency"] for mode in json.loads(files[0].read_text())["modes"]]
    assert [track["points"][0]["natural_frequency"] for track in document["tracks"]] == pytest.approx(expected)
    assert [len(track["points"]) for track in document["tracks"]] == [3, 3, 3]
    hourly = sprung("track", *files, "--window", 3600, "--json", "-").document()
    assert hourly["time_unit"] == "s"
    assert [window["time"] for window in hourly["windows"]] == [0, 3600, 7200]
    assert " 1 \n" in sprung("track", *files).out
    mixed = sprung("track", *files, chain)
    assert (mixed.code, "give files of one kind" in mixed.err) == (2, True)
    assert sprung("identify", bogie, "--json", tmp_path / "other.json").code == 0
    other = sprung("track", files[0], tmp_path / "other.json")
    assert (other.code, "window 2 has the channels" in other.err) == (2, True)


def test_windows_without_modes_are_noted(sprung, chain, tmp_path) -> None:
    from sprung import read

    run = read(chain).changed("without a start time", start=None)
    dead = run.changed("dead", samples=np.zeros_like(run.samples))
    paths = [tmp_path / f"{k}.parquet" for k in range(3)]
    for path, recording in zip(paths, (run, dead, run), strict=True):
        write(recording, path)
    outcome = sprung("track", *paths)
    assert outcome.code == 0
    assert "window 2 (1.parquet): " in outcome.out
    assert "3 modes followed over 2 windows with modes, of 3" in outcome.out
    nothing = sprung("track", paths[1])
    assert nothing.code == 3
    assert "no window has a mode" in nothing.err


def test_options_are_checked(sprung, chain, tmp_path) -> None:
    for words, message in (
        (["--window", 0], "--window=0 must be above 0"),
        (["--reach", 2], "reach=2 must be above 0 and at most 0.5"),
        (["--gap", 0], "gap=0 must be above 0"),
        (["--json", chain], "would overwrite an input"),
    ):
        outcome = sprung("track", chain, *words)
        assert outcome.code == 2
        assert message in outcome.err
