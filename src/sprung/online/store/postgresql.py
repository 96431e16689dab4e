"""Connections to PostgreSQL that wait for a limited time, whatever the server does."""

from typing import Any, TypeVar

import psycopg
from psycopg.abc import PQGen
from psycopg.pq import TransactionStatus

T = TypeVar("T")

#: Longest time for an answer, for connecting, for a statement on the server, and for a lock on it [s].
ANSWER, CONNECT, STATEMENT, LOCK = 20.0, 5, 15, 10


class LimitedConnection(psycopg.Connection[Any]):
    """A connection that is closed if the server does not answer within 20 s.

    Notes
    -----
    The limits of the server bound its own work. One that is frozen enforces none of them, and its machine still
    confirms what arrives, so that the limits of TCP do not help either.
    """

    #: Longest time for an answer [s]; None: any.
    patience: float | None = None

    def wait(self, gen: PQGen[T], interval: float = 0.1, timeout: float | None = None) -> T:
        """Return what the server answers.

        Raises
        ------
        psycopg.OperationalError
            If it does not answer in time.
        """
        patience = self.patience if timeout is None else timeout
        try:
            return super().wait(gen, interval, patience)
        except psycopg.OperationalError:
            if patience is None or self.pgconn.transaction_status != TransactionStatus.ACTIVE:
                raise
        self.pgconn.finish()
        raise psycopg.OperationalError(f"no answer within {patience:g} s")


def connected(*given: Any, **settings: Any) -> LimitedConnection:
    """Return a connection to an address; its settings count before the limits of this module.

    Raises
    ------
    psycopg.OperationalError
        If the server does not answer in time.
    """
    limits = {
        "connect_timeout": CONNECT,
        "keepalives_idle": 10,
        "keepalives_interval": 5,
        "keepalives_count": 3,
        "tcp_user_timeout": round(1000 * ANSWER),
        "options": f"-c statement_timeout={STATEMENT}s -c lock_timeout={LOCK}s",
    }
    connection: LimitedConnection = LimitedConnection.connect(*given, **{**limits, **settings})
    connection.patience = ANSWER
    return connection
