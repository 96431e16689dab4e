"""A broker inside the monitor, for trials and single machines."""

import asyncio
import logging
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing, contextmanager
from typing import Any

from sprung._checks import required
from sprung.link import LOCAL_USER, Address, LinkError, keep_secret
from sprung.online.monitor.site import embedded_port

_PATIENCE = 10.0


class EmbeddedBroker:
    """An MQTT broker in a thread, open to programs on this machine that know its password.

    Parameters
    ----------
    secret
        Password of the user `sprung.link.LOCAL_USER`.
    host, port
        Address at which it listens.
    """

    def __init__(self, secret: str, host: str = "127.0.0.1", port: int = 1883) -> None:
        self._module = required("amqtt.broker", purpose="the embedded broker", extra="online")
        self._secret = secret
        self._listens_at = f"{host}:{port}"
        self._loop: asyncio.AbstractEventLoop | None = None
        self._started = threading.Event()
        self._problem = ""
        self._broker: Any = None
        self._thread = threading.Thread(target=self._run, name="broker", daemon=True)

    def open(self) -> None:
        """Start listening.

        Raises
        ------
        LinkError
            If it cannot listen.
        """
        for name in ("amqtt", "transitions"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._thread.start()
        self._started.wait(_PATIENCE)
        if self._problem or not self._started.is_set():
            raise LinkError(
                f"the embedded broker cannot listen at {self._listens_at} ({self._problem or 'no answer'}): "
                "stop the program that listens there, or give --broker"
            )

    def close(self) -> None:
        """Stop."""
        if self._loop is not None and self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._broker.shutdown(), self._loop).result(_PATIENCE)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_PATIENCE)

    def _run(self) -> None:
        """Serve until stopped."""
        with closing(asyncio.new_event_loop()) as self._loop:
            asyncio.set_event_loop(self._loop)
            self._serve(self._loop)
            self._loop.run_until_complete(_end_connections())

    def _serve(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start the broker in a loop, and run the loop until it is stopped."""
        settings = {
            "listeners": {"default": {"type": "tcp", "bind": self._listens_at}},
            "plugins": {"sprung.online.monitor.local_users.LocalUsers": {"secret": self._secret}},
        }
        try:
            self._broker = self._module.Broker(settings, loop=loop)
            self._broker.stream_connected = _closing(self._broker.stream_connected)
            loop.run_until_complete(self._broker.start())
        except Exception as error:  # any error of the library is reported
            self._problem = str(error.__cause__ or error)
            self._started.set()
            return
        self._started.set()
        loop.run_forever()


def _closing(serve: Callable[..., Awaitable[None]]) -> Callable[..., Awaitable[None]]:
    """Return a function that serves a connection and closes it at the end, which the library does not always do."""

    async def serve_and_close(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, **options: Any) -> None:
        try:
            await serve(reader, writer, **options)
        finally:
            writer.close()

    return serve_and_close


async def _end_connections() -> None:
    """End the connections that the library leaves open when it stops."""
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    await asyncio.sleep(0)  # connections close in the turn after their tasks


@contextmanager
def open_broker(broker: str) -> Iterator[Address]:
    """Yield the address of a broker; an embedded one runs until the end of the context.

    Parameters
    ----------
    broker
        Address of a broker, or "embedded" or "embedded:PORT" for one in this process.

    Raises
    ------
    ParameterError
        If it is not such an address.
    LinkError
        If an embedded broker cannot listen.
    SecretError
        If its password cannot be stored for other programs of this user.
    """
    port = embedded_port(broker)
    if port is None:
        yield Address.parse(broker)
        return
    with keep_secret(port) as secret:
        embedded = EmbeddedBroker(secret, port=port)
        embedded.open()
        try:
            yield Address("127.0.0.1", port, LOCAL_USER, secret, version="3")
        finally:
            embedded.close()
