"""A limit on the total time of a conversation: socket time-outs are per part, and a slow server can evade them."""

import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol, Self, TypeVar


class _Connection(Protocol):
    """A client of `http.client` or `smtplib`."""

    sock: Any


C = TypeVar("C", bound=_Connection)

#: Time between attempts to end a connection [s]: during a TLS handshake, which has its own limit, it has no socket.
_AGAIN = 1.0


class Watch:
    """Ends the connections of a conversation that takes too long, which raises an error in their reader.

    Parameters
    ----------
    limit
        Longest time within the context [s].

    Notes
    -----
    The resolution of names, and attempts to connect to several addresses of a host, are not ended.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._connections: list[_Connection] = []
        self._finished, self._over = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._finished.set()
        self._thread.join()

    @property
    def is_over(self) -> bool:
        """Whether the limit has passed within the context."""
        return self._over.is_set()

    def add(self, connection: _Connection) -> None:
        """Watch a connection."""
        self._connections.append(connection)

    def over(self, connect: Callable[..., C]) -> Callable[..., C]:
        """Return a function that opens connections as `connect` does, and watches them."""

        def watched(*arguments: Any, **options: Any) -> C:
            connection = connect(*arguments, **options)
            self.add(connection)
            return connection

        return watched

    def _run(self) -> None:
        """End the connections when the limit has passed, until the conversation is finished."""
        wait = self._limit
        while not self._finished.wait(wait):
            self._over.set()
            for sock in [connection.sock for connection in self._connections]:
                if sock is not None:
                    with suppress(OSError):
                        sock.shutdown(socket.SHUT_RDWR)
            wait = min(_AGAIN, self._limit)
