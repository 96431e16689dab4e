"""Alerts with hold-off, hysteresis, acknowledgement and shelving, and senders of notifications."""

from sprung.online.alerts.alerts import (
    STEPS,
    WATCHING,
    Alert,
    AlertSettings,
    Change,
    Report,
    Transition,
    is_of_suspension,
    severity_step,
    state_name,
)
from sprung.online.alerts.delivery import Backoff, Sender, SendError, deliver
from sprung.online.alerts.health import health_index
from sprung.online.alerts.messages import Message, addressed, message_of, trial_message
from sprung.online.alerts.people import acknowledged, assigned, closed, commented, shelf_ended, shelved, unshelved
from sprung.online.alerts.rounds import absent, assess, reported
from sprung.online.alerts.senders import LogSender, MailSender, PublishSender, WebhookSender
from sprung.online.alerts.services import ServiceSender

__all__ = [
    "STEPS",
    "WATCHING",
    "Alert",
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
    "state_name",
    "trial_message",
    "unshelved",
]
