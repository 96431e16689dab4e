"""Every command that draws writes its figures in the format that is asked for, and names them."""

from collections import defaultdict

import pytest

CAR = ("--vehicle", "zafira")


@pytest.fixture(scope="module")
def sources(tmp_path_factory, chain):
    """What each command reads: four minutes of a car with a soft spring, where it is nothing else."""
    from sprung import RoadDrive, parse_fault, read_vehicle, simulate_drive, write

    path = tmp_path_factory.mktemp("drive") / "run.npz"
    faults = (parse_fault("front_left.spring=-0.4"),)
    settings = RoadDrive(duration=240.0, sampling_rate=100.0, faults=faults, snr=50.0)
    write(simulate_drive(read_vehicle("zafira"), settings, seed=1).recording, path)
    return defaultdict(lambda: path, plan="zafira", track=chain)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        ("identify", CAR, {"stabilisation", "spectra", "mode_shapes", "complexity", "mac"}),
        ("track", ("--window", "40"), {"tracks"}),
        ("info", (), {"run-npz-signals", "run-npz-spectra", "run-npz-spectrograms"}),
        ("corners", CAR, {"corners", "spectra", "correlation"}),
        ("diagnose", (*CAR, "--window", "2"), {"evidence", "trends", "corners", "modes"}),
        ("calibrate", (*CAR, "--mounts", "0", "--no-modes", "--out", "v.toml"), {"misfit", "learnt"}),
        ("road", CAR, {"road"}),
        ("ride", CAR, {"ride"}),
        ("plan", (), {"plan"}),
    ],
)
def test_figures(sprung, sources, tmp_path, monkeypatch, case) -> None:
    monkeypatch.chdir(tmp_path)
    command, words, names = case
    ending, head = ("svg", b"<?xml") if command in {"identify", "corners"} else ("png", b"\x89PNG")
    outcome = sprung(command, sources[command], *words, "--figures", "drawn", "--format", ending)
    assert outcome.code == 0, outcome.err
    written = {path.name: path for path in (tmp_path / "drawn").iterdir()}
    assert set(written) == {f"{name}.{ending}" for name in names}
    assert all(path.read_bytes().startswith(head) for path in written.values())
    assert all(f"wrote drawn/{name}" in " ".join(outcome.out.split()) for name in written)
