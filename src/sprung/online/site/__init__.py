"""Pages and interface of the monitor, by HTTP."""

from sprung._checks import missing_package

try:
    from sprung.online.site.accounts import Role, add_account, add_token, remove_account, remove_token
    from sprung.online.site.app import Server, application
    from sprung.online.site.shared import Context
except ImportError as error:
    raise missing_package(error, "fastapi", purpose="the pages of the monitor", extra="online") from None

__all__ = ["Context", "Role", "Server", "add_account", "add_token", "application", "remove_account", "remove_token"]
