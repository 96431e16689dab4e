"""Documents of fitted corners."""

import numpy as np
import pytest

import sprung
from sprung.results.documents import (
    corners_document,
)
from sprung.vehicles import Component


@pytest.fixture(scope="module")
def fit(drive):
    return sprung.fit_corners(drive.recording, sprung.read_vehicle("zafira"))


def test_corners_are_read_as_they_were_written(fit, plain, tmp_path) -> None:
    sprung.write_corners(fit, tmp_path / "corners.json")
    document = sprung.read_corners(tmp_path / "corners.json")
    written = plain(corners_document(fit))
    assert plain(document) == written
    spring = document.corners["front_left"]["spring"]
    assert spring.value == fit.values[fit.components.index(Component("front_left", "spring"))]
    assert "from_modes" not in written["corners"]["front_left"]["spring"]
    assert np.diag(document.fit.correlation).tolist() == [1.0] * len(fit.components)
