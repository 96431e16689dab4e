"""Refused messages are counted by vehicle and reason, and made-up names fill nothing."""

from sprung.online.monitor.refusals import INVALID, OTHERS, OVERLOAD, Refusals


def test_refusals_are_counted_by_vehicle_and_reason() -> None:
    refusals = Refusals()
    for vehicle, reason in (("car-1", INVALID), ("car-1", OVERLOAD), ("car-1", INVALID), ("", INVALID)):
        refusals.add(vehicle, reason)
    assert refusals.counts == {("car-1", INVALID): 2, ("car-1", OVERLOAD): 1, (OTHERS, INVALID): 1}
    assert refusals.total == 4


def test_names_beyond_the_first_thousand_are_counted_together() -> None:
    refusals = Refusals()
    for number in range(1500):
        refusals.add(f"car-{number}", INVALID)
    refusals.add("car-7", INVALID)
    assert len(refusals.counts) == 1001
    assert refusals.counts[OTHERS, INVALID] == 500
    assert refusals.counts["car-7", INVALID] == 2
