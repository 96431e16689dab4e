"""Types: vehicles and windows of known covariances, production scatter, faults from the start, and fleets."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from sprung.diagnosis import (
    Observation,
    compare_with_type,
    diagnose,
    learn,
    learn_type,
    nominal_type,
    rank_fleet,
    to_inspect,
)
from sprung.diagnosis.scatter import directions, kinds_of
from sprung.diagnosis.type_baselines import PRODUCTION_SCATTER
from sprung.diagnosis.type_learning import usable_windows
from sprung.errors import DataError, ParameterError
from sprung.vehicles import Component, read_vehicle, structure

COMPONENTS = tuple(structure(read_vehicle("zafira")).components())
PAIRS, ENDS, TOGETHER = directions(COMPONENTS)
OF_FIT = 0.012**2 * (np.eye(12) + 0.3)
LOSS = float(np.log(0.8))
BETWEEN = 0.03**2 * PAIRS.T @ PAIRS / 4 + 0.04**2 * ENDS.T @ ENDS + 0.06**2 * TOGETHER.T @ TOGETHER + 1e-12 * np.eye(12)


def drawn(generator, n_windows, *, fault="", size=LOSS, name="hatch", slope=0.0, offset=0.0):
    """Return windows of one vehicle of a type: BETWEEN vehicles, OF_FIT within, dampers by temperature."""
    mean = np.linalg.cholesky(BETWEEN) @ generator.standard_normal(12) + offset
    if fault:
        mean[COMPONENTS.index(Component.parse(fault))] += size
    dampers = np.array([component.kind == "damper" for component in COMPONENTS])
    windows = []
    for number in range(n_windows):
        temperature = float(generator.uniform(0, 40))
        values = mean + np.linalg.cholesky(OF_FIT) @ generator.standard_normal(12)
        values = values + dampers * slope * (temperature - 20)
        conditions = {"temperature": temperature, "speed": float(generator.uniform(8, 18))}
        windows.append(Observation(600.0 * number, COMPONENTS, values, OF_FIT, conditions, {}, (), vehicle=name))
    return windows


def fleet(seed, n_vehicles, n_windows, faults=(), **options):
    generator = np.random.default_rng(seed)
    every = [*faults, *[""] * (n_vehicles - len(faults))]
    return {f"car-{k}": drawn(generator, n_windows, fault=fault, **options) for k, fault in enumerate(every)}


@pytest.mark.parametrize("faults", [(), ("front_left.spring", "rear_right.damper", "front_right.tyre") * 8])
def test_known_covariances_come_back(faults) -> None:
    """200 vehicles, also with 12 % faulty ones: mean, slopes, and the covariances between and within vehicles."""
    found = learn_type(fleet(1, 200, 3, faults, slope=-0.009, offset=0.1))
    assert (found.name, found.n_vehicles, found.n_windows) == ("hatch", 200, 600)
    np.testing.assert_allclose(found.mean, 0.1, atol=0.02)
    dampers = np.array([component.kind == "damper" for component in COMPONENTS])
    np.testing.assert_allclose(found.slopes[dampers, 3], -0.09, atol=0.005)
    for rows in (PAIRS, ENDS, TOGETHER / 4):
        own, truth = (np.sqrt(np.diag(rows @ matrix @ rows.T)) for matrix in (found.between, BETWEEN))
        np.testing.assert_allclose(own, truth, rtol=0.35 if faults else 0.15)
    np.testing.assert_allclose(found.scales, 1.0, rtol=0.1)


def test_nothing_is_compared_where_the_file_explains_most_windows_badly() -> None:
    """One window of four that a wrong file happens to explain is no evidence of a fault."""
    windows = [
        replace(window, conditions={**window.conditions, "model_error": error})
        for window, error in zip(
            drawn(np.random.default_rng(3), 8, fault="front_left.damper", size=-0.4),
            (0.3, 0.3, 0.1, 0.3, 0.1, 0.1, 0.1, 0.1),
            strict=True,
        )
    ]
    assert diagnose(windows[2:3]).findings
    assert diagnose(windows[:4]).detection is None
    most = diagnose(windows).detection
    assert most is not None
    assert len(most.times) == len(most.evidence) == 5


def test_a_fault_from_the_start_is_found_by_comparing_left_with_right() -> None:
    found = diagnose(drawn(np.random.default_rng(3), 6, fault="rear_left.spring"))
    (finding,) = found.findings
    assert (finding.corner, finding.component) == ("rear_left", "spring")
    assert finding.change == pytest.approx(-0.2, abs=0.1)
    assert found.detection is not None
    names = [candidate.hypothesis.name for candidate in found.detection.candidates[:2]]
    assert names == ["rear_left.spring", "rear_right.spring"]
    assert any("both sides of an axle alike is not found" in note for note in found.notes)
    sound = diagnose(drawn(np.random.default_rng(4), 6))
    assert sound.findings == ()


def test_both_sides_changed_alike_is_found_with_a_type_and_not_without() -> None:
    of_type = learn_type(fleet(5, 40, 3))
    generator = np.random.default_rng(6)
    windows = drawn(generator, 6)
    tyres = np.array([(c.axle, c.kind) == ("rear", "tyre") for c in COMPONENTS]) * np.log(0.8)
    flat = [
        Observation(w.time, COMPONENTS, w.log_ratios + tyres, OF_FIT, w.conditions, {}, (), vehicle="hatch")
        for w in windows
    ]
    assert diagnose(flat).findings == ()
    found = diagnose(flat, type_baseline=of_type)
    assert [finding.hypothesis for finding in found.findings] == ["rear.tyre"]
    assert any("compared with 40 vehicles of the type hatch" in note for note in found.notes)


def test_a_change_between_the_windows_is_found_without_a_baseline() -> None:
    generator = np.random.default_rng(7)
    windows = drawn(generator, 12)
    weaker = np.eye(12)[COMPONENTS.index(Component("front_right", "damper"))] * np.log(0.88)
    later = [Observation(w.time, COMPONENTS, w.log_ratios + weaker, OF_FIT, w.conditions, {}, ()) for w in windows[6:]]
    found = compare_with_type([*windows[:6], *later], nominal_type(COMPONENTS, name=""))
    assert found is not None
    assert found.is_alert
    assert found.candidates[0].hypothesis.name == "front_right.damper"
    assert found.candidates[0].onset == 3600.0


@pytest.mark.slow
def test_p_values_of_sound_vehicles_hold_and_faults_are_found() -> None:
    """Production scatter drawn as stated: at most 1 % beyond p = 1 %; of 20 % losses about 90 % beyond p = 0.1 %."""
    of_type = nominal_type(COMPONENTS, name="")
    sides = np.array([PRODUCTION_SCATTER[COMPONENTS[int(np.flatnonzero(row)[0])].kind] for row in PAIRS])
    evidence, n_found = [], 0
    for seed in range(200):
        generator = np.random.default_rng([seed, 8])
        own = PAIRS.T @ (sides * generator.standard_normal(6)) / 2
        fit = np.linalg.cholesky(OF_FIT / 6) @ generator.standard_normal(12)
        for fault in (False, True):
            size = np.eye(12)[seed % 12] * np.log(0.8) * fault
            window = Observation(0.0, COMPONENTS, own + fit + size, OF_FIT / 6, {}, {}, ())
            found = compare_with_type([window], of_type)
            assert found is not None
            if fault:
                right = found.candidates[0].hypothesis.name == str(COMPONENTS[seed % 12])
                n_found += found.is_alert and right
            else:
                evidence.append(found.evidence[-1])
    assert np.sum(np.array(evidence) > np.log(100)) <= 3  # 2 expected at most
    assert n_found >= 0.88 * 200


def test_windows_are_not_compared_with_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a depot with 214 vehicles, the parts of 1,500 windows were compared 64 million times."""
    windows = [replace(window, components=tuple(map(replace, COMPONENTS))) for window in fleet(9, 1, 60)["car-0"]]
    compared, equal = count(), Component.__eq__
    monkeypatch.setattr(Component, "__eq__", lambda one, other: next(compared) >= 0 and equal(one, other))
    assert usable_windows({"car-0": windows}) == {"car-0": windows}
    assert len(windows) * 12 <= next(compared) <= len(windows) * 12 * 4


@pytest.mark.slow
def test_a_fleet_is_ranked_with_the_faulty_first() -> None:
    """Twenty vehicles with two windows each, five of them with a part 20 % weaker; nobody has a baseline."""
    faults = ("front_left.spring", "rear_right.damper", "front_right.tyre", "rear_left.tyre", "front_left.damper")
    ranked = rank_fleet(fleet(9, 20, 2, faults))
    assert len(ranked) == 20
    first = {one.vehicle: one.detection.candidates[0].hypothesis.name for one in ranked[:5]}
    assert first == {f"car-{k}": fault for k, fault in enumerate(faults)}
    discoveries = [one.is_discovery for one in ranked]
    assert sum(discoveries[:5]) >= 4
    assert not any(discoveries[5:])
    assert not any(one.is_discovery for one in rank_fleet(fleet(10, 20, 2)))


def test_the_type_stands_in_for_windows_of_a_new_vehicle() -> None:
    """Two windows predict those at other temperatures with the type, and badly without it: dampers lose 0.9 % per K."""
    of_type = learn_type(fleet(11, 60, 4, slope=-0.009))
    with_type: list[np.ndarray] = []
    alone: list[np.ndarray] = []
    for seed in range(12):
        windows = drawn(np.random.default_rng([seed, 12]), 20, slope=-0.009)
        for errors, known in ((with_type, of_type), (alone, None)):
            learnt = learn(windows[:2], type_baseline=known, min_windows=2)
            assert learnt.n_windows == 2
            errors.extend(learnt.residual(window) for window in windows[2:])
    assert np.sqrt(np.mean(np.square(with_type))) < 0.025
    assert np.sqrt(np.mean(np.square(alone))) > 0.04


def test_too_few_vehicles_and_other_components_are_refused() -> None:
    with pytest.raises(DataError, match="3 vehicles have usable windows, and 4 are needed"):
        learn_type(fleet(13, 3, 2))
    with pytest.raises(DataError, match="4 vehicles have usable windows, and 5 are needed"):
        rank_fleet(fleet(13, 4, 2))
    of_type = learn_type(fleet(13, 5, 2))
    windows = [
        Observation(w.time, COMPONENTS[1:], w.log_ratios[1:], OF_FIT[1:, 1:], w.conditions, {}, ())
        for w in drawn(np.random.default_rng(14), 3)
    ]
    with pytest.raises(ParameterError, match="the components differ from those of the type's baseline"):
        learn(windows, type_baseline=of_type)


@pytest.mark.parametrize("error", [0.0, 0.15])
def test_a_load_that_no_vehicle_of_the_type_carried_is_no_deviation_where_the_file_misfits(error) -> None:
    """Eight vehicles, and one with 250 kg m behind that reads as rear springs 45 % stiffer, beside front ones."""
    by_load = 0.3 * ENDS[kinds_of(ENDS, COMPONENTS).index("spring")]

    def loaded(seed, moments):
        generator, windows = np.random.default_rng(seed), []
        mean = np.linalg.cholesky(BETWEEN) @ generator.standard_normal(12)
        for number, moment in enumerate(moments):
            values = mean + np.linalg.cholesky(OF_FIT) @ generator.standard_normal(12) + by_load * moment / 100
            conditions = {"model_error": error, "payload_x_moment": float(moment)}
            windows.append(Observation(600.0 * number, COMPONENTS, values, OF_FIT, conditions, {}, ()))
        return windows

    of_type = learn_type({f"car-{seed}": loaded(seed, (0.0, -2.0, 2.0)) for seed in range(8)})
    assert of_type.model_error == error
    found = diagnose(loaded(9, (-250.0, -240.0, -260.0)), type_baseline=of_type)
    assert bool(found.findings) == (error == 0.0)


def test_a_vehicle_known_to_be_healthy_belongs_to_the_type_however_far_it_is() -> None:
    """Of twelve vehicles one has a damper 40 % harder: clipped as a fault, unless it was found healthy."""
    far = fleet(3, 12, 3, ("front_left.damper",), size=0.35)
    row = PAIRS[next(n for n, pair in enumerate(PAIRS) if pair[COMPONENTS.index(Component.parse("front_left.damper"))])]
    clipped, whole = learn_type(far), learn_type(far, healthy=["car-0"])
    assert row @ whole.between @ row > 1.5 * (row @ clipped.between @ row)
    assert row @ whole.mean > row @ clipped.mean


@pytest.mark.slow
def test_what_is_known_to_be_healthy_is_not_ranked_and_widens_the_type() -> None:
    far = fleet(3, 12, 3, ("front_left.damper", "front_right.damper"), size=0.25)
    before = {one.vehicle: one for one in rank_fleet(far)}
    rest = {vehicle: own for vehicle, own in far.items() if vehicle != "car-0"}
    after = {one.vehicle: one for one in rank_fleet(rest, healthy={"car-0": far["car-0"]})}
    assert after.keys() == rest.keys()
    assert after["car-1"].detection.e_value < before["car-1"].detection.e_value
    assert after["car-1"].probability < before["car-1"].probability


@pytest.mark.slow
def test_the_vehicle_to_inspect_is_the_one_of_which_least_is_known() -> None:
    """A loss of 10 % is neither sure nor nothing; a loss of 30 % is reported, and needs no advice."""
    vehicles = fleet(9, 12, 2, ("front_left.spring",), size=float(np.log(0.9)))
    vehicles |= {"car-1": drawn(np.random.default_rng(5), 2, fault="rear_left.spring", size=float(np.log(0.7)))}
    ranked = rank_fleet(vehicles)
    best = to_inspect(ranked)
    assert best is not None
    assert best.vehicle == "car-0"
    assert best.detection.candidates[0].hypothesis.name == "front_left.spring"
    assert 0.1 < best.probability < 0.9
    (sure,) = [one for one in ranked if one.is_discovery]
    assert sure.vehicle == "car-1"
    assert sure.probability > 0.99
    assert best.information == max(one.information for one in ranked if not one.is_discovery)


def test_a_loss_is_named_earlier_where_the_fleet_knows_how_parts_scatter() -> None:
    """A loss of 7 % in ten windows after a baseline of six: by the scatter that 20 baselines show, and by its own."""
    vehicles = fleet(9, 20, 16)
    faulty = drawn(np.random.default_rng(4), 16, fault="front_left.spring", size=float(np.log(0.93)))
    healthy = drawn(np.random.default_rng(4), 16)
    vehicles["car-0"] = [*healthy[:6], *faulty[6:]]
    baselines = {vehicle: learn(own[:6]) for vehicle, own in vehicles.items()}
    ranked = rank_fleet({vehicle: own[6:] for vehicle, own in vehicles.items()}, baselines=baselines)
    assert [one.vehicle for one in ranked if one.is_discovery] == ["car-0"]
    alone = rank_fleet({"car-0": vehicles["car-0"][6:]}, baselines={"car-0": baselines["car-0"]})
    assert alone[0].detection.e_value < np.log(20 / 0.05) < ranked[0].detection.e_value


def test_vehicles_with_a_baseline_need_no_verdict() -> None:
    vehicles = fleet(9, 6, 8)
    baselines = {vehicle: learn(own[:6]) for vehicle, own in vehicles.items()}
    ranked = rank_fleet({vehicle: own[6:] for vehicle, own in vehicles.items()}, baselines=baselines)
    assert to_inspect(ranked) is None
