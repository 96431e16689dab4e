"""Pages and interface of the monitor, by HTTP."""

from sprung._checks import missing_package

try:
    from sprung.service.app import application
    from sprung.service.context import Context
    from sprung.service.people import Role, add_account, add_token, remove_account, remove_token
    from sprung.service.server import Server
except ImportError as error:
    raise missing_package(error, "fastapi", purpose="the pages of the monitor", extra="online") from None

__all__ = [
    "Context",
    "Role",
    "Server",
    "add_account",
    "add_token",
    "application",
    "remove_account",
    "remove_token",
]
