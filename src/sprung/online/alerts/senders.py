"""Senders: a log, a webhook, mail, a topic, services of apprise; and how often they try again.

Network and logger are arguments; no error message contains a secret.
"""

import json
import logging
import re
import smtplib
import socket
import ssl
import threading
import urllib.request
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from email.message import EmailMessage
from email.utils import format_datetime
from fnmatch import fnmatchcase
from html import escape
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import Any, Protocol, Self
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit

from sprung._checks import check_number, required
from sprung.errors import ParameterError, SprungError
from sprung.online.alerts.messages import Message
from sprung.state import severity_step

_SECOND = 1_000_000_000
#: Time between attempts to end a connection [s]: during a TLS handshake, which has its own limit, it has no socket.
_AGAIN = 1.0
#: Log levels of the steps of severity.
_LEVELS = (logging.INFO, logging.INFO, logging.WARNING, logging.ERROR, logging.CRITICAL)
#: Content identifier of the picture within a mail.
_PICTURE = "picture@sprung"
#: Names of vehicles that can be part of a topic.
_VEHICLE = re.compile(r"[A-Za-z0-9_.-]{1,64}")
#: Kind of a notification by the step of its severity, as apprise names them.
_KINDS = ("info", "info", "warning", "failure", "failure")


class SendError(SprungError):
    """A message that a sender could not deliver; the text states where, why, and what to check."""


class Sender(Protocol):
    """Anything that delivers messages."""

    @property
    def name(self) -> str:
        """Name of the sender, unique in a list of senders."""

    @property
    def shows_pictures(self) -> bool:
        """Whether it passes on `Message.picture`, which takes seconds to draw."""

    def send(self, message: Message) -> None:
        """Deliver a message, or raise `SendError`."""


@dataclass(frozen=True, slots=True)
class SelectiveSender:
    """Passes messages about some vehicles, from a step of severity on, to a sender; the others are settled unsent.

    Parameters
    ----------
    sender
        The sender.
    step
        Smallest step of severity, 0 to 4.
    vehicles
        Names of vehicles, or patterns such as "bus-0*"; empty: all.
    """

    sender: Sender
    step: int = 0
    vehicles: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the sender."""
        return self.sender.name

    @property
    def shows_pictures(self) -> bool:
        """Whether the sender passes on pictures."""
        return self.sender.shows_pictures

    def send(self, message: Message) -> None:
        """Deliver what a person sends, and a notification that is selected.

        Raises
        ------
        SendError
            If the sender could not deliver it.
        """
        is_of = not self.vehicles or any(fnmatchcase(message.vehicle, pattern) for pattern in self.vehicles)
        if message.what in {"test", "work order"} or (is_of and severity_step(message.severity) >= self.step):
            self.sender.send(message)


@dataclass(frozen=True, slots=True)
class Backoff:
    """Waits between attempts, doubled after each failure.

    Parameters
    ----------
    first
        Wait after the first failure [ns].
    most
        Longest wait [ns].

    Raises
    ------
    ParameterError
        If the first wait is not above 0, or the longest one is shorter.
    """

    first: int = 5 * _SECOND
    most: int = 3600 * _SECOND

    def __post_init__(self) -> None:
        check_number("first", self.first, above=0, advice="5 s are usual, in ns")
        check_number("most", self.most, at_least=self.first, advice="no wait can be shorter than the first")

    def next_attempt(self, attempts: int, now: int) -> int:
        """Return the time of the next attempt [UTC ns] after a number of failures, the last of them `now`.

        Raises
        ------
        ParameterError
            If the number of failures is below 1.

        Examples
        --------
        >>> [Backoff().next_attempt(attempts, 0) // 10**9 for attempts in (1, 2, 3, 10, 11, 10**6)]
        [5, 10, 20, 2560, 3600, 3600]
        """
        check_number("attempts", attempts, at_least=1, advice="it counts the failed ones")
        return now + min(self.most, self.first << min(attempts - 1, 62))


def deliver(message: Message, senders: Iterable[Sender]) -> dict[str, str]:
    """Deliver a message through every sender.

    Returns
    -------
    dict
        Reason for each sender that failed, one sentence by name of the sender; empty if all succeeded.

    Examples
    --------
    >>> from sprung.online.alerts import PublishSender, trial_message
    >>> topics = []
    >>> working = PublishSender(lambda topic, payload: topics.append(topic))
    >>> offline = PublishSender(lambda topic, payload: False, name="offline")
    >>> deliver(trial_message(0), [offline, working])
    {'offline': 'alert of monitor was not published (no connection): check the broker'}
    >>> topics
    ['sprung/v1/monitor/alert']
    """
    failed = {}
    for sender in senders:
        try:
            sender.send(message)
        except SendError as error:
            failed[sender.name] = str(error)
        except Exception as error:  # a faulty sender must not silence the others
            failed[sender.name] = f"{sender.name} failed with {type(error).__name__}: {error}"
    return failed


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
        self._connections: list[Any] = []
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

    def add(self, connection: Any) -> None:
        """Watch a connection: a client of `http.client` or `smtplib`, with its `sock`."""
        self._connections.append(connection)

    def over(self, connect: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that opens connections as `connect` does, and watches them."""

        def watched(*arguments: Any, **options: Any) -> Any:
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


class LogSender:
    """Writes subject and text to a log, at a level by severity; cleared alerts at INFO."""

    shows_pictures = False

    def __init__(self, logger: logging.Logger, *, name: str = "log") -> None:
        self.name = name
        self._logger = logger

    def send(self, message: Message) -> None:
        """Write one line."""
        level = logging.INFO if message.what == "cleared" else _LEVELS[severity_step(message.severity)]
        line = f"{message.subject}: {message.document['text']}"
        self._logger.log(level, "%s", " ".join(line.split()))


class _Http(urllib.request.HTTPHandler):
    """Opens watched connections."""

    def __init__(self, watch: Watch) -> None:
        super().__init__()
        self._watch = watch

    def http_open(self, request: urllib.request.Request) -> HTTPResponse:
        return self.do_open(self._watch.over(HTTPConnection), request)


class _Https(urllib.request.HTTPSHandler):
    """Opens watched, encrypted connections."""

    def __init__(self, watch: Watch) -> None:
        super().__init__()
        self._watch = watch

    def https_open(self, request: urllib.request.Request) -> HTTPResponse:
        return self.do_open(self._watch.over(HTTPSConnection), request)


class _Unmoved(urllib.request.HTTPRedirectHandler):
    """Follows no redirection, which would turn the POST into a GET and send the headers to another host."""

    def redirect_request(self, *_: Any) -> None:
        return None


class WebhookSender:
    """Posts the JSON object of a message.

    Parameters
    ----------
    url
        Address, http or https. It may contain a secret: errors name its host only.
    headers
        Headers of each request, such as an Authorization.
    timeout
        Longest wait for the connection, and for each part of the response [s].
    limit
        Longest total time for a message [s], which also ends a response of one byte a second.
    handlers
        Further handlers of `urllib.request`, such as one of proxies.
    name
        Name of the sender, see `Sender`.

    Raises
    ------
    ParameterError
        If the address is not valid, or the time is not above 0.
    """

    shows_pictures = False

    def __init__(
        self,
        url: str,
        *,
        headers: Mapping[str, str] | None = None,
        timeout: float = 10.0,
        limit: float = 30.0,
        handlers: Sequence[urllib.request.BaseHandler] = (),
        name: str = "webhook",
    ) -> None:
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port
        except ValueError:
            raise ParameterError("url of the webhook cannot be read: it must be like https://host/path") from None
        if parts.scheme not in ("http", "https") or not host:
            raise ParameterError("url of the webhook must begin with http:// or https:// and a host")
        self.name = name
        self._url, self._where = url, host if port is None else f"{host}:{port}"
        self._headers = {**(headers or {}), "Content-Type": "application/json"}
        self._timeout = check_number("timeout", timeout, above=0)
        self._limit, self._handlers = check_number("limit", limit, above=0), tuple(handlers)

    def send(self, message: Message) -> None:
        """Post the message, with its key as Idempotency-Key; any 2xx response is success.

        Raises
        ------
        SendError
            If the server cannot be reached, or does not accept the message.
        """
        watch = Watch(self._limit)
        opener = urllib.request.build_opener(_Unmoved, _Http(watch), _Https(watch), *self._handlers)
        headers = self._headers | ({"Idempotency-Key": message.key} if message.key else {})
        try:
            request = urllib.request.Request(self._url, _json(message), headers, method="POST")
            with watch, opener.open(request, timeout=self._timeout):
                pass
            if watch.is_over:  # which may have cut the response off after its status
                raise TimeoutError
        except HTTPError as error:
            with error:
                raise SendError(f"webhook at {self._where} answered {error.code}: check its url and headers") from None
        except URLError as error:
            raise SendError(f"webhook at {self._where} cannot be reached ({error.reason})") from error
        except (OSError, HTTPException) as error:
            if watch.is_over:
                raise SendError(f"webhook at {self._where} took longer than {self._limit:g} s to answer") from error
            raise SendError(f"webhook at {self._where} gave no answer ({type(error).__name__})") from error
        except ValueError:
            raise SendError(f"webhook at {self._where}: url or headers contain text that HTTP forbids") from None


class _Server(smtplib.SMTP):
    """A connection to a mail server that is watched from its beginning."""

    def __init__(self, watch: Watch, host: str, port: int, timeout: float) -> None:
        watch.add(self)
        super().__init__(host, port, timeout=timeout)


class MailSender:
    """Sends a mail.

    Parameters
    ----------
    host, port
        Host and port of the mail server (SMTP submission, RFC 6409).
    sender, recipients
        Addresses of sender and recipients.
    username, password
        Credentials at the server; both or none.
    starttls
        Whether to encrypt after connecting; a server that does not support it receives neither password nor mail.
    timeout
        Longest wait for each part of an answer [s].
    limit
        Longest total time for a mail [s], which also ends an answer of one byte a second.
    name
        Name of the sender, see `Sender`.

    Raises
    ------
    ParameterError
        If an address is not valid, a credential is missing, or the time is not above 0.
    """

    shows_pictures = True

    def __init__(
        self,
        host: str,
        port: int = 587,
        *,
        sender: str,
        recipients: Sequence[str],
        username: str | None = None,
        password: str | None = None,
        starttls: bool = True,
        timeout: float = 10.0,
        limit: float = 30.0,
        name: str = "mail",
    ) -> None:
        if isinstance(recipients, str) or not recipients:
            raise ParameterError(f"recipients={recipients!r} must be a list of at least one address")
        for address in (sender, *recipients):
            if not re.fullmatch(r"[^@\s,;<>]+@[^@\s,;<>]+", address):
                raise ParameterError(f"{address!r} is not a mail address: write it like name@example.org")
        if (username is None) != (password is None):
            raise ParameterError("username and password of the mail server go together: give both or none")
        self.name = name
        check_number("port", port, at_least=1, at_most=65535)
        self._host, self._port, self._timeout = host, port, check_number("timeout", timeout, above=0)
        self._sender, self._recipients = sender, tuple(recipients)
        self._login = None if username is None or password is None else (username, password)
        self._starttls, self._limit = starttls, check_number("limit", limit, above=0)

    def send(self, message: Message) -> None:
        """Send one mail to all recipients, with its key in Message-ID; it fails if the server refuses any of them.

        Raises
        ------
        SendError
            If the server cannot be reached, or refuses credentials, the mail or a recipient.
        """
        where = f"mail server {self._host}:{self._port}"
        watch = Watch(self._limit)
        try:
            with watch, _Server(watch, self._host, self._port, self._timeout) as server:
                if self._starttls:
                    server.starttls(context=ssl.create_default_context())
                if self._login is not None:
                    server.login(*self._login)
                refused = server.send_message(self._mail(message))
        except smtplib.SMTPAuthenticationError as error:
            raise SendError(f"{where} refused username or password ({error.smtp_code})") from None
        except smtplib.SMTPRecipientsRefused as error:
            raise SendError(f"{where} refused {', '.join(error.recipients)}: check the recipients") from None
        except (smtplib.SMTPException, ValueError) as error:
            if watch.is_over:
                raise SendError(f"{where} took longer than {self._limit:g} s to accept the mail") from error
            raise SendError(f"{where} did not accept the mail ({error})") from error
        except OSError as error:
            if watch.is_over:
                raise SendError(f"{where} took longer than {self._limit:g} s to accept the mail") from error
            reason = error.strerror or str(error) or type(error).__name__
            raise SendError(f"{where} cannot be reached ({reason}): check host, port and starttls") from error
        if refused:
            raise SendError(f"{where} refused {', '.join(refused)} and accepted the others: check the recipients")

    def _mail(self, message: Message) -> EmailMessage:
        """Return the mail, marked as automatic (RFC 3834) so that out-of-office replies do not answer it."""
        mail = EmailMessage()
        mail["Subject"] = " ".join(message.subject.split())
        mail["From"] = self._sender
        mail["To"] = ", ".join(self._recipients)
        mail["Date"] = format_datetime(datetime.fromtimestamp(message.time // 1_000_000_000, tz=UTC))
        mail["Auto-Submitted"] = "auto-generated"
        if message.key:
            mail["Message-ID"] = f"<{message.key}.sprung@{self._sender.partition('@')[2]}>"
        mail.set_content(message.text)
        if message.picture:
            page = f'<pre style="font-family: inherit; white-space: pre-wrap">{_linked(message.text)}</pre>'
            mail.add_alternative(f'{page}<img src="cid:{_PICTURE}" style="max-width: 100%">', subtype="html")
            (_, html) = mail.iter_parts()
            html.add_related(
                message.picture, "image", "png", cid=f"<{_PICTURE}>", filename="alert.png", disposition="inline"
            )
        return mail


def _linked(text: str) -> str:
    """Return a text as HTML, with its addresses as links."""
    return re.sub(r"https?://\S+", lambda link: f'<a href="{link[0]}">{link[0]}</a>', escape(text))


class PublishSender:
    """Publishes the JSON object of a message to the topic sprung/v1/{vehicle}/alert, by a function of topic, bytes."""

    shows_pictures = False

    def __init__(self, publish: Callable[[str, bytes], object], *, name: str = "publish") -> None:
        self.name = name
        self._publish = publish

    def send(self, message: Message) -> None:
        """Publish once.

        Raises
        ------
        SendError
            If the vehicle's name cannot be part of a topic, or the message was not published: the function raised an
        error, or returned False.
        """
        if not _VEHICLE.fullmatch(message.vehicle):
            raise SendError(
                f"vehicle {message.vehicle!r} cannot be part of a topic: use letters, digits, '_', '.', '-'"
            )
        try:
            is_published = self._publish(f"sprung/v1/{message.vehicle}/alert", _json(message))
        except (OSError, ValueError, RuntimeError) as error:
            raise SendError(f"alert of {message.vehicle} was not published ({error}): check the broker") from error
        if is_published is False:
            raise SendError(f"alert of {message.vehicle} was not published (no connection): check the broker")


class ServiceSender:
    """Sends subject and text by a service of the package apprise.

    Parameters
    ----------
    url
        Address of the service as apprise writes it, such as "slack://TOKEN/#channel". It may contain a secret: errors
        name its kind only.
    name
        Name of the sender, see `Sender`.

    Raises
    ------
    ParameterError
        If the address does not begin with the kind of a service.
    """

    shows_pictures = False

    def __init__(self, url: str, *, name: str = "service") -> None:
        kind = re.match(r"([a-z0-9]+)://\S", url)
        if kind is None:
            raise ParameterError(
                "url of the service must be like slack://TOKEN/#channel, as the documentation of apprise writes it"
            )
        self.name, self._url, self._kind = name, url, kind[1]

    def send(self, message: Message) -> None:
        """Send one notification.

        Raises
        ------
        SendError
            If apprise is not installed or does not know the service, or the service does not accept the notification.
        """
        try:
            apprise: Any = required("apprise", purpose=f"the service {self._kind}", extra="apprise")
        except ImportError as error:
            raise SendError(str(error)) from None
        service = apprise.Apprise()
        if not service.add(self._url):
            raise SendError(f"apprise does not know the address of the service {self._kind}: correct its url")
        kind = "success" if message.what == "cleared" else _KINDS[severity_step(message.severity)]
        if not service.notify(title=message.subject, body=message.text, notify_type=kind):
            raise SendError(f"the service {self._kind} did not accept the notification: check its url and the network")


def _json(message: Message) -> bytes:
    """Return the document of a message as bytes."""
    return json.dumps(message.document, allow_nan=False).encode()
