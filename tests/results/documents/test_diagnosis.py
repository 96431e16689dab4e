"""Documents of windows, findings and diagnoses."""

import json

import numpy as np
import pytest

import sprung
from sprung.diagnosis import Trend
from sprung.errors import FormatError
from sprung.results.documents import diagnosis_document, observation_document, observation_from_document


def test_windows_are_read_as_they_were_written(observations, same) -> None:
    nothing = sprung.Observation(
        5.0,
        (),
        np.zeros(0),
        np.zeros((0, 0)),
        {"temperature": np.nan, "speed": 3.0},
        {},
        (sprung.SensorFault("acc_fl", "dead", "stays at 0"),),
        "no segment",
    )
    for observation in (observations[0], nothing):
        again = observation_from_document(json.loads(json.dumps(observation_document(observation), allow_nan=False)))
        assert same({**again.conditions}.keys(), observation.conditions.keys())
        assert list(again.conditions.values()) == pytest.approx(list(observation.conditions.values()), nan_ok=True)
        for name in ("time", "components", "log_ratios", "covariance", "modes", "sensor_faults", "reason"):
            assert same(getattr(again, name), getattr(observation, name))
    with pytest.raises(FormatError, match="the window's time is not valid"):
        observation_from_document({**observation_document(nothing), "time": "now"})


def test_a_finding_keeps_its_trend(observations, baseline, plain) -> None:
    from dataclasses import replace

    diagnosis = sprung.diagnose(observations, baseline)
    trend = Trend(-0.02, (-0.03, -0.01), (2.0, 6.0))
    finding = replace(diagnosis.findings[0], trend=trend, change=None, interval=None, score=None)
    document = diagnosis_document(replace(diagnosis, findings=(finding,)))
    written = plain(document)["findings"][0]
    assert written["trend"] == {"per_hour": -0.02, "interval": [-0.03, -0.01], "hours_to_limit": [2.0, 6.0]}
    assert document.findings == (finding,)
