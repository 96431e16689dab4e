"""Order, scale, offset and time do not change what is identified."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.identification.runs import assert_same, run

from sprung.identification import METHODS, IdentificationSettings
from sprung.modal import mac


@pytest.mark.parametrize("method", METHODS)
def test_permuted_channels_give_the_same_modes(method) -> None:
    records = [run(seed) for seed in range(3)]
    order = ["acc_3", "acc_1", "acc_2"]
    straight, turned = METHODS[method](records), METHODS[method]([record.select(order) for record in records])
    assert_same(straight, turned, deviations=1e-6)
    assert turned.modes.channels == tuple(order)
    np.testing.assert_allclose(turned.modes.mode_shapes, straight.modes.mode_shapes[:, [2, 0, 1]], atol=1e-6)


@cache
def of_three_records(method, settings=None):
    """Identification of records as they are."""
    return METHODS[method]([run(seed) for seed in range(3)], settings=settings)


@pytest.mark.slow
@pytest.mark.parametrize("factors", [(1e-6, 1.0, 1e6), (1e6, 1e6, 1e6), (-1.0, 1.0, 1e-3)])
@pytest.mark.parametrize("method", METHODS)
def test_scaled_channels_give_the_same_poles_and_scaled_shapes(method, factors) -> None:
    scale = np.array(factors)
    scaled = [record.changed("scaled", samples=record.samples * scale[:, None]) for record in map(run, range(3))]
    # The search ends within 0.01 standard deviations.
    assert_same(of_three_records(method), METHODS[method](scaled), deviations=0.03)
    settings = IdentificationSettings(refine=False)
    straight, changed = of_three_records(method, settings), METHODS[method](scaled, settings=settings)
    assert_same(straight, changed, deviations=1e-6)
    back = mac(changed.modes.mode_shapes / scale, straight.modes.mode_shapes)
    assert 1 - np.diag(back).min() < 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_offsets_and_the_time_of_day_do_not_matter(method) -> None:
    record = run()
    moved = replace(record.changed("offset", samples=record.samples + 9.81), start=1_700_000_000_000_000_000)
    assert_same(METHODS[method](record), METHODS[method](moved), deviations=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_the_order_of_records_hardly_matters(method) -> None:
    """What is chosen from the first record (scales of channels) changes in the fourth digit.

    A few products change the subset then, and another order may represent a mode of a subset.
    """
    records = [run(seed) for seed in range(4)]
    settings = IdentificationSettings(band=(4.0, 40.0), decimate_to=125.0, block_rows=40, max_order=32, segment=5.0)
    straight = METHODS[method](records, settings=settings)
    assert_same(
        straight, METHODS[method](records[::-1], settings=settings), deviations=0.6 if method == "coss" else 0.01
    )
