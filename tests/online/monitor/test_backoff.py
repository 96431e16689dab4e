from sprung.online.monitor.backoff import Backoff


def test_the_time_between_attempts_doubles_up_to_five_minutes() -> None:
    now = [0.0]
    backoff = Backoff(lambda: now[0])
    assert backoff.is_due("a")
    waits = []
    for number in range(1, 14):
        assert backoff.fail("a") == number
        begun = now[0]
        while not backoff.is_due("a"):
            now[0] += 0.5
        waits.append(now[0] - begun)
    assert waits == [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300, 300]
    assert (backoff.is_due("b"), backoff.n_waiting) == (True, 1)


def test_success_starts_anew() -> None:
    backoff = Backoff(lambda: 0.0)
    for _ in range(5):
        backoff.fail("a")
    assert not backoff.is_due("a")
    backoff.succeed("a")
    assert (backoff.is_due("a"), backoff.n_waiting) == (True, 0)
    assert backoff.fail("a") == 1
    assert backoff.is_due("a")
