import math

import pytest

from sprung.reproduce.chapter import over_seeds


@pytest.mark.slow
@pytest.mark.parametrize("n_processes", [1, 2])
def test_runs_come_in_the_order_of_their_seeds(n_processes) -> None:
    shares: list[float] = []
    assert over_seeds(math.isqrt, [0, 1, 4, 9, 16], n_processes=n_processes, on_progress=shares.append) == [
        0,
        1,
        2,
        3,
        4,
    ]
    assert shares == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
