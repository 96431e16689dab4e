"""Changes of primary and secondary springs and dampers against a baseline: named, worded and drawn."""

import numpy as np
import pytest

from sprung import Observation, diagnose, learn
from sprung.calibration import calibrate, calibrated_if_imperfect, usable_spectra
from sprung.diagnosis import observe_window
from sprung.errors import ParameterError
from sprung.recording import Channel, Recording
from sprung.results.figures import corner_changes_figure, trends_figure
from sprung.results.tables.diagnosis import describe_diagnosis
from sprung.simulation import RailDrive, WheelOrders, simulate_drive
from sprung.vehicles import Component, read_vehicle, structure

METRO = structure(read_vehicle("metro"))
PARTS = tuple(component for component in METRO.components() if component.kind.startswith(("primary", "secondary")))


def windows(n, first=0, seed=1, **changes):
    """Windows with 1 % scatter and relative changes of parts such as bogie1_left__secondary_spring."""
    values = 0.01 * np.random.default_rng(seed).standard_normal((n, len(PARTS)))
    for name, change in changes.items():
        values[:, list(map(str, PARTS)).index(name.replace("__", "."))] += np.log1p(change)
    C = 0.01**2 * np.eye(len(PARTS))
    return [Observation(600.0 * (first + k), PARTS, x, C, {}, {}, ()) for k, x in enumerate(values)]


@pytest.fixture(scope="module")
def baseline():
    return learn(windows(12))


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("bogie1_left__secondary_spring", "bogie1-left secondary spring 20 % (18 to 22 %) softer"),
        ("bogie2_rear_right__primary_damper", "bogie2-rear-right primary damper 20 % (18 to 22 %) weaker"),
    ],
)
def test_the_changed_part_of_either_stage_is_named(baseline, part, words) -> None:
    result = diagnose(windows(6, first=12, seed=2, **{part: -0.2}), baseline)
    (finding,) = result.findings
    assert f"{finding.corner}__{finding.component}" == part
    assert finding.change == pytest.approx(-0.2, abs=0.015)
    start, _, end = words.partition(" 20 % (18 to 22 %) ")
    assert finding.sentence.startswith(f"{start} ")
    assert f") {end}" in finding.sentence


def test_both_sides_of_a_stage_have_one_finding_in_words(baseline) -> None:
    both = {"bogie1_front_left__primary_spring": -0.2, "bogie1_front_right__primary_spring": -0.2}
    (finding,) = diagnose(windows(6, first=12, seed=3, **both), baseline).findings
    assert (finding.corner, finding.component) == ("bogie1_front", "primary_spring")
    assert finding.sentence.startswith("both bogie1-front primary springs ")


def test_an_unchanged_vehicle_is_called_so(baseline) -> None:
    assert diagnose(windows(6, first=12, seed=4), baseline).verdict == "no_change_detected"


def test_a_healthy_bogie_is_called_so_although_its_longitudinal_springs_are_not_seen() -> None:
    """Vertical motion does not determine them: the sentence names them, as it does hidden anti-roll bars."""
    bogie = read_vehicle("y25").model_copy(update={"kind": "rail", "sensor": read_vehicle("y25").sensor[:4]})
    settings = RailDrive(duration=180.0, sampling_rate=100.0, snr=50.0)
    drives = (simulate_drive(bogie, settings, seed=seed).recording for seed in range(7))
    *before, now = (observe_window(run, bogie, time=180.0 * k) for k, run in enumerate(drives))
    result = diagnose([now], learn(before))
    assert result.verdict == "no_change_detected"
    hidden = {part.kind for part, least in result.detectable.items() if least > 0.2}
    assert hidden == {"longitudinal_spring"}
    (sentence, _) = describe_diagnosis(result)
    assert sentence.endswith(
        "% of any other part would have been found, one of 20 % of a longitudinal spring would not"
    )


def test_two_sensors_on_one_bogie_find_its_soft_secondary_spring() -> None:
    """Its springs are known to 3 and 6 % by a drive, those of the other bogie hardly, and no temperature is known."""
    near = {"secondary_spring": 0.03, "secondary_damper": 0.015, "primary_spring": 0.01, "primary_damper": 0.03}
    stds = [near[p.kind] * (1 if "left" in p.corner else 2) * (1 if p.corner[:6] == "bogie1" else 6) for p in PARTS]
    values, C = np.random.default_rng(5).standard_normal((16, len(PARTS))) * stds, np.diag(np.square(stds))
    values[14:, PARTS.index(Component("bogie1_left", "secondary_spring"))] += np.log(0.75)
    drives = [Observation(600.0 * k, PARTS, x, C, {}, {}, ()) for k, x in enumerate(values)]
    known = learn(drives[:12])
    assert diagnose(drives[12:14], known).findings == ()
    (finding,) = diagnose(drives[14:], known).findings
    assert (finding.hypothesis, finding.change) == ("bogie1_left.secondary_spring", pytest.approx(-0.25, abs=0.04))
    assert finding.runner_up == ""


@pytest.mark.slow  # a fit of 200 s
def test_a_window_names_the_wheel_that_is_not_round() -> None:
    frames = ("bogie1_fl", "bogie1_rr", "bogie2_fl", "bogie2_rr")
    metro = read_vehicle("metro")
    metro = metro.model_copy(update={"sensor": tuple(one for one in metro.sensor if one.channel in frames)})
    worn = WheelOrders(run_out=(3e-4, 2e-4), wheels=("bogie2_front_left",), radius=0.46)
    drive = RailDrive(duration=200.0, sampling_rate=100.0, snr=30.0, welded=True, wheel_orders=worn)
    simulated = simulate_drive(metro, drive, seed=3)
    lines = simulated.truth["conditions"]["wheel_orders"]["bogie2_front_left"]
    true = np.sqrt(sum(line["amplitude"] ** 2 for line in lines) / 2)
    found = observe_window(simulated.recording.select([*frames, "speed"]), metro).run_outs
    (worst, (value, std)), (_, (second, _)) = sorted(found.items(), key=lambda one: -one[1][0])[:2]
    assert worst == "bogie2_front_left"
    assert value == pytest.approx(true, abs=2 * std)
    assert second < value / 2


def test_without_a_baseline_left_is_compared_with_right() -> None:
    (finding,) = diagnose(windows(6, seed=2, bogie1_left__secondary_spring=-0.4)).findings
    assert (finding.corner, finding.component) == ("bogie1_left", "secondary_spring")
    assert diagnose(windows(6, seed=3)).findings == ()


def test_a_baseline_leaves_the_file_as_it_is() -> None:
    """A vehicle on bogies cannot be calibrated, so that even windows that its file explains poorly change nothing."""
    metro = read_vehicle("metro")
    run = simulate_drive(metro, RailDrive(duration=30.0, sampling_rate=60.0), seed=1).recording
    spectra = usable_spectra([run], metro)
    assert spectra == ()
    assert calibrated_if_imperfect(spectra, metro, model_errors=[0.9]) is None
    with pytest.raises(ParameterError, match="but a calibration needs"):
        calibrate(run, metro)


@pytest.mark.slow
def test_figures_show_every_part(baseline) -> None:
    result = diagnose(windows(6, first=12, seed=2, bogie1_left__secondary_spring=-0.2), baseline)
    figure = corner_changes_figure(result, baseline)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[:3] == ["bogie1 left", "bogie1 right", "bogie1 front left"]
    assert len(titles) == 12
    assert float(figure.axes[0].texts[0].get_text().removesuffix(" %")) == pytest.approx(-20, abs=1.5)
    names = {axes.get_ylabel() for axes in trends_figure(result, baseline).axes}
    assert {f"{stage}-{kind} [%]" for stage in ("primary", "secondary") for kind in ("spring", "damper")} <= names


@pytest.mark.slow
def test_exchanged_sensors_of_one_frame_are_named_and_no_others() -> None:
    """Opposite corners of a frame exchanged: four sensors of that frame are swapped, none of the other or the body."""
    metro = read_vehicle("metro")
    run = simulate_drive(metro, RailDrive(duration=120.0, sampling_rate=60.0, snr=50.0, welded=True), seed=1).recording
    rows = list(range(len(run.channels)))
    first, second = run.index("bogie1_fl"), run.index("bogie1_rr")
    rows[first], rows[second] = second, first
    exchanged = Recording(run.samples[rows], run.sampling_rate, tuple(map(_plain, run.channels)))
    faults = observe_window(exchanged, metro).sensor_faults
    assert {fault.kind for fault in faults} == {"swapped"}
    assert {fault.channel for fault in faults} == {"bogie1_fl", "bogie1_fr", "bogie1_rl", "bogie1_rr"}


def _plain(channel: Channel) -> Channel:
    return Channel(channel.name, channel.quantity)
