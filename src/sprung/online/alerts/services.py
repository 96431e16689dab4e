"""A sender for the services of apprise: Teams, Slack, Telegram, SMS and many more."""

import re
from typing import Any

from sprung._checks import required
from sprung.errors import ParameterError
from sprung.online.alerts.alerts import severity_step
from sprung.online.alerts.delivery import SendError
from sprung.online.alerts.messages import Message

#: Kind of a notification by the step of its severity, as apprise names them.
_KINDS = ("info", "info", "warning", "failure", "failure")


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
