"""Notifications from the store to people, until every sender has passed them on."""

import logging
import threading
import time
from collections.abc import Callable, Collection, Sequence

from sprung.errors import ParameterError
from sprung.online.alerts import (
    Backoff,
    LogSender,
    Message,
    PublishSender,
    Sender,
    addressed,
    deliver,
    trial_message,
)
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.site import Send
from sprung.online.monitor.vehicle_report import alert_picture
from sprung.online.store import Delivery, NotificationRow, ReservationLostError, StoreError

LOG = logging.getLogger("sprung.monitor")

#: Number of attempts after which a sender gives up a notification.
MAX_ATTEMPTS = 20
#: Words for the events of a notification, where they differ from the names.
_WORDS = {"undelivered": "not delivered", "abandoned": "given up"}
#: Time between checks for notifications [s].
_EVERY = 1.0
#: Longest wait for messages under way at the end [s].
_CLOSING = 5.0
#: Pictures are drawn one at a time.
_DRAWING = threading.Lock()


class Notifier:
    """Sends the notifications that wait in the store through one sender, until it has passed them on.

    Parameters
    ----------
    context
        Store of the notifications, addresses of alerts, and clock.
    sender
        The sender.
    senders
        Names of all senders, which close a notification once all of them have settled it.

    Notes
    -----
    A failure is logged and added to the history of the alert when it is first seen, when its reason changes, and when
    the notification is given up; so is the delivery that ends it.

    Delivery is at least once: a notification that was passed on just before the monitor was killed is sent again, with
    the same `Message.key`.

    Attributes
    ----------
    error
        Reason why the last attempt failed; empty after a success.
    lasting_error
        Reason why a notification was given up; empty once a later one was passed on.
    n_sent, n_given_up
        Number of notifications passed on, and given up, since the start.
    """

    def __init__(self, context: Context, sender: Sender, *, senders: Collection[str]) -> None:
        self._context = context
        self._store = context.store
        self._sender = sender
        self._senders = senders
        self._backoff = Backoff()
        self._results: dict[tuple[int, int], str] = {}
        self.name = sender.name
        self.error = ""
        self.lasting_error = ""
        self.n_sent = 0
        self.n_given_up = 0

    def send(self) -> bool:
        """Send the notification that is due first, and return whether there was one.

        Raises
        ------
        StoreError
            If the store cannot be used. What was passed on already is not sent again, but recorded later.
        """
        now = self._context.clock()
        row = self._store.alerts.next_notification(self.name, now=now)
        if row is None:
            return False
        attempt = row.id, row.delivery.attempts
        if attempt not in self._results:
            self._results[attempt] = self._attempt(row)
        with self._store.together():  # progress and its record, or neither
            self._settle(row, self._results[attempt], now)
        self.error = self._results.pop(attempt)
        if not self.error:
            self.n_sent += 1
            self.lasting_error = ""
        elif attempt[1] + 1 >= MAX_ATTEMPTS:
            self.n_given_up += 1
            self.lasting_error = self.error
        return True

    def _attempt(self, row: NotificationRow) -> str:
        """Return why a notification could not be passed on; empty if it was."""
        try:
            return deliver(self._message(row), [self._sender]).get(self.name, "")
        except Exception as error:  # a notification that cannot be composed must not hold up the others
            return f"the notification cannot be composed ({type(error).__name__}: {error})"

    def _message(self, row: NotificationRow) -> Message:
        """Return the message of a notification."""
        message = Message(**row.document)
        picture = b""
        if self._sender.shows_pictures:
            with _DRAWING:
                picture = alert_picture(self._store, message.vehicle, message.document.get("cause", ""))
        link = self._context.site.alert_url(row.alert)
        return addressed(message, number=row.alert, key=f"{row.created}-{row.id}", link=link, picture=picture)

    def _settle(self, row: NotificationRow, error: str, now: int) -> None:
        """Store the outcome of an attempt, with what is new about it."""
        attempts = row.delivery.attempts + 1
        what = comment = ""
        if not error:
            delivery = Delivery(attempts, sent=now)
            if attempts > 1:
                what, comment = "delivered", f"by {self.name} at attempt {attempts}"
        elif attempts >= MAX_ATTEMPTS:
            delivery = Delivery(attempts, given_up=now, last_error=error)
            what, comment = "abandoned", f"by {self.name} after {attempts} attempts: {error}"
        else:
            delivery = Delivery(attempts, self._backoff.next_attempt(attempts, now), last_error=error)
            if error != row.delivery.last_error:
                what, comment = "undelivered", f"by {self.name}: {error}; it will be sent again"
        self._store.alerts.put_delivery(row.id, self.name, delivery, senders=self._senders, now=now)
        if what:
            self._store.alerts.record(row.alert, what, comment, now=now)
            level = logging.ERROR if error else logging.INFO
            LOG.log(level, f"notification of alert {row.alert} was {_WORDS.get(what, what)} {comment}")


class NotificationService:
    """A notifier for each sender, each in a thread of its own: a slow or failing server delays nothing else.

    Parameters
    ----------
    context
        Store of the notifications, addresses of alerts, and clock.
    senders
        Senders with names of their own.
    on_heartbeat
        Function that is called with "post" and the name of a sender whenever its thread looks for notifications.
    """

    def __init__(
        self,
        context: Context,
        senders: Sequence[Sender],
        *,
        on_heartbeat: Callable[[str], object] = lambda name: None,
    ) -> None:
        self._context = context
        self._on_heartbeat = on_heartbeat
        self._names = [sender.name for sender in senders]
        self._notifiers = [Notifier(context, sender, senders=self._names) for sender in senders]
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._run, args=(notifier,), name=f"post {notifier.name}", daemon=True)
            for notifier in self._notifiers
        ]

    @property
    def problems(self) -> list[str]:
        """Sentence about each sender whose last attempt failed."""
        return [f"alerts are not delivered by {one.name}: {one.error}" for one in self._notifiers if one.error]

    @property
    def lasting_problem(self) -> str:
        """Sentence about the senders that gave up a notification and have passed on none since; empty: none."""
        failed = [f"{one.name}: {one.lasting_error}" for one in self._notifiers if one.lasting_error]
        if not failed:
            return ""
        return (
            f"notifications were given up after {MAX_ATTEMPTS} attempts by {'; by '.join(failed)}; correct [send] in "
            "the site file, test it with sprung monitor --test-senders, and see sprung alerts for what was missed"
        )

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.station.FIGURES` about notifications."""
        return {
            "sprung_notifications_sent_total": sum(one.n_sent for one in self._notifiers),
            "sprung_notifications_given_up_total": sum(one.n_given_up for one in self._notifiers),
        }

    def open(self) -> None:
        """Continue from the store, and start sending.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        self.resume()
        for thread in self._threads:
            thread.start()

    def resume(self) -> None:
        """Continue from the store."""
        alerts = self._context.store.alerts
        alerts.close_settled(self._names, now=self._context.clock())
        errors = alerts.given_up()
        for notifier in self._notifiers:
            notifier.lasting_error = errors.get(notifier.name, "")

    def close(self) -> None:
        """Stop; unsent notifications stay in the store."""
        self._stopping.set()
        end = time.monotonic() + _CLOSING
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, end - time.monotonic()))

    def send(self) -> None:
        """Send all that is due, one sender after the other."""
        for notifier in self._notifiers:
            while notifier.send():
                pass

    def _run(self, notifier: Notifier) -> None:
        """Send what is due, until stopped."""
        wait = _EVERY
        while not self._stopping.wait(wait):
            self._on_heartbeat(f"post {notifier.name}")
            try:
                with self._context.store.reservation.fenced():
                    wait = 0.0 if notifier.send() else _EVERY
            except ReservationLostError:
                return  # the monitor ends, too
            except StoreError as error:
                wait = _EVERY
                LOG.warning("notifications wait for the store", extra={"reason": str(error)})


def try_senders(send: Send, *, name: str | None = None, now: int) -> dict[str, str]:
    """Send a test message through each sender of a site file, or through one of them.

    Parameters
    ----------
    send
        Senders of the site file.
    name
        Name of a sender, such as "mail 1"; None: all of them.
    now
        Present time, UTC ns.

    Returns
    -------
    dict
        Reason of the failure by name of the sender, such as "mail 1"; empty if the message was sent.

    Raises
    ------
    ParameterError
        If the site file has no sender, or none of that name.
    """
    senders = [sender for sender in _configured(send) if name in {None, sender.name}]
    if name is not None and not senders:
        raise ParameterError(f"unknown sender {name!r}: the page of the site lists those of the site file")
    if not senders:
        raise ParameterError(
            "the site file has no sender, so alerts go to the log and to MQTT only: add [[send.mail]], "
            "[[send.webhook]] or [[send.apprise]] to it, and give it with --site"
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
    services = [service.as_sender(f"apprise {number}") for number, service in enumerate(send.apprise, start=1)]
    return [*hooks, *mails, *services]
