"""The simulated fleet: endless drives, and when its faults begin."""

from itertools import islice

import numpy as np
import pytest

from sprung.link import joined
from sprung.online.demo import Member, drives
from sprung.vehicles import read_vehicle

pytest.importorskip("numba")
START = 1_700_000_000_000_000_000


def minute(member: Member):
    """Return the first minute of the drive of a member."""
    return joined(list(islice(drives(read_vehicle("zafira"), member, START), 12)))


@pytest.mark.slow
def test_a_drive_comes_in_blocks_that_follow_each_other() -> None:
    run = minute(Member("car-1", 1))
    assert (run.start, run.duration, run.gaps) == (START, pytest.approx(60.0), ())
    assert np.isfinite(run.samples).all()


@pytest.mark.slow
def test_a_fault_and_a_dead_sensor_begin_after_their_piece() -> None:
    healthy = minute(Member("car-1", 1))
    later = minute(Member("car-1", 1, fault="front_left.spring=-0.5", dead_channel="acc_rr", after=1))
    faulty = minute(Member("car-1", 1, fault="front_left.spring=-0.5", dead_channel="acc_rr", after=0))
    assert np.array_equal(later.samples, healthy.samples)
    assert not faulty.samples[faulty.index("acc_rr")].any()
    assert not np.allclose(faulty.samples[faulty.index("acc_fl")], healthy.samples[healthy.index("acc_fl")])
    assert np.array_equal(faulty.samples[faulty.index("speed")], healthy.samples[healthy.index("speed")])
