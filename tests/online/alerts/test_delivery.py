"""One sender that fails does not keep the others; waits grow."""

from dataclasses import dataclass, field

from sprung.online.alerts import (
    AlertSettings,
    Backoff,
    Message,
    Report,
    SendError,
    deliver,
    message_of,
    reported,
)


@dataclass
class Recorder:
    """A sender that keeps what it is given, or fails."""

    name: str
    shows_pictures: bool = False
    error: Exception | None = None
    sent: list[Message] = field(default_factory=list)

    def send(self, message: Message) -> None:
        if self.error is not None:
            raise self.error
        self.sent.append(message)


def a_message() -> Message:
    report = Report("car", "front_left.spring", 700, "front-left spring 20 % softer: inspect")
    transition = reported(None, report, AlertSettings(), 0)
    return message_of(transition)


def test_one_failing_sender_does_not_keep_the_others() -> None:
    last, message = Recorder("last"), a_message()
    senders = [
        Recorder("faulty", error=KeyError("bug")),
        Recorder("hook", error=SendError("webhook at 127.0.0.1: refused")),
        last,
    ]
    assert deliver(message, senders) == {
        "faulty": "faulty failed with KeyError: 'bug'",
        "hook": "webhook at 127.0.0.1: refused",
    }
    assert last.sent == [message]
    assert deliver(message, [last]) == {}


def test_backoff_doubles_up_to_the_longest() -> None:
    backoff = Backoff(first=3, most=20)
    assert [backoff.next_attempt(attempts, 100) for attempts in (1, 2, 3, 4, 5, 10**9)] == [
        103,
        106,
        112,
        120,
        120,
        120,
    ]
