"""Directions in which components change together."""

import numpy as np
import pytest

from sprung.diagnosis.scatter import directions, kinds_of, typical_nuisance
from sprung.vehicles import Component


def components(*names):
    return tuple(map(Component.parse, names))


SPRINGS = ("front_left.spring", "front_right.spring", "rear_left.spring", "rear_right.spring")


def test_pairs_ends_and_all_of_a_kind() -> None:
    pairs, ends, together = directions(components(*SPRINGS))
    assert pairs.tolist() == [[1, -1, 0, 0], [0, 0, 1, -1]]
    assert ends.tolist() == [[0.5, 0.5, -0.5, -0.5]]
    assert together.tolist() == [[1, 1, 1, 1]]


def test_kinds_with_different_numbers_of_axles() -> None:
    """Dampers of the front axle only: they have no front against rear."""
    some = components(*SPRINGS, "front_left.damper", "front_right.damper")
    _, ends, _ = directions(some)
    assert kinds_of(ends, some) == ["spring"]
    nuisance = typical_nuisance(some, {"spring": 0.008, "damper": 0.012})
    assert nuisance[4, 5] == pytest.approx(0.25**2)  # all dampers together
    assert nuisance[0, 2] == pytest.approx(0.08**2 - (0.008 / 2) ** 2)  # together, and against each other
    assert np.linalg.eigvalsh(nuisance).min() > -1e-12
