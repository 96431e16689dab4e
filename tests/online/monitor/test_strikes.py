"""Which frames are set aside after failures of the analysis."""

from sprung.online.monitor.strikes import Strikes


def test_a_frame_that_fails_twice_is_left_out_then_the_window_of_a_later_one() -> None:
    strikes = Strikes()
    assert strikes.add("car-1", 1, 7, done=4) is None
    assert strikes.add("car-2", 1, 7, done=4) is None
    assert strikes.add("car-1", 1, 7, done=4) == 7
    strikes.leave_out("car-1")
    assert strikes.add("car-1", 1, 9, done=4) == 5
    assert strikes.add("car-1", 1, 9, done=4) == 5, "the store refused"
    strikes.leave_out("car-1")
    assert strikes.add("car-1", 1, 12, done=9) is None, "begun anew"


def test_one_failure_before_a_frame_that_was_left_out_costs_no_frame() -> None:
    strikes = Strikes()
    assert [strikes.add("car-1", 1, 9, done=4) for _ in range(2)] == [None, 9]
    strikes.leave_out("car-1")
    assert [strikes.add("car-1", 1, 7, done=4) for _ in range(2)] == [None, 7]
    strikes.leave_out("car-1")
    assert strikes.add("car-1", 1, 8, done=4) is None
    assert strikes.add("car-1", 1, 12, done=4) == 5, "a later one"


def test_failures_in_different_places_or_of_different_boots_are_no_row() -> None:
    strikes = Strikes()
    places = [(1, 7), (1, 8), (2, 8), (1, 8), (1, 8)]
    assert [strikes.add("car-1", boot, seq, done=-1) for boot, seq in places] == [None] * 4 + [8]


def test_a_stored_state_ends_the_row() -> None:
    strikes = Strikes()
    strikes.add("car-1", 1, 7, done=-1)
    strikes.forget("car-1")
    strikes.forget("car-9")
    assert strikes.add("car-1", 1, 7, done=-1) is None
