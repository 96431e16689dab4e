"""The HTTP server: a thread next to the monitor's loop."""

import asyncio
import socket
import threading
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from sprung.errors import ParameterError
from sprung.online.site.app import application
from sprung.online.site.shared import LIMITS, Context, is_loopback


class Server:
    """Serves pages, interface, figures and health.

    Parameters
    ----------
    context
        Store, settings and running monitor.

    Raises
    ------
    ParameterError
        If other machines could reach it without accounts or TLS.
    """

    def __init__(self, context: Context) -> None:
        check_exposure(context)
        self._context = context
        self._socket: socket.socket | None = None
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port; for a free port of any number, known once the server is open."""
        host, port = self._context.site.http_address
        return host, port if self._socket is None else int(self._socket.getsockname()[1])

    def open(self) -> None:
        """Start answering.

        Raises
        ------
        ParameterError
            If the address, the certificate or its key cannot be used.
        """
        host, port = self._context.site.http_address
        web = self._context.site.web
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            self._socket = socket.create_server((host, port), family=family, backlog=128)
        except OSError as error:
            raise ParameterError(f"cannot listen at {host}:{port} ({error.strerror}): give another --http") from None
        config = uvicorn.Config(
            application(self._context),
            http=_Patient,
            ws="none",
            lifespan="on",
            log_config=None,
            log_level="error",  # requests that cannot be read are the fault of their senders
            access_log=False,
            server_header=False,
            proxy_headers=web.behind_proxy,
            timeout_keep_alive=LIMITS.keep_alive,
            timeout_graceful_shutdown=LIMITS.grace,
            limit_concurrency=LIMITS.max_connections,
            h11_max_incomplete_event_size=LIMITS.max_head,
            ssl_certfile=web.certificate,
            ssl_keyfile=web.key,
        )
        try:
            config.load()
        except OSError as error:
            self._socket.close()
            raise ParameterError(f"certificate {web.certificate} or key {web.key} cannot be used: {error}") from None
        self._server = uvicorn.Server(config)
        serving = self._server.serve([self._socket])
        self._thread = threading.Thread(target=asyncio.run, args=(serving,), name="http", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        if self._server is not None and self._thread is not None and self._socket is not None:
            self._server.should_exit = True
            self._thread.join(2.0 * LIMITS.grace)
            self._socket.close()
            self._socket = self._server = self._thread = None


def check_exposure(context: Context) -> None:
    """Refuse to serve other machines without accounts, or without TLS.

    Raises
    ------
    ParameterError
        If the site's address is not of this machine alone, and it has no accounts, or neither TLS nor a proxy.
    """
    host, web = context.site.http_address[0], context.site.web
    if is_loopback(host):
        return
    if not context.store.accounts.n_accounts():
        raise ParameterError(
            f"http {context.site.http} would let every machine that reaches {host} act without a password: add an "
            "account first (sprung accounts add NAME --role admin), or listen at 127.0.0.1"
        )
    if web.certificate is None and not web.behind_proxy:
        raise ParameterError(
            f"http {context.site.http} would send passwords unencrypted: give certificate and key in [web] of the "
            "site file, or set behind_proxy = true where a proxy provides TLS"
        )


class _Patient(H11Protocol):
    """A connection that ends if no request comes, or if what was sent is not taken, after a while."""

    _heads: asyncio.TimerHandle | None = None
    _writes: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin a connection."""
        super().connection_made(transport)
        self._await_head()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._await_head()

    def pause_writing(self) -> None:
        """Begin to wait for the client to take what was sent."""
        super().pause_writing()
        self._writes = self.loop.call_later(LIMITS.write_timeout, self.transport.abort)

    def resume_writing(self) -> None:
        """Resume, as the client took what was sent."""
        super().resume_writing()
        _cancel(self._writes)

    def connection_lost(self, exc: Exception | None) -> None:
        """End a connection."""
        _cancel(self._heads)
        _cancel(self._writes)
        super().connection_lost(exc)

    def _await_head(self) -> None:
        """Limit the time until the next request, however slowly its head comes."""
        _cancel(self._heads)
        self._heads = self.loop.call_later(LIMITS.head_timeout, self._give_up)

    def _give_up(self) -> None:
        """End the connection if there is no request, when the client has what was sent, or after a while."""
        if self.cycle is None or self.cycle.response_complete:
            self._heads = self.loop.call_later(LIMITS.write_timeout, self.transport.abort)
            self.transport.close()


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
