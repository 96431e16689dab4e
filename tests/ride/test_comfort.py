"""Ride by standards against closed forms."""

import json
from pathlib import Path

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Recording
from sprung.ride import WEIGHTINGS, assess_ride, mean_comfort_in_words, response_of, weighted

#: Factors times 1000 at third octaves, ISO 2631-1:1997, tables 3 and 4 (printed for the exact middle frequencies).
TABLES: dict[str, dict[float, float]] = {
    "Wk": {0.5: 418, 1: 482, 2: 531, 4: 967, 5: 1039, 6.3: 1054, 8: 1036, 10: 988, 20: 636, 31.5: 403, 63: 186},
    "Wd": {0.5: 853, 1: 1011, 1.25: 1008, 2: 890, 4: 512, 8: 253, 16: 125, 31.5: 63.2, 63: 29.5},
    "Wf": {0.1: 695, 0.125: 895, 0.16: 1006, 0.2: 992, 0.25: 854, 0.315: 619, 0.4: 384, 0.5: 224, 0.63: 116},
    "Wc": {0.5: 843, 1: 991, 4: 1024, 8: 899, 16: 518, 31.5: 254},
    "We": {0.5: 862, 1: 880, 2: 511, 4: 253, 8: 125},
    "Wj": {1: 484, 2: 482, 4: 628, 5: 795, 8: 1016, 16: 1019, 31.5: 1000},
}


@pytest.mark.parametrize("name", TABLES)
def test_tables(name, conforms) -> None:
    exact = [10 ** (round(10 * np.log10(nominal)) / 10) for nominal in TABLES[name]]
    factors = np.array(list(TABLES[name].values())) / 1000
    what = f"factors of the weighting {name}"
    conforms("ISO 2631-1:1997", "tables 3 and 4", what, abs(response_of(name, np.array(exact))), factors, rel=0.013)


@pytest.mark.parametrize("name", [*WEIGHTINGS, "Sperling vertical"])
def test_a_sine_is_weighted_by_the_response(name, conforms) -> None:
    rate, frequency = 200.0, 0.3 if name == "Wf" else 6.0
    time = np.arange(round(120 * rate)) / rate
    found = weighted(np.sin(2 * np.pi * frequency * time), sampling_rate=rate, weighting=name)[round(60 * rate) :]
    gain, what = abs(response_of(name, np.array([frequency]))[0]), f"a sine weighted over time by {name}"
    is_sperling = name.startswith("Sperling")
    source, clause = ("Sperling", "frequency weighting") if is_sperling else ("ISO 8041-1:2017", "5.6, table 3")
    conforms(source, clause, what, np.sqrt(2 * np.mean(found**2)), gain, rel=5e-3)


PEER = json.loads((Path(__file__).parents[2] / "benchmarks" / "data" / "phonometry.json").read_text("utf-8"))


def sweep_with_shocks(time):
    """Return what `benchmarks/ride.py` gave to phonometry."""
    sweep = np.sin(np.pi * time / time[-1]) * np.sin(2 * np.pi * (0.5 * time + 0.2 * time**2))
    return sweep + sum(
        6 * np.sin(np.pi * (time - at) / 0.05) * ((time >= at) & (time < at + 0.05)) for at in (12, 30, 41)
    )


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_weightings_are_those_of_phonometry(name, conforms) -> None:
    """Another implementation, at third octaves from 0.02 to 400 Hz, and over time: a minute of sweeps and shocks."""
    expected, rate = PEER["weightings"][name], PEER["sampling_rate"]
    factors = abs(response_of(name, np.array(PEER["thirds"])))
    conforms(
        PEER["source"], "third octaves", f"factors of the weighting {name}", factors, expected["factors"], rel=1e-9
    )
    found = weighted(sweep_with_shocks(np.arange(round(60 * rate)) / rate), sampling_rate=rate, weighting=name)
    rms, vdv = np.sqrt(np.mean(found**2)), (np.sum(found**4) / rate) ** 0.25
    conforms(PEER["source"], "a minute of sweeps and shocks", f"RMS by {name}", rms, expected["rms"], rel=1e-3)
    conforms(PEER["source"], "a minute of sweeps and shocks", f"VDV by {name}", vdv, expected["vdv"], rel=1e-3)


def test_running_values_are_those_of_phonometry(conforms) -> None:
    rate = PEER["sampling_rate"]
    samples = sweep_with_shocks(np.arange(round(60 * rate)) / rate)
    point = assess_ride(Recording(samples[None], rate, (Channel("seat_z", "acceleration"),))).points[0]
    for name in ("rms", "mtvv", "vdv"):
        what, expected = f"{name.upper()} of a ride by Wk", PEER["weightings"]["Wk"][name]
        conforms(PEER["source"], "a minute of sweeps and shocks", what, getattr(point, name), expected, rel=1e-3)


def test_an_unknown_weighting_is_refused() -> None:
    with pytest.raises(ParameterError, match="Wk"):
        weighted(np.zeros(10), sampling_rate=10.0, weighting="Wx")


RATE = 200.0
TIME = np.arange(round(60 * RATE)) / RATE


def recording(rows, *channels) -> Recording:
    return Recording(np.atleast_2d(rows), RATE, tuple(channels))


def sine(frequency, rms=1.0):
    return rms * np.sqrt(2) * np.sin(2 * np.pi * frequency * TIME)


def test_a_sine_on_a_seat(conforms) -> None:
    point = assess_ride(recording(sine(8.0), Channel("seat_z", "acceleration"))).points[0]
    gain = abs(response_of("Wk", np.array([8.0]))[0])
    source = "ISO 2631-1:1997"
    conforms(source, "6.1", "weighted RMS of a sine", point.rms, gain, rel=5e-3)
    conforms(source, "6.3.1", "MTVV of a sine: running RMS over 1 s", point.mtvv, gain, rel=2e-2)
    assert point.crest_factor == pytest.approx(np.sqrt(2), rel=0.1)  # higher where the shaking begins
    dose = gain * (1.5 * 60) ** 0.25  # mean of sin^4 is 3/8, of an RMS of 1 3/2
    conforms(source, "6.3.2", "VDV of a sine of a minute", point.vdv, dose, rel=1e-2)
    assert (point.axis, point.weighting, point.rating) == ("z", "Wk", "uncomfortable")


@pytest.mark.parametrize(
    ("rms", "rating"),
    [
        (0.2, "not uncomfortable"),
        (0.4, "a little uncomfortable"),
        (0.55, "a little to fairly uncomfortable"),
        (3.0, "extremely uncomfortable"),
    ],
)
def test_words_of_comfort(rms, rating) -> None:
    gain = abs(response_of("Wk", np.array([8.0]))[0])
    assert assess_ride(recording(sine(8.0, rms / gain), Channel("z", "acceleration"))).points[0].rating == rating


def test_mean_comfort_of_three_axes(conforms) -> None:
    channels = [Channel(f"floor_{axis}", "acceleration") for axis in "xyz"]
    rows = [sine(1.0, 0.1), sine(1.0, 0.1), sine(5.0, 0.2)]
    ride = assess_ride(recording(rows, *channels), standards=("en12299",))
    horizontal, vertical = (abs(response_of(*each)[0]) for each in (("Wd", np.array([1.0])), ("Wb", np.array([5.0]))))
    expected = 6 * np.sqrt(2 * (0.1 * horizontal) ** 2 + (0.2 * vertical) ** 2)
    conforms("EN 12299", "mean comfort N_MV", "N_MV of sines on three axes", ride.mean_comfort, expected, rel=2e-2)
    assert mean_comfort_in_words(1.2) == "very comfortable"
    assert [point.rating for point in ride.points] == [None, "very comfortable", "comfortable"]


def test_sperling(conforms) -> None:
    point = assess_ride(recording(sine(5.0, 0.5), Channel("z", "acceleration")), standards=("sperling",)).points[0]
    weighted = 0.5 * abs(response_of("Sperling vertical", np.array([5.0]))[0])
    conforms("Sperling", "ride index Wz", "Wz of a vertical sine", point.value, 4.42 * weighted**0.3, rel=5e-3)


def test_hunting_of_a_bogie_is_its_running_rms(conforms) -> None:
    noise = 0.01 * np.random.default_rng(1).standard_normal(TIME.size)
    speed = np.full(TIME.size, 50.0)
    run = recording([sine(6.0, 2.0) + noise, speed], Channel("bogie_y", "acceleration"), Channel("speed", "speed"))
    point = assess_ride(run, standards=("en14363",)).points[0]
    conforms("EN 14363", "instability: RMS over 100 m", "running RMS of a sine in noise", point.value, 2.0, rel=2e-2)
    assert point.weighting == "4.0 to 8.0 Hz"


def test_exceedances_of_the_limit_of_a_bogie_are_counted() -> None:
    """A bogie of 10 t has the limit 5 m/s^2; the sine of 5 Hz has 7 m/s^2 RMS for two spells and 2 m/s^2 between."""
    level = np.where((TIME % 30 > 10) & (TIME % 30 < 20) & (TIME < 60), 7.0, 2.0)
    run = recording(np.sqrt(2) * level * np.sin(2 * np.pi * 5 * TIME), Channel("bogie_y", "acceleration"))
    point = assess_ride(run, standards=("en14363",), bogie_mass=10e3).points[0]
    assert point.n_exceedances == 2
    assert point.rating == "unstable: 2 times above 5 m/s²"
    assert assess_ride(run, standards=("en14363",)).points[0].n_exceedances is None
    with pytest.raises(ParameterError, match="bogie_mass"):
        assess_ride(run, standards=("en14363",), bogie_mass=70e3)


def test_histograms_of_a_swing_are_those_of_the_arcsine() -> None:
    frequency = 0.9731  # no multiple of the sampling rate, so that the values fill the bins
    run = recording(0.04 * np.sin(2 * np.pi * frequency * TIME), Channel("fork", "displacement"))
    travel = assess_ride(run).travel[0]
    for histogram, largest in ((travel.travel_histogram, 0.04), (travel.speed_histogram, 0.08 * np.pi * frequency)):
        edges = np.clip(np.array(histogram.edges) / largest, -1, 1)
        expected = np.diff(np.arcsin(edges)) / np.pi
        np.testing.assert_allclose(histogram.shares[1:-1], expected[1:-1], atol=5e-3)
        assert sum(histogram.shares) == pytest.approx(1)


def test_travel() -> None:
    ride = assess_ride(
        recording(0.04 * np.sin(2 * np.pi * TIME), Channel("fork", "displacement")), available_travel=0.1
    )
    travel = ride.travel[0]
    assert (travel.lowest, travel.highest) == pytest.approx((-0.04, 0.04), abs=1e-6)
    assert travel.share_used == pytest.approx(0.8, rel=1e-3)
    assert travel.n_bottomed == 0
    assert travel.bump_speed == pytest.approx(0.08 * np.pi * np.sin(0.95 * np.pi / 2), rel=1e-2)


def test_shocks_are_noted() -> None:
    shaken = sine(8.0, 0.1)
    shaken[6000:6010] += 20.0
    notes = assess_ride(recording(shaken, Channel("z", "acceleration"))).notes
    assert len(notes) == 1
    assert notes[0].endswith("see MTVV and VDV of z")


def test_missing_values_are_left_out() -> None:
    """The rates, gaps and channels of files differ; an RMS is over the time with values."""
    slow = Recording(sine(8.0, 2.0)[None, ::2], RATE / 2, (Channel("z", "acceleration"),))
    dead = sine(8.0)
    dead[TIME > 1] = np.nan
    holed = sine(8.0)
    holed[(TIME > 20) & (TIME < 40)] = np.nan
    whole = recording([holed, dead], Channel("z", "acceleration"), Channel("other", "acceleration"))
    ride = assess_ride([whole, slow])
    gain = abs(response_of("Wk", np.array([8.0]))[0])
    assert [point.channel for point in ride.points] == ["z"]
    assert ride.points[0].rms == pytest.approx(gain * np.sqrt((40 + 4 * 60) / 100), rel=5e-3)
    assert ride.points[0].vdv == pytest.approx(gain * (1.5 * (40 + 16 * 60)) ** 0.25, rel=5e-3)
    assert len(ride.points[0].continuous) == 4 + 4 + 12
    assert ride.notes[-2:] == ("z has values for 100 of 120 s", "other has no values and is left out")


@pytest.mark.parametrize(
    ("name", "hours", "words"),
    [
        ("z", 4.0, "caution after 4 h a day"),
        ("seat_y", 4.0, "caution after 4 h a day"),
        ("z", 1.0, "caution after 1 h a day, risk likely after 16 h"),
        ("z", 0.5, "caution after 30 min a day, risk likely after 8 h"),
        ("z", 25.0, "no caution within a day"),
    ],
)
def test_caution_is_advised_from_the_dose_of_a_day(name, hours, words) -> None:
    """A VDV of 8.5 m/s^1.75 in that time; horizontal vibration counts 1.4 times (ISO 2631-1, 7.2.3, B.3.1)."""
    weighting, factor = ("Wk", 1.0) if name == "z" else ("Wd", 1.4)
    gain = factor * abs(response_of(weighting, np.array([8.0]))[0])
    rms = 8.5 / (gain * (1.5 * 3600 * hours) ** 0.25)
    assert assess_ride(recording(sine(8.0, rms), Channel(name, "acceleration"))).points[0].health == words


def test_weightings_of_other_places_are_chosen() -> None:
    rolling, heaving = Channel("gyro_x", "angular_velocity"), Channel("deck_z", "acceleration")
    back, speed = Channel("back_x", "acceleration"), Channel("speed", "speed")
    run = recording([sine(2.0), sine(0.2), sine(8.0), np.full(TIME.size, 20.0)], rolling, heaving, back, speed)
    turned, sick, behind = (assess_ride(run, weighting=name).points for name in ("We", "Wf", "Wc"))
    gains = [abs(response_of(*each)[0]) for each in (("We", np.array([2.0])), ("Wf", np.array([0.2])))]
    assert [point.channel for point in (*turned, *sick, *behind)] == ["gyro_x", "deck_z", "back_x"]
    assert turned[0].value == pytest.approx(0.63 * 4 * np.pi * gains[0], rel=2e-2)  # rad/s to rad/s^2, then m/s^2
    assert sick[0].value == pytest.approx(gains[1] * np.sqrt(60), rel=5e-2)
    assert sick[0].rating == f"{sick[0].value / 3:.2g} % may vomit"
    assert behind[0].value == pytest.approx(0.8 * behind[0].rms)
    with pytest.raises(ParameterError, match="of iso2631"):
        assess_ride(run, standards=("sperling",), weighting="Wf")


def test_three_axes_have_a_vibration_total() -> None:
    channels = [Channel(f"seat_{axis}", "acceleration") for axis in "xyz"]
    ride = assess_ride(recording([sine(2.0, 0.3), sine(2.0, 0.4), sine(8.0, 0.5)], *channels))
    gains = [abs(response_of(name, np.array([at]))[0]) for name, at in (("Wd", 2.0), ("Wd", 2.0), ("Wk", 8.0))]
    expected = np.sqrt(sum((gain * rms) ** 2 for gain, rms in zip(gains, (0.3, 0.4, 0.5), strict=True)))
    assert ride.vibration_total == pytest.approx(expected, rel=1e-2)


def test_a_standard_that_judges_no_channel_is_refused() -> None:
    with pytest.raises(DataError, match=r"en14363 judges none of these axes \(frame is z\)"):
        assess_ride(recording(sine(1.0), Channel("frame", "acceleration")), standards=("en14363",))


def test_a_recording_without_motion_is_refused() -> None:
    with pytest.raises(DataError, match="no channel"):
        assess_ride(recording(sine(1.0), Channel("speed", "speed")))
