"""Frequency weightings against the tables of ISO 2631-1."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.ride import WEIGHTINGS, response_of, weighted

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
def test_tables(name) -> None:
    for nominal, factor in TABLES[name].items():
        exact = 10 ** (round(10 * np.log10(nominal)) / 10)
        assert abs(response_of(name, np.array([exact]))[0]) == pytest.approx(factor / 1000, rel=0.013)


@pytest.mark.parametrize("name", [*WEIGHTINGS, "Sperling vertical"])
def test_a_sine_is_weighted_by_the_response(name) -> None:
    rate, frequency = 200.0, 0.3 if name == "Wf" else 6.0
    time = np.arange(round(120 * rate)) / rate
    found = weighted(np.sin(2 * np.pi * frequency * time), sampling_rate=rate, weighting=name)[round(60 * rate) :]
    assert np.sqrt(2 * np.mean(found**2)) == pytest.approx(abs(response_of(name, np.array([frequency]))[0]), rel=5e-3)


def test_an_unknown_weighting_is_refused() -> None:
    with pytest.raises(ParameterError, match="Wk"):
        weighted(np.zeros(10), sampling_rate=10.0, weighting="Wx")
