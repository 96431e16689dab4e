"""Senders: a log, a webhook, mail, a topic. Network and logger are arguments; no error message contains a secret."""

import json
import logging
import re
import smtplib
import ssl
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from email.message import EmailMessage
from email.utils import format_datetime
from html import escape
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.online.alerts.alerts import severity_step
from sprung.online.alerts.delivery import SendError
from sprung.online.alerts.messages import Message
from sprung.online.alerts.watch import Watch

#: Log levels of the steps of severity.
_LEVELS = (logging.INFO, logging.INFO, logging.WARNING, logging.ERROR, logging.CRITICAL)
#: Content identifier of the picture within a mail.
_PICTURE = "picture@sprung"
#: Names of vehicles that can be part of a topic.
_VEHICLE = re.compile(r"[A-Za-z0-9_.-]{1,64}")


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


def _json(message: Message) -> bytes:
    """Return the document of a message as bytes."""
    return json.dumps(message.document, allow_nan=False).encode()
