"""The guard that every request passes first: limits of rate, size and time, and headers that browsers enforce."""

import asyncio
import math
from base64 import b64encode
from collections import OrderedDict
from collections.abc import Callable
from hashlib import sha256
from ipaddress import IPv6Address, ip_address

from starlette.responses import JSONResponse, PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from sprung.online.site.shared import LIMITS

_POLICY = b"content-security-policy"


def policy(*styles: str) -> str:
    """Return what a page may load and do: only what this server serves, and `<style>` elements of known contents.

    Charts set attributes of style.
    """
    hashes = "".join(f" 'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in styles)
    return (
        f"default-src 'none'; script-src 'self'; style-src 'self'{hashes}; style-src-attr 'unsafe-inline'; "
        "img-src 'self' data: blob:; connect-src 'self'; font-src 'self'; form-action 'self'; "
        "frame-ancestors 'none'; base-uri 'none'"
    )


HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), microphone=(), geolocation=()"),
)


class RateLimit:
    """A bucket of tokens for each address.

    Parameters
    ----------
    rate
        Requests per second in the long run.
    burst
        Requests at once.
    timer
        Present time [s] of a monotonic clock.
    """

    def __init__(self, rate: float, burst: float, timer: Callable[[], float]) -> None:
        self._rate = rate
        self._burst = burst
        self._timer = timer
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait(self, address: str) -> float:
        """Take a token, and return 0; or the time until there is one [s]."""
        now = self._timer()
        left, since = self._buckets.pop(address, (self._burst, now))
        left = min(self._burst, left + self._rate * (now - since))
        is_allowed = left >= 1
        self._buckets[address] = (left - is_allowed, now)
        if len(self._buckets) > LIMITS.max_addresses:
            self._buckets.popitem(last=False)
        return 0.0 if is_allowed else (1 - left) / self._rate


class Attempts:
    """Limits of attempts to log in.

    Few by one address to one name, more by one address and to one name: whoever tries the passwords of a person does
    not keep that person out, and many addresses together are slow, too.

    Parameters
    ----------
    timer
        Present time [s] of a monotonic clock.
    """

    def __init__(self, timer: Callable[[], float]) -> None:
        self._both = RateLimit(1 / 30, 5, timer)
        self._address = RateLimit(1 / 6, 30, timer)
        self._name = RateLimit(1 / 3, 100, timer)

    def wait(self, address: str, name: str) -> float:
        """Take an attempt, and return 0; or the time until there is one [s]."""
        network, name = network_of(address), name[: LIMITS.max_name]
        # In turn: attempts that one limit refuses do not count for the next.
        return self._both.wait(f"{network} {name}") or self._address.wait(network) or self._name.wait(name)


class Guard:
    """Limits and headers around an application.

    Parameters
    ----------
    app
        Application.
    limit
        Rate of requests of each address.
    hosts
        Names by which browsers may call this server; None: any. Without it, a page of another site could reach a server
        that asks for no password by giving its own name this machine's address.
    is_secure
        Whether browsers reach this server by TLS only.
    """

    def __init__(self, app: ASGIApp, *, limit: RateLimit, hosts: frozenset[str] | None, is_secure: bool) -> None:
        self._app = app
        self._limit = limit
        self._hosts = hosts
        secure = (b"strict-transport-security", b"max-age=31536000")
        self._headers = [*HEADERS, *([secure] if is_secure else [])]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = dict(scope["headers"])
        # The answer to HEAD is the beginning of that to GET.
        is_head = scope.get("method") == "HEAD"
        scope = {**scope, "method": "GET"} if is_head else scope
        is_begun = asyncio.Event()

        async def sending(message: Message) -> None:
            is_start = message["type"] == "http.response.start"
            if is_start:
                own = message.get("headers", [])
                default = [] if any(name == _POLICY for name, _ in own) else [(_POLICY, policy().encode())]
                message["headers"] = [*own, *default, *self._headers]
            if is_start or not is_head:
                await send(message)
            if is_start and is_head:
                await send({"type": "http.response.body", "body": b"", "more_body": False})
                is_begun.set()

        async def waiting() -> Message:
            if not is_head:
                return await receive()
            await is_begun.wait()
            return {"type": "http.disconnect"}

        async def refuse(status: int, sentence: str, **headers: str) -> None:
            is_json = scope.get("path", "").startswith("/api/")
            answer = (
                JSONResponse({"detail": sentence}, status) if is_json else PlainTextResponse(f"{sentence}\n", status)
            )
            answer.headers.update(headers)
            await answer(scope, receive, sending)

        wait = self._limit.wait(network_of(scope["client"][0] if scope.get("client") else ""))
        length = given.get(b"content-length", b"0")
        if wait:
            await refuse(429, "too many requests: try again later", **{"retry-after": str(math.ceil(wait))})
        elif self._hosts is not None and _host(given.get(b"host", b"")) not in self._hosts:
            await refuse(421, "this server does not answer to that name: set url in the site file to allow it")
        elif not length.isdigit() or int(length) > LIMITS.max_body:
            await refuse(413, f"the request is larger than {LIMITS.max_body} bytes")
        else:
            try:
                async with asyncio.timeout(LIMITS.body_timeout):
                    body = await _body(receive)
            except TimeoutError:
                await refuse(408, f"the request took longer than {LIMITS.body_timeout:g} s")
                return
            if body is None:
                await refuse(413, f"the request is larger than {LIMITS.max_body} bytes, or incomplete")
                return
            await self._app(scope, _replay(body, waiting), sending)


async def _body(receive: Receive) -> bytes | None:
    """Return the body of a request; None if it is too large, or ends early."""
    parts, n_bytes = [], 0
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            return None
        parts.append(message.get("body", b""))
        n_bytes += len(parts[-1])
        if n_bytes > LIMITS.max_body:
            return None
        if not message.get("more_body"):
            return b"".join(parts)


def _replay(body: bytes, receive: Receive) -> Receive:
    """Return a function that gives a body first, and then waits for the end of the connection."""
    waiting = [body]

    async def replayed() -> Message:
        return {"type": "http.request", "body": waiting.pop(), "more_body": False} if waiting else await receive()

    return replayed


def network_of(address: str) -> str:
    """Return an address; of version 6 the first half, as one machine has all that begin with it."""
    try:
        known = ip_address(address)
    except ValueError:
        return address
    if not isinstance(known, IPv6Address):
        return address
    return str(known.ipv4_mapped or IPv6Address(int(known) >> 64 << 64))


def _host(header: bytes) -> str:
    """Return the name in a host header, without its port."""
    text = header.decode("latin-1").lower()
    return text.partition("]")[0] + "]" if text.startswith("[") else text.partition(":")[0]
