import numpy as np
import pytest

from sprung.reproduce.thesis import matched, theoretical
from sprung.vehicles import chain


@pytest.fixture
def truth():
    return theoretical(chain())


def test_the_truth_matches_itself(truth) -> None:
    match = matched(truth, truth)
    assert match.natural_frequency == pytest.approx(truth.natural_frequency)
    assert match.damping_ratio == pytest.approx([0.01124, 0.03149, 0.04551], abs=1e-5)
    assert match.mac == pytest.approx(1)
    assert match.n_others == 0


def test_missing_and_other_modes(truth) -> None:
    match = matched(truth.take(np.array([2])), truth)
    assert np.isnan(match.natural_frequency[:2]).all()
    assert match.natural_frequency[2] == pytest.approx(28.3905, abs=1e-4)
    apart = matched(truth, truth.take(np.array([0])))
    assert (apart.mac.size, apart.n_others) == (1, 2)


def test_a_mode_far_off_or_of_another_shape_does_not_match(truth) -> None:
    import dataclasses

    far = dataclasses.replace(truth, poles=truth.poles * 1.2)
    assert matched(far, truth).n_others == 3
    turned = dataclasses.replace(truth, mode_shapes=truth.mode_shapes[::-1])
    assert np.isnan(matched(turned, truth).natural_frequency[[0, 2]]).all()


def test_labels_choose_modes() -> None:
    from sprung.vehicles import read_vehicle, structure

    modes = theoretical(structure(read_vehicle("zafira")), labels=("bounce", "roll"))
    assert modes.labels == ("bounce", "roll")
