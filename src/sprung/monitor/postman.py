"""Notifications from the store to people, until every sender has passed them on."""

import logging
import threading
from collections.abc import Callable, Mapping, Sequence

from sprung.alerting import (
    Backoff,
    LogSender,
    Message,
    PublishSender,
    Sender,
    addressed,
    deliver,
    trial_message,
)
from sprung.errors import ParameterError
from sprung.monitor.site import Send
from sprung.storage import NotificationRow, Store, StoreError

LOG = logging.getLogger("sprung.monitor")

#: Number of attempts after which a notification is abandoned.
_MOST_ATTEMPTS = 20
#: Events of a notification in words, where they are others.
_WORDS = {"undelivered": "not delivered"}
#: Time between checks for notifications [s].
_EVERY = 1.0


class Postman:
    """Sends notifications, repeatedly until every sender has passed them on.

    Parameters
    ----------
    store
        Store of the notifications.
    senders
        Senders, each of which has its own attempts.
    link
        Function that returns the address of an alert by its number; empty: none.
    picture
        Function that returns the figure of an alert of a vehicle and cause as PNG; empty: none.

    Notes
    -----
    A failure is logged and added to the history of the alert when it is first seen, when its reason changes, and when
    the notification is abandoned; so is the delivery that ends it.
    """

    def __init__(
        self,
        store: Store,
        senders: Sequence[Sender],
        *,
        link: Callable[[int], str] = lambda number: "",
        picture: Callable[[str, str], bytes] = lambda vehicle, cause: b"",
    ) -> None:
        self._store, self._senders, self._link, self._picture = store, senders, link, picture
        self._backoff = Backoff()
        self._next: dict[int, int] = {}
        self._delivered: dict[int, set[str]] = {}
        self._failing: dict[str, str] = {}

    @property
    def troubles(self) -> list[str]:
        """Sentence about each sender whose last attempt failed."""
        return [f"alerts are not delivered by {name}: {reason}" for name, reason in dict(self._failing).items()]

    def send(self, *, now: int) -> None:
        """Send what is due."""
        for row in self._store.alerts.due_notifications(100):
            if self._next.get(row.id, 0) > now:
                continue
            delivered = self._delivered.setdefault(row.id, set())
            waiting = [sender for sender in self._senders if sender.name not in delivered]
            errors = deliver(self._message(row), waiting)
            delivered |= {sender.name for sender in waiting} - errors.keys()
            self._settle(row, errors, now)
            for sender in waiting:
                self._failing.pop(sender.name, None)
            self._failing |= errors

    def _message(self, row: NotificationRow) -> Message:
        """Return the message of a notification."""
        message = Message(**row.document)
        picture = self._picture(message.vehicle, message.document.get("cause", ""))
        return addressed(message, number=row.alert, link=self._link(row.alert), picture=picture)

    def _settle(self, row: NotificationRow, errors: Mapping[str, str], now: int) -> None:
        """Store the outcome of an attempt, with what is new about it."""
        reasons = "; ".join(errors.values())
        is_abandoned = bool(errors) and row.attempts + 1 >= _MOST_ATTEMPTS
        if is_abandoned:
            self._record(row, "abandoned", f"after {_MOST_ATTEMPTS} attempts: {reasons}", now)
        elif errors and reasons != row.last_error:
            self._record(row, "undelivered", f"{reasons}; it will be sent again", now)
        elif row.last_error and not errors:
            self._record(row, "delivered", f"at attempt {row.attempts + 1}", now)
        if errors and not is_abandoned:
            self._store.alerts.notification_failed(row.id, reasons)
            self._next[row.id] = self._backoff.next_attempt(row.attempts + 1, now)
        else:
            self._store.alerts.notification_sent(row.id, now)
            self._next.pop(row.id, None)
            self._delivered.pop(row.id, None)

    def _record(self, row: NotificationRow, what: str, comment: str, now: int) -> None:
        """Log what happened to a notification, and add it to the history of the alert."""
        level = logging.INFO if what == "delivered" else logging.ERROR
        LOG.log(level, f"notification of alert {row.alert} was {_WORDS.get(what, what)}: {comment}")
        self._store.alerts.record(row.alert, what, comment, now=now)


class Posting:
    """Lets a postman send in a thread of its own: a slow server delays nothing else.

    Parameters
    ----------
    postman
        Sends the notifications.
    clock
        Present time, UTC ns.
    is_on_duty
        Function that returns whether this monitor sends, and not another one.
    """

    def __init__(
        self, postman: Postman, clock: Callable[[], int], *, is_on_duty: Callable[[], bool] = lambda: True
    ) -> None:
        self._postman, self._clock, self._is_on_duty = postman, clock, is_on_duty
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="post", daemon=True)

    def open(self) -> None:
        """Start sending."""
        self._thread.start()

    def close(self) -> None:
        """Stop; unsent notifications stay in the store."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(5.0)

    def _run(self) -> None:
        """Send what is due, until stopped."""
        while not self._stopping.wait(_EVERY):
            if not self._is_on_duty():
                continue
            try:
                self._postman.send(now=self._clock())
            except StoreError as error:
                LOG.warning("notifications wait for the store", extra={"reason": str(error)})


def try_senders(send: Send, *, now: int) -> dict[str, str]:
    """Send a test message by each sender of a site file.

    Parameters
    ----------
    send
        Senders of the site file.
    now
        Present time, UTC ns.

    Returns
    -------
    dict
        Reason of the failure by name of the sender, such as "mail 1"; empty where the message was sent.

    Raises
    ------
    ParameterError
        If the site file has no sender.
    """
    senders = _configured(send)
    if not senders:
        raise ParameterError(
            "the site file has no sender, so alerts go to the log and to MQTT only: add [[send.mail]] or "
            "[[send.webhook]] to it, and give it with --site"
        )
    errors = deliver(trial_message(now), senders)
    return {sender.name: errors.get(sender.name, "") for sender in senders}


def senders_of(send: Send, publish: Callable[[str, bytes], object]) -> list[Sender]:
    """Return the senders of a site: the log, the topic, and those of the site file."""
    return [LogSender(LOG), PublishSender(publish), *_configured(send)]


def _configured(send: Send) -> list[Sender]:
    """Return the senders of a site file."""
    hooks = [hook.as_sender(f"webhook {number}") for number, hook in enumerate(send.webhook, start=1)]
    mails = [mail.as_sender(f"mail {number}") for number, mail in enumerate(send.mail, start=1)]
    return [*hooks, *mails]
