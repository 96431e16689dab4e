"""Alerts with hold-off, hysteresis, acknowledgement and shelving, and senders of notifications."""

from sprung.online.alerts.alerts import AlertSettings, Change, Report, Transition
from sprung.online.alerts.messages import Message, addressed, message_of, trial_message
from sprung.online.alerts.senders import (
    Backoff,
    LogSender,
    MailSender,
    PublishSender,
    Sender,
    SendError,
    ServiceSender,
    WebhookSender,
    deliver,
)
from sprung.online.alerts.transitions import (
    absent,
    acknowledged,
    assess,
    assigned,
    closed,
    commented,
    reported,
    shelf_ended,
    shelved,
    unshelved,
)

__all__ = [
    "AlertSettings",
    "Backoff",
    "Change",
    "LogSender",
    "MailSender",
    "Message",
    "PublishSender",
    "Report",
    "SendError",
    "Sender",
    "ServiceSender",
    "Transition",
    "WebhookSender",
    "absent",
    "acknowledged",
    "addressed",
    "assess",
    "assigned",
    "closed",
    "commented",
    "deliver",
    "message_of",
    "reported",
    "shelf_ended",
    "shelved",
    "trial_message",
    "unshelved",
]
