"""Shell completion of arguments: shipped vehicles, and files that a command reads."""

from collections.abc import Collection
from pathlib import Path


def vehicles(incomplete: str) -> list[str]:
    """Return the shipped vehicles and vehicle files that begin with a text."""
    from sprung.vehicles.files import VEHICLES

    return [*(name for name in VEHICLES if name.startswith(incomplete)), *_paths(incomplete, (".toml",))]


def recordings(incomplete: str) -> list[str]:
    """Return the files of known formats that begin with a text."""
    from sprung.formats import ENDINGS

    return _paths(incomplete, ENDINGS)


def recordings_or_documents(incomplete: str) -> list[str]:
    """Return the files of known formats and JSON files that begin with a text."""
    from sprung.formats import ENDINGS

    return _paths(incomplete, (*ENDINGS, ".json"))


def documents(incomplete: str) -> list[str]:
    """Return the JSON files that begin with a text."""
    return _paths(incomplete, (".json",))


def _paths(incomplete: str, endings: Collection[str]) -> list[str]:
    """Return folders, and files with one of the endings; hidden ones only after a dot."""
    head, separator, start = incomplete.rpartition("/")
    folder = Path(f"{head}{separator}" or ".").expanduser()
    names = []
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return []
    for entry in entries:
        is_hidden = entry.name.startswith(".") and not start.startswith(".")
        if not entry.name.startswith(start) or is_hidden:
            continue
        if entry.is_dir():
            names.append(f"{head}{separator}{entry.name}/")
        elif entry.name.lower().endswith(tuple(endings)):
            names.append(f"{head}{separator}{entry.name}")
    return names
