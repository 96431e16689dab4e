"""Who may use the broker inside a monitor: programs that know its password. Loaded by that broker."""

import hmac
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from sprung.link import LOCAL_USER


@dataclass
class Config:
    """Settings of the plugin.

    Parameters
    ----------
    secret
        The password.
    """

    secret: str


async def authenticate(plugin: Any, *, session: Any) -> bool:
    """Return whether a session has user name and password."""
    is_known = session.username == LOCAL_USER
    return is_known and hmac.compare_digest((session.password or "").encode(), plugin.config.secret.encode())


# amqtt has no types, so that a class statement could not be checked.
LocalUsers = type(
    "LocalUsers",
    (import_module("amqtt.plugins.base").BaseAuthPlugin,),
    {"Config": Config, "authenticate": authenticate},
)
