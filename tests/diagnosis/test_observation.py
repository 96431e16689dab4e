"""Observations of simulated drives: times, conditions, and what learning and diagnosis need of the residual test."""

from dataclasses import replace

import numpy as np
import pytest

from sprung import identification
from sprung.diagnosis import (
    diagnose,
    learn,
    learn_reference,
    observe,
    observe_window,
    residual_statistics,
    residual_test,
    windows,
    with_missing_as_faults,
)
from sprung.diagnosis import observation as observation_module
from sprung.diagnosis.observation import fit_drive
from sprung.errors import IdentificationError, ParameterError
from sprung.identification import IdentificationSettings, cov_ssi
from sprung.likelihood import fit_corners, fitting
from sprung.recording import Channel, Recording
from sprung.ride import assess_ride
from sprung.simulation import RailDrive, RoadConditions, RoadDrive, dead, simulate_drive
from sprung.vehicles import read_vehicle

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="module")
def run(car):
    """Ten minutes, in windows of two."""
    recording = simulate_drive(car, RoadDrive(snr=50.0, road=RoadConditions("C")), seed=1).recording
    return replace(recording, start=BEGUN)


@pytest.fixture(scope="module")
def observations(car, run):
    later = replace(run, start=BEGUN + 3600 * 10**9).part(0, run.n_samples // 5)
    return observe([run, later], car, length=120.0)


@pytest.mark.slow
def test_windows_of_recordings_in_the_order_of_time(car, run, observations) -> None:
    assert [one.time for one in observations] == [0.0, 120.0, 240.0, 360.0, 480.0, 3600.0]
    assert {one.vehicle for one in observations} == {"zafira"}
    assert all(one.is_conclusive for one in observations)
    (alone,) = observe(run.part(0, run.n_samples // 5), car, length=120.0)
    np.testing.assert_allclose(alone.log_ratios, observations[0].log_ratios, rtol=1e-9, atol=1e-12)


def test_conditions_of_a_conclusive_window(observations) -> None:
    conditions = observations[0].conditions
    assert {"roughness", "payload", "speed", "standing", "model_error", "segments"} <= conditions.keys()
    assert conditions["roughness"] == pytest.approx(256e-6, rel=0.2)  # G(n0) of class C, ISO 8608, geometric mean


def test_gaps_of_single_channels_cost_no_segments(car, run, observations) -> None:
    """Each of four accelerometers is missing for 20 of 120 s, at another time: one gap of all lasted 80 s."""
    samples = run.part(0, run.n_samples // 5).samples.copy()
    rate = run.sampling_rate
    for row in range(4):
        samples[row, round((5 + 28 * row) * rate) : round((25 + 28 * row) * rate)] = np.nan
    cut = observe_window(replace(run.part(0, run.n_samples // 5), samples=samples), car)
    whole = observations[0]
    assert cut.is_valid
    assert cut.conditions["segments"] == whole.conditions["segments"]
    assert cut.log_ratios == pytest.approx(whole.log_ratios, abs=0.02)
    assert np.diag(cut.covariance) == pytest.approx(np.diag(whole.covariance), rel=0.1)


def test_the_ride_of_a_window_is_that_of_its_accelerometers(run, observations) -> None:
    first = run.part(0, run.n_samples // 5).select(["acc_fl", "acc_fr", "acc_rl", "acc_rr"])
    expected = np.sqrt(np.mean([point.rms**2 for point in assess_ride(first).points]))
    assert observations[0].conditions["ride"] == pytest.approx(expected, rel=0.01)


def test_a_window_that_lacks_a_sensor_is_refused_or_says_so(car, run) -> None:
    """The sensor's channel has another name; allowed, the diagnosis carries the note, and the monitor a fault."""
    channels = tuple(replace(one, name="AccRR") if one.name == "acc_rr" else one for one in run.channels)
    other = replace(run.part(0, run.n_samples // 5), channels=channels)
    with pytest.raises(ParameterError, match=r"acc_rr \(did you mean 'AccRR'\?\)"):
        observe_window(other, car)
    lacking = observe_window(other, car, allow_missing=True)
    assert lacking.missing == ("acc_rr",)
    assert lacking.sensor_faults == ()
    assert diagnose([lacking]).notes[:2] == lacking.notes
    watched = with_missing_as_faults(lacking)
    assert [(fault.channel, fault.kind) for fault in watched.sensor_faults] == [("acc_rr", "missing")]
    assert with_missing_as_faults(lacking, known=["acc_rr"]).sensor_faults == ()


def test_windows_are_compared_with_a_baseline_of_the_same_sensors(car, run, observations) -> None:
    lacking = [replace(one, missing=("acc_rr",)) for one in observations]
    without = learn(lacking[:5], min_windows=5)
    assert without.missing == ("acc_rr",)
    assert without.notes[0] == "the baseline was learnt without the sensors acc_rr of the vehicle file"
    assert without.accepts(lacking[0])
    assert not without.accepts(observations[0])
    complete = learn([*observations[:5], lacking[5]], min_windows=5)
    assert (complete.missing, complete.n_windows, complete.n_refused) == ((), 5, 1)
    notes = diagnose([lacking[0]], complete).notes
    excluded = "1 of 1 window was excluded because they lack the sensors acc_rr, unlike those of the baseline"
    assert f"{excluded}: learn it again with the same sensors" in notes


def test_the_residual_test_needs_no_samples(car, run, observations) -> None:
    """Learnt from and compared with what observations carry: as from the recordings themselves."""
    parts = [run.part(k, k + run.n_samples // 5) for k in range(0, run.n_samples, run.n_samples // 5)]
    outputs = [part.select(part.names[:4]) for part in parts]
    expected = learn_reference([residual_statistics(output, sampling_rate=25.0) for output in outputs])
    baseline = learn(observations[:5], min_windows=5)
    assert baseline.residuals is not None
    assert baseline.residuals.n_windows == expected.n_windows
    np.testing.assert_allclose(baseline.residuals.mean, expected.mean, rtol=1e-9)
    last = run.part(0, run.n_samples // 5)
    tests = diagnose([one.without_segments() for one in observations], baseline).residual_tests
    assert tests.keys() == {one.time for one in observations}
    single = residual_test(expected, residual_statistics(last.select(last.names[:4]), sampling_rate=25.0))
    assert tests[3600.0].statistic == pytest.approx(single.statistic, rel=1e-9)
    assert tests[3600.0].p_value == pytest.approx(single.p_value, rel=1e-6)


def test_an_observation_without_segments_is_small(observations) -> None:
    """Four outputs at 11 lags: 1.4 kB."""
    residuals = observations[0].residuals
    assert residuals.mean.nbytes == 4 * 4 * 11 * 8
    assert residuals.segments.nbytes == residuals.n_segments * residuals.mean.nbytes
    compact = observations[0].without_segments()
    assert compact.residuals.segments is None
    assert compact.residuals.mean is residuals.mean or np.array_equal(compact.residuals.mean, residuals.mean)
    without = [one.without_segments().residuals for one in observations]
    with pytest.raises(ParameterError, match="lacks the correlations of its segments"):
        learn_reference(without)


def test_a_window_with_a_failing_sensor_has_no_residual_test(car, run) -> None:
    broken = observe_window(dead(run.part(0, 24_000), channel="acc_rl"), car)
    assert broken.sensor_faults
    assert broken.residuals is None


def test_a_second_opinion_that_disagrees_is_noted(observations) -> None:
    baseline = learn(observations[:5], min_windows=5)
    agreed = diagnose(observations, baseline)
    (note,) = [note for note in agreed.notes if note.startswith("second opinion")]
    assert note.endswith("windows differ from those of the baseline (p < 0.001)")
    residuals = observations[0].residuals.without_segments()
    other = replace(residuals, mean=10 * residuals.mean[::-1])  # each channel moves as another one did, and much more
    strange = replace(observations[0], residuals=other, time=7200.0)
    tests = diagnose([strange], baseline)
    assert tests.residual_tests[7200.0].is_different
    assert any("it disagrees" in note for note in tests.notes)


@pytest.mark.parametrize(
    ("condition", "value"),
    [("speed", 2.0), ("payload", 2000.0), ("roughness", 1.0), ("payload_y_moment", -34.0), ("right_over_left", 1.3)],
)
def test_windows_in_conditions_not_met_before_have_no_second_opinion(observations, condition, value) -> None:
    """The residuals depend on the conditions.

    Speeds below those of the baseline made 9 of 14 healthy windows differ, 400 kg behind and a little to the right 8 of
    8.
    """
    baseline = learn(observations[:5], min_windows=5)
    within = {name: sum(ends) / 2 for name, ends in baseline.ranges.items()}
    residuals = replace(observations[0].residuals, mean=10 * observations[0].residuals.mean[::-1])
    strange = replace(observations[0], residuals=residuals, conditions={**observations[0].conditions, **within})
    assert diagnose([strange], baseline).residual_tests
    far = replace(strange, conditions={**strange.conditions, condition: value})
    diagnosis = diagnose([far], baseline)
    assert not diagnosis.residual_tests
    assert not any("second opinion" in doubt for doubt in diagnosis.doubts)
    is_regressed = condition != "right_over_left"
    assert any(f"have a {condition.replace('_', ' ')} far from" in note for note in diagnosis.notes) == is_regressed


def test_windows_follow_each_other_and_keep_the_rest() -> None:
    samples = np.arange(1300.0)[None, :]
    run = Recording(samples, 1.0, (Channel("a", "acceleration"),))
    parts = list(windows([run, run], length=600.0))
    assert [time for time, _ in parts] == [0.0, 600.0, 1300.0, 1900.0]
    assert [part.n_samples for _, part in parts] == [600, 700, 600, 700]
    dated = replace(run, start=10**18)
    assert [time for time, _ in windows([dated, replace(dated, start=10**18 + 10**13)], length=2000.0)] == [0.0, 10**4]


@pytest.fixture
def fitted_as(car, run, monkeypatch):
    """Return a function from a share of lines and a model error to the observation of a window with such a fit."""

    def observed(share, model_error):
        window = run.part(0, run.n_samples // 5)
        fit = fit_corners(window, car)
        weights = fit.model.spectra.weights.copy()
        weights[:, : round(share * weights.shape[1])] = 0.0
        model = replace(fit.model, spectra=replace(fit.model.spectra, weights=weights))
        poor = replace(fit, model=model, model_error=model_error)
        monkeypatch.setattr(observation_module, "fit_windows", lambda *_, **__: poor)
        return observe_window(window, car)

    return observed


@pytest.mark.parametrize(("share", "model_error"), [(0.2, 0.6), (0.3, 0.2)])
def test_a_window_that_is_explained_but_for_lines_is_conclusive(fitted_as, share, model_error) -> None:
    assert fitted_as(share, model_error).is_conclusive


@pytest.mark.parametrize(
    ("share", "model_error", "lines"), [(0.0, 1.1, ""), (0.3, 0.3, " with 30 % of the spectra left out for lines")]
)
def test_a_window_that_is_explained_badly_is_inconclusive(fitted_as, share, model_error, lines) -> None:
    """Misfit that is called lines explains nothing: the fit has chosen its data."""
    badly = f"the vehicle file explains the window poorly: model error {100 * model_error:.0f} %"
    assert fitted_as(share, model_error).reason == badly + lines


@pytest.mark.slow
def test_a_window_of_another_vehicle_is_inconclusive(car) -> None:
    """A wagon with the file of a car: the fit has many optima, and rounding chooses one with a third of the data."""
    assert not observe_window(
        simulate_drive(read_vehicle("y25"), RailDrive(snr=50.0), seed=200).recording, car
    ).is_conclusive


def test_conditions_of_an_inconclusive_window(car) -> None:
    yaw = car.sensor[0].model_copy(
        update={"channel": "yaw_rate", "quantity": "angular_velocity", "unit": "deg/s", "direction": (0.0, 0.0, -1.0)}
    )
    car = car.model_copy(update={"sensor": (*car.sensor, yaw)})
    run = simulate_drive(car, RoadDrive(duration=30.0), seed=1).recording
    samples = run.samples.copy()
    samples[run.index("speed"), : run.n_samples // 4] = 0.0
    samples[run.index("yaw_rate")] = 0.2
    warm = np.full((1, run.n_samples), 21.5)
    channels = (*run.channels, Channel("oil", "temperature"))
    found = observe_window(replace(run, samples=np.concatenate([samples, warm]), channels=channels), car)
    assert not found.is_conclusive
    assert found.conditions["standing"] == pytest.approx(0.25, abs=0.01)
    assert found.conditions["temperature"] == pytest.approx(21.5)
    assert found.conditions["turning"] == pytest.approx(0.2)


@pytest.mark.slow
def test_modes_of_a_drive_are_a_start_of_its_fit_and_a_check_where_the_fit_is_doubtful(car, run, monkeypatch) -> None:
    part = run.part(0, run.n_samples // 5)
    modes = cov_ssi(part, settings=IdentificationSettings(has_road_modes=False, refine=False), vehicle=car).modes

    def no_modes(*_, **__):
        raise IdentificationError("no mode")

    with monkeypatch.context() as patched:
        patched.setattr(identification, "cov_ssi", no_modes)
        certain = fit_drive([part], car)
    assert certain.from_modes is None
    np.testing.assert_array_equal(certain.log_ratios, fit_corners(part, car).log_ratios)

    monkeypatch.setattr(fitting, "RULES", replace(fitting.RULES, doubtful=2.0))
    expected, fit = fit_corners(part, car, modes=modes), fit_drive(part, car)
    np.testing.assert_array_equal(fit.log_ratios, expected.log_ratios)
    np.testing.assert_array_equal(fit.from_modes, expected.from_modes)
    assert fit.from_modes is not None
    monkeypatch.setattr(identification, "cov_ssi", no_modes)
    assert fit_drive([part], car).from_modes is None
