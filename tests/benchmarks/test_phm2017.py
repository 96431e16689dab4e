"""Band powers of a car on bogies: the layout, and the changed part from exact powers."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest

from sprung.vehicles import read_vehicle

phm: Any = import_module("benchmarks.challenge.phm2017")
FEATURES, SENSORS = phm.FEATURES, phm.SENSORS


def test_there_are_five_features_of_each_sensor():
    assert len(FEATURES) == 5 * len(set(SENSORS)) == 90
    assert (FEATURES[0], FEATURES[5], FEATURES[45], FEATURES[-1]) == ("f101", "f106", "f146", "f190")
    assert (SENSORS[1], SENSORS[9], SENSORS[-1]) == ("azp_1r", "azs_2", "az_4l")


def test_the_sensors_are_where_the_layout_has_them():
    metro = read_vehicle("metro")
    places = {sensor.channel: (sensor.on, sensor.position) for sensor in phm.instrumented(metro).sensor}
    assert tuple(places) == SENSORS
    assert places["azs_2"] == ("body", (-7.2, 0.0, 0.0))
    assert places["azp_4l"] == ("bogie2", (-1.1, 1.0, 0.0))
    assert places["az_3r"] == ("wheelset3", (0.0, -1.0, 0.0))


@pytest.mark.slow
def test_a_weaker_spring_is_found_in_exact_powers():
    powers = phm.Powers(phm.instrumented(read_vehicle("metro")), phm.BANDS, 180.0)
    model = powers.model(22.0)
    parameters = model.start.copy()
    parameters[model.names.index("bogie2_rear_left.primary_spring")] = np.log(0.7)
    learnt = phm.Learnt(np.zeros(90), np.full(90, 0.01**2))
    said = phm.judged(powers, 22.0, powers.logarithms(model, parameters), learnt)
    probabilities, (low, high) = said["probabilities"], said["change"]
    assert sum(probabilities.values()) == pytest.approx(1)
    assert probabilities["bogie2_rear_left.primary_spring"] > 0.9
    assert low < -0.3 < high < -0.2
    healthy = phm.judged(powers, 22.0, powers.logarithms(model, model.start), learnt)["probabilities"]
    assert max(healthy, key=healthy.__getitem__) == "healthy"


@pytest.mark.slow
def test_powers_scatter_by_chance_as_those_of_drawn_lines_do():
    """Lines of a random signal are independent complex normal numbers; 8 s have two in each step of 0.25 Hz."""
    powers = phm.Powers(phm.instrumented(read_vehicle("metro")), phm.BANDS, 8.0)
    model = powers.model(22.0)
    spectra = powers.spectra(model, model.start)
    roots = np.linalg.cholesky(spectra + 1e-12 * np.trace(spectra, axis1=1, axis2=2)[:, None, None] * np.eye(18))
    generator, drawn = np.random.default_rng(1), []
    for _ in range(600):
        normal = generator.standard_normal((2, 2, *roots.shape[:2])) * np.sqrt(0.5)
        lines = np.einsum("fcd,lfd->lfc", roots, normal[0] + 1j * normal[1])
        density = np.mean(np.abs(lines) ** 2, axis=0).T
        drawn.append([power for each in density for power in phm.in_bands(powers.frequencies, each, phm.BANDS)])
    relative = np.array(drawn) / np.exp(powers.logarithms(model, model.start))
    seen, chance = np.cov(relative.T), powers.chance(model, model.start)
    assert np.mean(relative) == pytest.approx(1, abs=0.01)
    assert np.diag(seen) / np.diag(chance) == pytest.approx(np.ones(90), abs=0.3)
    assert np.mean(np.diag(seen) / np.diag(chance)) == pytest.approx(1, abs=0.05)
    std = np.sqrt(np.diag(chance))
    assert seen / np.outer(std, std) == pytest.approx(chance / np.outer(std, std), abs=0.3)
    assert chance[1, 6] / (std[1] * std[6]) > 0.1  # the body and the frame share the track


def test_a_file_without_features_is_refused(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text("speed,f101\n20,1\n", encoding="utf-8")
    with pytest.raises(SystemExit, match=r"lacks the columns f102, f103, f104, f105, f106: give speed \[m/s\]"):
        phm.read_rows(path)


def test_a_file_that_is_absent_or_too_short_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "few.csv"
    words = ["phm2017", "fit", str(path), "--out", str(tmp_path / "entry.json"), "--learn"]
    monkeypatch.setattr("sys.argv", [*words, "2"])
    with pytest.raises(SystemExit, match=r"few\.csv cannot be read"):
        phm.main()
    row = ",".join(["20"] + ["1e-3"] * 90)
    path.write_text("\n".join([",".join(["speed", *FEATURES]), row, row]), encoding="utf-8")
    for learn in ("1", "2"):
        monkeypatch.setattr("sys.argv", [*words, learn])
        with pytest.raises(SystemExit, match=f"--learn {learn} must be 2 or more, and less than the 2 rows"):
            phm.main()
