"""A connection to an MQTT broker, with its credentials, and the order in which frames are sent over it."""

import fcntl
import os
import re
import secrets
import socket
import ssl
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from sprung._checks import required
from sprung.errors import ParameterError, SprungError
from sprung.link.spool import Spool

#: User name under which programs of this machine reach the broker.
LOCAL_USER = "local"
_HERE = {"127.0.0.1", "localhost", "::1"}
#: Object identifier of the common name, encoded (ITU-T X.520, id-at-commonName 2.5.4.3), and tags of ASN.1 (X.690).
_COMMON_NAME = bytes((0x55, 0x04, 0x03))
_VERSION = 0xA0
_BMP_STRING = 0x1E
_UTC_TIME = 0x17
_FOOT = "-----END CERTIFICATE-----"


def common_name(path: str | Path) -> str:
    r"""Return the common name of the holder of a certificate, which is the user name at a broker as shipped.

    Parameters
    ----------
    path
        File with the certificate (PEM); of several the first counts.

    Returns
    -------
    str
        The name; empty if the file holds no certificate that can be read, or one without such a name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> lines = (
    ...     "-----BEGIN CERTIFICATE-----",
    ...     "MIHIMHwCAQEwBQYDK2VwMBExDzANBgNVBAMMBmJ1cy0xNzAeFw0yNjExMjMwMjQxMDRaFw0zNjExMjAwMjQxMDRa",
    ...     "MBExDzANBgNVBAMMBmJ1cy0xNzAqMAUGAytlcAMhAPHazIsP7jGA6YNMn50igP2g4+gjxebhnU0+fUNCwwaWMAUG",
    ...     "AytlcANBAE5yjYPO9H9vG52C5Nl7nL99QRDLX6iF3R5bov1O386o1Iyx6tuFFukZGpaJtS2th8FslkCKcZunqMES",
    ...     "YegK5Ac=",
    ...     "-----END CERTIFICATE-----",
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "box.crt")
    ...     _ = path.write_text("\n".join(lines), encoding="utf-8")
    ...     common_name(path)
    'bus-17'
    """
    with suppress(OSError, ValueError, IndexError):
        for _, attributes in _fields(_contents(path)[4]):
            for _, attribute in _fields(attributes):
                (_, name), (tag, value) = _fields(attribute)
                if name == _COMMON_NAME:
                    return value.decode("utf-16-be" if tag == _BMP_STRING else "utf-8")
    return ""


def valid_until(path: str | Path) -> int:
    r"""Return the time until which a certificate is valid, UTC ns.

    Parameters
    ----------
    path
        File with the certificate (PEM); of several the first counts.

    Raises
    ------
    ParameterError
        If the file cannot be read, or holds no certificate.

    Notes
    -----
    The validity has two times, of two kinds (RFC 5280, 4.1.2.5): with two digits for years from 1950 to 2049, else with
    four.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> lines = (
    ...     "-----BEGIN CERTIFICATE-----",
    ...     "MIHIMHwCAQEwBQYDK2VwMBExDzANBgNVBAMMBmJ1cy0xNzAeFw0yNjExMjMwMjQxMDRaFw0zNjExMjAwMjQxMDRa",
    ...     "MBExDzANBgNVBAMMBmJ1cy0xNzAqMAUGAytlcAMhAPHazIsP7jGA6YNMn50igP2g4+gjxebhnU0+fUNCwwaWMAUG",
    ...     "AytlcANBAE5yjYPO9H9vG52C5Nl7nL99QRDLX6iF3R5bov1O386o1Iyx6tuFFukZGpaJtS2th8FslkCKcZunqMES",
    ...     "YegK5Ac=",
    ...     "-----END CERTIFICATE-----",
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "box.crt")
    ...     _ = path.write_text("\n".join(lines), encoding="utf-8")
    ...     valid_until(path)
    2110761664000000000
    """
    try:
        _, (tag, end) = _fields(_contents(path)[3])
        text = end.decode("ascii")
        if tag == _UTC_TIME:
            text = ("19" if text >= "50" else "20") + text
        return int(datetime.strptime(text, "%Y%m%d%H%M%SZ").replace(tzinfo=UTC).timestamp()) * 10**9
    except OSError as error:
        raise ParameterError(f"{path} cannot be read ({error.strerror}): give a file with a certificate") from None
    except (ValueError, IndexError):
        raise ParameterError(f"{path} holds no certificate that can be read: give one in PEM") from None


def _contents(path: str | Path) -> list[bytes]:
    """Return the fields of a certificate.

    They are serial number, algorithm, issuer, validity, subject (RFC 5280, 4.1); the optional version is left out.
    """
    text = Path(path).read_text(encoding="ascii")
    first = text[text.index("-----BEGIN CERTIFICATE-----") : text.index(_FOOT) + len(_FOOT)]
    ((_, certificate),) = _fields(ssl.PEM_cert_to_DER_cert(first))
    (_, signed), *_ = _fields(certificate)
    return [content for tag, content in _fields(signed) if tag != _VERSION]


def _fields(encoded: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield tag and content of each field of a sequence in the distinguished encoding (X.690, 8.1)."""
    place = 0
    while place < len(encoded):
        tag, length = encoded[place], encoded[place + 1]
        place += 2
        if length >= 0x80:
            n_bytes = length - 0x80
            length = int.from_bytes(encoded[place : place + n_bytes], "big")
            place += n_bytes
        yield tag, encoded[place : place + length]
        place += length


class SecretError(SprungError):
    """A password that cannot be kept."""


@contextmanager
def keep_secret(port: int) -> Iterator[str]:
    """Yield a new random password for the broker at a port, kept in a file until the end of the context.

    Raises
    ------
    SecretError
        If the file cannot be written.

    Notes
    -----
    The file is in the folder ``$XDG_STATE_HOME/sprung``, by default ``~/.local/state/sprung`` (mode 700), has mode 600,
    and is locked: so one that a killed program left differs from one in use.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryDirectory
    >>> from unittest.mock import patch
    >>> with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_STATE_HOME=folder):
    ...     with keep_secret(1883) as secret:
    ...         is_found = find_secret("localhost", 1883) == secret
    ...     is_found, find_secret("localhost", 1883)
    (True, '')
    """
    secret = secrets.token_urlsafe(32)
    try:
        path = _path(port)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.unlink(missing_ok=True)  # it may have another mode, or be that of a program that was killed
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.write(handle, secret.encode())
    except (OSError, RuntimeError) as error:
        raise SecretError(
            f"the password of the embedded broker cannot be kept ({error}): set XDG_STATE_HOME to a folder that this "
            "user can write, or give --broker"
        ) from None
    try:
        yield secret
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def find_secret(host: str, port: int) -> str:
    """Return the password of the broker of a monitor that runs on this machine as the same user; empty: none.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryDirectory
    >>> from unittest.mock import patch
    >>> with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_STATE_HOME=folder):
    ...     with keep_secret(1883) as secret:
    ...         find_secret("localhost", 1883) == secret, find_secret("broker.example.org", 1883)
    (True, '')
    """
    if host not in _HERE:
        return ""
    try:
        handle = os.open(_path(port), os.O_RDONLY)
    except (OSError, RuntimeError):
        return ""
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return os.read(handle, 100).decode("ascii", errors="replace")
    finally:
        os.close(handle)
    return ""  # nobody holds the lock: the program that wrote it has ended


def _path(port: int) -> Path:
    """Return the file of the broker at a port of this machine."""
    state = os.environ.get("XDG_STATE_HOME", "")
    return (Path(state) if state else Path.home() / ".local" / "state") / "sprung" / f"broker-{port}"


#: Seconds between attempts to connect: at first, and at most.
_RETRY = (1, 30)
#: Messages that wait in memory for the broker; more are refused.
_MAX_QUEUED = 5000


class LinkError(SprungError):
    """A broker that cannot be reached, or refuses the connection."""


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a broker, from mqtt://user:password@host:port or mqtts://host:port?ca=F&cert=F&key=F.

    Parameters
    ----------
    host, port
        Host, and port: by default 1883, with TLS 8883.
    user, password
        Credentials; empty: none.
    is_encrypted
        Whether TLS is used.
    ca, cert, key
        Files with the certificate of the authority, that of the client and its key.
    version
        Version of MQTT to start with: "5" or "3".
    """

    host: str
    port: int
    user: str = ""
    password: str = field(default="", repr=False)
    is_encrypted: bool = False
    ca: str = ""
    cert: str = ""
    key: str = ""
    version: str = "5"

    @classmethod
    def parse(cls, url: str) -> "Address":
        """Return the address of a URL.

        Raises
        ------
        ParameterError
            If the URL cannot be used; passwords are not shown.
        """
        shown = re.sub("//[^@/]*@", "//...@", url)
        try:
            parts = urlsplit(url)
            port = parts.port
            (parts.hostname or "").encode("idna")
        except ValueError as error:
            raise ParameterError(f"{shown!r} is not the address of a broker: {error}") from None
        if parts.scheme not in {"mqtt", "mqtts"} or not parts.hostname:
            raise ParameterError(
                f"{shown!r} is not the address of a broker: write mqtt://host:1883 or mqtts://host:8883"
            )
        query = {name: values[-1] for name, values in parse_qs(parts.query).items()}
        unknown = sorted(query.keys() - {"ca", "cert", "key", "version"})
        if unknown:
            raise ParameterError(f"{shown!r} has the parameter {unknown[0]!r}: use ca, cert, key and version only")
        if parts.username == LOCAL_USER:
            query.setdefault("version", "3")  # the only one of an embedded broker
        secure = parts.scheme == "mqtts"
        return cls(
            parts.hostname,
            port or (8883 if secure else 1883),
            unquote(parts.username or ""),
            unquote(parts.password or ""),
            secure,
            **query,
        )

    def __str__(self) -> str:
        return f"{'mqtts' if self.is_encrypted else 'mqtt'}://{self.host}:{self.port}"


class Link:
    """A connection that is restored, with its subscriptions, whenever the broker is available again.

    Parameters
    ----------
    address
        Address of the broker.
    name
        Name of this client; the broker disconnects another one of the same name.
    topics
        Topics to subscribe to, with QoS 1.
    on_message
        Function called with topic and payload, in a thread of the link.
    on_connected
        Function called after every connection, in a thread of the link.
    will
        Topic and payload that the broker publishes when this client is lost; with MQTT 5 only.

    Notes
    -----
    MQTT 5, or 3.1.1 if the broker does not support 5. QoS 1 does not guarantee delivery: a broker that crashes may lose
    messages that it has confirmed. Only the acknowledgement of the receiver counts.
    """

    def __init__(
        self,
        address: Address,
        name: str,
        *,
        topics: Sequence[str],
        on_message: Callable[[str, bytes], None],
        on_connected: Callable[[], None] = lambda: None,
        will: tuple[str, bytes] | None = None,
    ) -> None:
        self._mqtt = required("paho.mqtt.client", purpose="the link", extra="online")
        self._address = address
        self._name = name
        self._topics = tuple(topics)
        self._on_message = on_message
        self._on_connected = on_connected
        self._will = will
        self._is_connected = threading.Event()
        # Connected, or certain that another attempt would fail like the first.
        self._is_decided = threading.Event()
        self._problem = ""
        self._refusal = ""
        self._rejection = ""
        self._is_closed = False
        self._client = self._made(self._mqtt.MQTTv311 if address.version == "3" else self._mqtt.MQTTv5)

    @property
    def is_connected(self) -> bool:
        """Whether the link is connected to the broker."""
        return self._is_connected.is_set()

    @property
    def problem(self) -> str:
        """Known reason why there is no connection, or why the broker refuses messages; empty if there is no problem."""
        if self._problem or not self._rejection:
            return self._problem
        return f"the broker {self._address} refuses messages: {self._rejection}"

    @property
    def is_rejected(self) -> bool:
        """Whether the broker refused a message, as when a vehicle's name is not that of its certificate."""
        return bool(self._rejection)

    def open(self, *, timeout: float = 0.0, is_patient: bool = False) -> None:
        """Start connecting, and wait up to a time [s] for the connection.

        Parameters
        ----------
        timeout
            Longest wait [s]; 0: return immediately, and keep trying.
        is_patient
            Whether to wait for the whole time even if the host is unknown or refuses the connection.

        Raises
        ------
        LinkError
            If there is no connection after that time.
        """
        self._start()
        if not timeout:
            return
        (self._is_connected if is_patient else self._is_decided).wait(timeout)
        if not self.is_connected:
            problem = self.problem or self._unreachable("(no answer): check that it runs there")
            self.close()
            raise LinkError(problem)

    def publish(self, topic: str, payload: bytes, *, is_retained: bool = False) -> bool:
        """Hand a message to the broker (QoS 1) and return whether there was a connection to do so."""
        if not self.is_connected:
            return False
        return bool(self._client.publish(topic, payload, qos=1, retain=is_retained).rc == self._mqtt.MQTT_ERR_SUCCESS)

    def close(self) -> None:
        """Disconnect cleanly: the will is not published."""
        self._is_closed = True
        self._is_connected.clear()
        self._client.disconnect()
        self._client.loop_stop()
        # Client and link hold each other: without this the client's sockets would wait for the garbage collector.
        for name in ("on_pre_connect", "on_connect", "on_disconnect", "on_connect_fail", "on_message", "on_publish"):
            setattr(self._client, name, None)

    def _made(self, protocol: Any) -> Any:
        """Return a client for a version of MQTT."""
        client = self._mqtt.Client(self._mqtt.CallbackAPIVersion.VERSION2, client_id=self._name, protocol=protocol)
        client.reconnect_delay_set(*_RETRY)
        client.max_inflight_messages_set(1000)
        client.max_queued_messages_set(_MAX_QUEUED)
        client.on_pre_connect = lambda client, _data: self._identify(client, protocol)
        if self._address.is_encrypted:
            client.tls_set_context(_context(self._address))
        # The embedded broker, which supports 3.1.1 only, refuses clients with a will; it ends with the monitor anyway.
        if self._will is not None and protocol == self._mqtt.MQTTv5:
            client.will_set(self._will[0], self._will[1], qos=1)
        client.on_connect = self._connected
        client.on_disconnect = self._disconnected
        client.on_connect_fail = self._failed
        client.on_publish = self._published
        client.on_message = lambda _client, _data, message: self._on_message(message.topic, message.payload)
        return client

    def _identify(self, client: Any, protocol: Any) -> None:
        """Set user and password: those of the address, or those of a monitor's broker that runs here now."""
        user, password = self._address.user, self._address.password
        # The embedded broker fails on a password in a newer version, and without one requests the older version.
        if not user and protocol == self._mqtt.MQTTv311:
            password = find_secret(self._address.host, self._address.port)
            user = LOCAL_USER if password else ""
        client.username_pw_set(user or None, password or None)

    def _start(self) -> None:
        """Connect in a thread of the client."""
        self._client.connect_async(self._address.host, self._address.port, keepalive=20)
        self._client.loop_start()

    def _connected(self, client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        """Subscribe, or fall back to the older protocol."""
        if reason.is_failure and "protocol" in str(reason).lower() and client is self._client and not self._is_closed:
            threading.Thread(target=self._fall_back, args=(client,), daemon=True).start()
            return
        if reason.is_failure:
            advice = "check user, password and certificate"
            self._refusal = f"the broker {self._address} refuses the connection ({reason}): {advice}"
            self._problem = self._refusal
            self._is_decided.set()
            return
        self._problem = ""
        self._refusal = ""
        self._rejection = ""
        for name in self._topics:
            client.subscribe(name, qos=1)
        self._is_connected.set()
        self._is_decided.set()
        self._on_connected()

    def _fall_back(self, client: Any) -> None:
        """Continue with MQTT 3.1.1."""
        client.disconnect()
        client.loop_stop()
        self._client = self._made(self._mqtt.MQTTv311)
        self._start()
        if self._is_closed:
            self.close()

    def _disconnected(self, client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        """Record the loss of the connection."""
        if client is not self._client:
            return
        if self.is_connected:
            self._problem = f"the broker {self._address} was lost ({reason}): check that it runs"
        else:
            advice = "check that it is a broker, and user, password and certificate"
            self._problem = self._refusal or f"the broker {self._address} closed the connection ({reason}): {advice}"
        self._is_connected.clear()

    def _failed(self, _client: Any, _data: Any) -> None:
        """Record why an attempt failed; paho calls this while handling the error."""
        error = sys.exception()
        self._problem = self._unreachable(_why(error))
        if isinstance(error, socket.gaierror | ConnectionRefusedError):
            self._is_decided.set()

    def _unreachable(self, why: str) -> str:
        """Return the sentence for a broker that cannot be reached."""
        return f"the broker {self._address} cannot be reached {why}"

    def _published(self, _client: Any, _data: Any, _number: int, reason: Any, _properties: Any) -> None:
        """Record that the broker refused a message, until the next connection."""
        if reason.is_failure:
            self._rejection = str(reason)


def _why(error: BaseException | None) -> str:
    """Return why a connection failed, and what to do."""
    if isinstance(error, socket.gaierror):
        if error.errno == socket.EAI_AGAIN:
            return "(its name cannot be resolved): check the name, and the network of this machine"
        return "(unknown host): correct its name"
    if isinstance(error, ConnectionRefusedError):
        return "(connection refused): check that the broker is running on that port"
    if isinstance(error, TimeoutError):
        return "(the attempt timed out): check that its machine is on, and that no firewall blocks it"
    if isinstance(error, ssl.SSLError):
        detail = getattr(error, "verify_message", None) or getattr(error, "reason", None) or error
        return f"(TLS failed: {detail}): check ca, cert and key, and that the host is named in its certificate"
    return f"({getattr(error, 'strerror', None) or error or 'no answer'}): check that it runs there"


def _context(address: Address) -> ssl.SSLContext:
    """Return the settings of TLS."""
    try:
        context = ssl.create_default_context(cafile=address.ca or None)
        if address.cert:
            context.load_cert_chain(address.cert, address.key or None, password="")
    except (OSError, ssl.SSLError) as error:
        raise ParameterError(f"a certificate of {address} cannot be used ({error}): check ca, cert and key") from None
    return context


class Every:
    """A timer that is due immediately, and again a fixed time after each start.

    Parameters
    ----------
    seconds
        Time from a start until it is due again [s].
    clock
        Present time [s] of any clock.

    Examples
    --------
    >>> times = iter([0.0, 9.0, 10.0])
    >>> timer = Every(10.0, lambda: next(times))
    >>> timer.is_due
    True
    >>> timer.start()
    >>> timer.is_due, timer.is_due
    (False, True)
    """

    def __init__(self, seconds: float, clock: Callable[[], float]) -> None:
        self._seconds = seconds
        self._clock = clock
        self._started: float | None = None

    @property
    def started(self) -> float | None:
        """Time of the last start [s]; None if it was never started, or reset."""
        return self._started

    @property
    def is_due(self) -> bool:
        """Whether the time since the last start has passed."""
        return self._started is None or self._clock() - self._started >= self._seconds

    def start(self) -> None:
        """Count from now."""
        self._started = self._clock()

    def reset(self) -> None:
        """Make the timer due now."""
        self._started = None


class Sending:
    """Progress of sending a spool.

    Parameters
    ----------
    spool
        Spool with the frames.
    ahead
        Largest number of frames sent and not acknowledged.
    patience
        Time without any progress after which everything is sent again [s].

    Notes
    -----
    A broker that crashes may lose messages that it has confirmed. Only frames that the monitor acknowledged are removed
    from the spool; the others are sent again, in order, after a reconnection or `patience` without acknowledgement, and
    so are those that could not be read before.
    """

    def __init__(self, spool: Spool, *, ahead: int = 256, patience: float = 10.0) -> None:
        self._spool = spool
        self._ahead = ahead
        self._patience = patience
        self._under_way: deque[tuple[int, int]] = deque()
        self._position = (0, -1)
        self._last_progress = 0.0

    @property
    def n_under_way(self) -> int:
        """Frames sent and not acknowledged."""
        return len(self._under_way)

    def start_again(self, now: float) -> None:
        """Send everything again that is not acknowledged."""
        self._under_way.clear()
        self._position = (0, -1)
        self._last_progress = now

    def due(self, now: float) -> Iterator[tuple[int, int, bytes]]:
        """Yield boot, sequence number and payload of the frames to send now (`now`: any clock [s])."""
        # Also with nothing under way: a file that could not be read for a while may hold frames before the position.
        if now - self._last_progress > self._patience:
            self.start_again(now)
        boot, after = self._position
        room = self._ahead - len(self._under_way)
        for found_boot, seq, payload in islice(self._spool.frames(boot=boot, after=after), max(room, 0)):
            if not self._under_way:
                self._last_progress = now
            self._position = (found_boot, seq)
            self._under_way.append((found_boot, seq))
            yield found_boot, seq, payload

    def acknowledged(self, boot: int, seq: int, now: float) -> None:
        """Record that the monitor has all frames of a boot up to a sequence number."""
        self._spool.acknowledge(boot, seq)
        before = len(self._under_way)
        self._under_way = deque(frame for frame in self._under_way if frame[0] != boot or frame[1] > seq)
        if len(self._under_way) < before:
            self._last_progress = now
