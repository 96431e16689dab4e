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
from sprung.online.monitor.site import Send
from sprung.online.store import Delivery, NotificationRow, ReservationLostError, Store, StoreError

LOG = logging.getLogger("sprung.monitor")

#: Number of attempts after which a sender gives up a notification.
MOST_ATTEMPTS = 20
#: Words for the events of a notification, where they differ from the names.
_WORDS = {"undelivered": "not delivered", "abandoned": "given up"}
#: Time between checks for notifications [s].
_EVERY = 1.0
#: Longest wait for messages under way at the end [s].
_CLOSING = 5.0


class Postman:
    """Sends the notifications that wait in the store through one sender, until it has passed them on.

    Parameters
    ----------
    store
        Store of the notifications.
    sender
        The sender.
    senders
        Names of all senders, which close a notification once all of them have settled it.
    link
        Function that returns the address of an alert by its number; empty: none.
    picture
        Function that returns the figure of an alert of a vehicle and cause as PNG; empty: none.

    Notes
    -----
    A failure is logged and added to the history of the alert when it is first seen, when its reason changes, and when
    the notification is given up; so is the delivery that ends it.

    Delivery is at least once: a notification that was passed on just before the monitor was killed is sent again, with
    the same `Message.key`.
    """

    def __init__(
        self,
        store: Store,
        sender: Sender,
        *,
        senders: Collection[str],
        link: Callable[[int], str] = lambda number: "",
        picture: Callable[[str, str], bytes] = lambda vehicle, cause: b"",
    ) -> None:
        self._store, self._sender, self._senders = store, sender, senders
        self._link, self._picture = link, picture
        self._backoff = Backoff()
        self._results: dict[tuple[int, int], str] = {}
        self._error = self._lasting_error = ""
        self._n_sent = self._n_given_up = 0

    @property
    def name(self) -> str:
        """Name of the sender."""
        return self._sender.name

    @property
    def error(self) -> str:
        """Reason why the last attempt failed; empty after a success."""
        return self._error

    @property
    def lasting_error(self) -> str:
        """Reason why a notification was given up; empty once a later one was passed on."""
        return self._lasting_error

    @property
    def n_sent(self) -> int:
        """Number of notifications passed on since the start."""
        return self._n_sent

    @property
    def n_given_up(self) -> int:
        """Number of notifications given up since the start."""
        return self._n_given_up

    def resume(self, lasting_error: str) -> None:
        """Continue after a restart, with the reason why the last notification was given up; empty: it was not."""
        self._lasting_error = lasting_error

    def send(self, *, now: int) -> bool:
        """Send the notification that is due first, and return whether there was one.

        Raises
        ------
        StoreError
            If the store cannot be used. What was passed on already is not sent again, but recorded later.
        """
        row = self._store.alerts.next_notification(self.name, now=now)
        if row is None:
            return False
        attempt = row.id, row.delivery.attempts
        if attempt not in self._results:
            self._results[attempt] = self._attempt(row)
        with self._store.together():  # progress and its record, or neither
            self._settle(row, self._results[attempt], now)
        self._error = self._results.pop(attempt)
        if not self._error:
            self._n_sent, self._lasting_error = self._n_sent + 1, ""
        elif attempt[1] + 1 >= MOST_ATTEMPTS:
            self._n_given_up, self._lasting_error = self._n_given_up + 1, self._error
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
            picture = self._picture(message.vehicle, message.document.get("cause", ""))
        key = f"{row.created}-{row.id}"
        return addressed(message, number=row.alert, key=key, link=self._link(row.alert), picture=picture)

    def _settle(self, row: NotificationRow, error: str, now: int) -> None:
        """Store the outcome of an attempt, with what is new about it."""
        attempts = row.delivery.attempts + 1
        if not error:
            self._put(row, Delivery(attempts, sent=now), now)
            if attempts > 1:
                self._record(row, "delivered", f"by {self.name} at attempt {attempts}", now)
        elif attempts >= MOST_ATTEMPTS:
            self._put(row, Delivery(attempts, given_up=now, last_error=error), now)
            self._record(row, "abandoned", f"by {self.name} after {attempts} attempts: {error}", now)
        else:
            next_attempt = self._backoff.next_attempt(attempts, now)
            self._put(row, Delivery(attempts, next_attempt, last_error=error), now)
            if error != row.delivery.last_error:
                self._record(row, "undelivered", f"by {self.name}: {error}; it will be sent again", now)

    def _put(self, row: NotificationRow, delivery: Delivery, now: int) -> None:
        """Store the progress of the sender with a notification."""
        self._store.alerts.put_delivery(row.id, self.name, delivery, senders=self._senders, now=now)

    def _record(self, row: NotificationRow, what: str, comment: str, now: int) -> None:
        """Add what happened to a notification to the history of the alert, and log it."""
        self._store.alerts.record(row.alert, what, comment, now=now)
        level = logging.INFO if what == "delivered" else logging.ERROR
        LOG.log(level, f"notification of alert {row.alert} was {_WORDS.get(what, what)} {comment}")


class PostOffice:
    """A postman for each sender, each in a thread of its own: a slow or failing server delays nothing else.

    Parameters
    ----------
    store
        Store of the notifications.
    senders
        Senders with names of their own.
    clock
        Present time, UTC ns.
    link, picture
        As for `Postman`; pictures are drawn one at a time.
    on_heartbeat
        Function that is called with "post" and the name of a sender whenever its thread looks for notifications.
    """

    def __init__(
        self,
        store: Store,
        senders: Sequence[Sender],
        *,
        clock: Callable[[], int],
        link: Callable[[int], str] = lambda number: "",
        picture: Callable[[str, str], bytes] = lambda vehicle, cause: b"",
        on_heartbeat: Callable[[str], object] = lambda name: None,
    ) -> None:
        drawing = threading.Lock()

        def drawn(vehicle: str, cause: str) -> bytes:
            with drawing:
                return picture(vehicle, cause)

        self._store = store
        self._clock = clock
        self._on_heartbeat = on_heartbeat
        self._names = [sender.name for sender in senders]
        self._postmen = [Postman(store, sender, senders=self._names, link=link, picture=drawn) for sender in senders]
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._run, args=(postman,), name=f"post {postman.name}", daemon=True)
            for postman in self._postmen
        ]

    @property
    def problems(self) -> list[str]:
        """Sentence about each sender whose last attempt failed."""
        return [f"alerts are not delivered by {one.name}: {one.error}" for one in self._postmen if one.error]

    @property
    def lasting_problem(self) -> str:
        """Sentence about the senders that gave up a notification and have passed on none since; empty: none."""
        failed = [f"{one.name}: {one.lasting_error}" for one in self._postmen if one.lasting_error]
        if not failed:
            return ""
        return (
            f"notifications were given up after {MOST_ATTEMPTS} attempts by {'; by '.join(failed)}; correct [send] in "
            "the site file, test it with sprung monitor --test-senders, and see sprung alerts for what was missed"
        )

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.figures.FIGURES` about notifications."""
        return {
            "sprung_notifications_sent_total": sum(one.n_sent for one in self._postmen),
            "sprung_notifications_given_up_total": sum(one.n_given_up for one in self._postmen),
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
        self._store.alerts.close_settled(self._names, now=self._clock())
        errors = self._store.alerts.given_up()
        for postman in self._postmen:
            postman.resume(errors.get(postman.name, ""))

    def close(self) -> None:
        """Stop; unsent notifications stay in the store."""
        self._stopping.set()
        end = time.monotonic() + _CLOSING
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, end - time.monotonic()))

    def send(self) -> None:
        """Send all that is due, one sender after the other."""
        for postman in self._postmen:
            while postman.send(now=self._clock()):
                pass

    def _run(self, postman: Postman) -> None:
        """Send what is due, until stopped."""
        wait = _EVERY
        while not self._stopping.wait(wait):
            self._on_heartbeat(f"post {postman.name}")
            try:
                with self._store.reservation.fenced():
                    wait = 0.0 if postman.send(now=self._clock()) else _EVERY
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
