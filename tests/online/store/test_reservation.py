"""One monitor works on a store: another is refused on a file, and stands by on PostgreSQL."""

import pytest

from sprung.online.store import ReservationLostError, StoredFrame, StoreError, open_store

FRAME = StoredFrame("car-1", 1, 0, 0, b"")


def test_a_file_is_refused_to_a_second_monitor(sqlite_file) -> None:
    url = f"sqlite:///{sqlite_file}"
    with open_store(url) as first, open_store(url) as second:
        assert first.reservation.take("depot, process 7")
        with pytest.raises(StoreError, match=r"used by another monitor \(depot, process 7 since"):
            second.reservation.take("other")
        first.reservation.release()
        assert second.reservation.take("other")


def test_a_second_monitor_stands_by_until_the_first_ends(postgresql_url) -> None:
    with open_store(postgresql_url) as first, open_store(postgresql_url) as second:
        assert [one.reservation.take("a") for one in (first, second, first)] == [True, False, True]
        first.reservation.check()
        first.reservation.release()
        assert second.reservation.take("b")


def test_what_a_monitor_writes_after_it_lost_the_connection_is_refused(postgresql_url) -> None:
    with open_store(postgresql_url) as first, open_store(postgresql_url) as second:
        assert first.reservation.take("a")
        with first.reservation.fenced():
            first.inbox.add_frames([FRAME], now=0)
        with second.writing() as connection:
            connection.exec_driver_sql("SELECT pg_terminate_backend(%s, 5000)", (first.reservation._pid,))
        assert second.reservation.take("b")
        with first.reservation.fenced(), pytest.raises(ReservationLostError):
            first.inbox.add_frames([FRAME._replace(seq=1)], now=0)
        with pytest.raises(ReservationLostError):
            first.reservation.check()
        assert second.inbox.cursor("car-1", 1).contiguous == 0


@pytest.mark.slow
def test_who_takes_over_waits_for_transactions_under_way(postgresql_url) -> None:
    """Otherwise it would read a store to which the one before still adds."""
    with open_store(postgresql_url) as first, open_store(postgresql_url) as second:
        assert first.reservation.take("a")
        with first.reservation.fenced(), first.writing():
            first.reservation.release()
            with pytest.raises(StoreError, match="lock timeout"):
                second.reservation.take("b")
        assert second.reservation.take("b")
