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
from sprung.state import STEPS, WATCHING, health_index, is_of_suspension, severity_step

__all__ = [
    "STEPS",
    "WATCHING",
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
    "health_index",
    "is_of_suspension",
    "message_of",
    "reported",
    "severity_step",
    "shelf_ended",
    "shelved",
    "trial_message",
    "unshelved",
]
