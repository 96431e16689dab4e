"""The command `sprung compare`: two sets of drives, with and without a change between them."""

import json

import pytest

import sprung
from sprung.cli import main


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two healthy drives, and one with a soft spring."""
    folder = tmp_path_factory.mktemp("compare")
    car = sprung.read_vehicle("zafira")
    for name, seed, faults in (("first", 1, ()), ("second", 2, ()), ("soft", 3, ("front_left.spring=-0.3",))):
        settings = sprung.RoadDrive(
            duration=900.0, sampling_rate=100.0, snr=50.0, faults=tuple(sprung.parse_fault(fault) for fault in faults)
        )
        sprung.write(sprung.simulate_drive(car, settings, seed=seed).recording, folder / f"{name}.parquet")
    return folder


@pytest.mark.parametrize(("second", "verdict"), [("second", "no_change_detected"), ("soft", "change")])
def test_two_sets_of_drives(drives, second, verdict) -> None:
    arguments = ["--vehicle", "zafira", "--window", "3", "--json", str(drives / f"{second}.json")]
    assert (
        main(["compare", str(drives / "first.parquet"), "--with", str(drives / f"{second}.parquet"), *arguments]) == 0
    )
    document = json.loads((drives / f"{second}.json").read_text())
    assert (document["schema"], document["verdict"]) == ("sprung.compare/1", verdict)
    assert document["n_windows"] == [5, 5]
    assert set(document["detectable"]) >= {"front_left.spring"}
    if verdict == "change":
        (finding,) = document["findings"]
        assert (finding["corner"], finding["component"]) == ("front_left", "spring")
        assert finding["interval"][0] < -0.3 < finding["interval"][1]
