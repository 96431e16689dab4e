"""The password of a broker inside a monitor, in a file that only programs of the same user can read."""

import fcntl
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sprung.errors import SprungError

#: User name under which programs of this machine reach the broker.
LOCAL_USER = "local"
_HERE = {"127.0.0.1", "localhost", "::1"}


class SecretError(SprungError):
    """A password that cannot be kept."""


@contextmanager
def keep_secret(port: int) -> Iterator[str]:
    """Yield a new random password for the broker at a port, kept in a file until the end of the context.

    Raises
    ------
    SecretError
        If the file cannot be written.

    Notes
    -----
    The file is in the folder ``$XDG_STATE_HOME/sprung``, by default ``~/.local/state/sprung`` (mode 700), has mode 600,
    and is locked: so one that a killed program left differs from one in use.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryDirectory
    >>> from unittest.mock import patch
    >>> with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_STATE_HOME=folder):
    ...     with keep_secret(1883) as secret:
    ...         is_found = find_secret("localhost", 1883) == secret
    ...     is_found, find_secret("localhost", 1883)
    (True, '')
    """
    secret = secrets.token_urlsafe(32)
    try:
        path = _path(port)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.unlink(missing_ok=True)  # it may have another mode, or be that of a program that was killed
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.write(handle, secret.encode())
    except (OSError, RuntimeError) as error:
        raise SecretError(
            f"the password of the embedded broker cannot be kept ({error}): set XDG_STATE_HOME to a folder that this "
            "user can write, or give --broker"
        ) from None
    try:
        yield secret
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def find_secret(host: str, port: int) -> str:
    """Return the password of the broker of a monitor that runs on this machine as the same user; empty: none.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryDirectory
    >>> from unittest.mock import patch
    >>> with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_STATE_HOME=folder):
    ...     with keep_secret(1883) as secret:
    ...         find_secret("localhost", 1883) == secret, find_secret("broker.example.org", 1883)
    (True, '')
    """
    if host not in _HERE:
        return ""
    try:
        handle = os.open(_path(port), os.O_RDONLY)
    except (OSError, RuntimeError):
        return ""
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return os.read(handle, 100).decode("ascii", errors="replace")
    finally:
        os.close(handle)
    return ""  # nobody holds the lock: the program that wrote it has ended


def _path(port: int) -> Path:
    """Return the file of the broker at a port of this machine."""
    state = os.environ.get("XDG_STATE_HOME", "")
    return (Path(state) if state else Path.home() / ".local" / "state") / "sprung" / f"broker-{port}"
