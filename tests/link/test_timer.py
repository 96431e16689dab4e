"""A timer on a clock set by hand."""

from sprung.link import Every


def test_due_at_once_and_again_after_the_time() -> None:
    now = [100.0]
    timer = Every(10.0, lambda: now[0])
    assert timer.is_due
    assert timer.started is None
    timer.start()
    assert timer.started == 100.0
    for time, is_due in ((100.0, False), (109.9, False), (110.0, True), (500.0, True)):
        now[0] = time
        assert timer.is_due is is_due
    timer.start()
    assert not timer.is_due
    timer.reset()
    assert timer.is_due
