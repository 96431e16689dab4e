"""Delivery to every sender, with increasing waits after failures."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from sprung._checks import check_number
from sprung.errors import SprungError
from sprung.online.alerts.messages import Message

_SECOND = 1_000_000_000


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
