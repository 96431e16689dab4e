"""The command `sprung mcp`: a monitor's interface and recordings as tools of the Model Context Protocol."""

import json
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote, urlencode

from sprung.cli.options import option
from sprung.errors import DataError, ParameterError, SprungError

if TYPE_CHECKING:
    from mcp.server.mcpserver import MCPServer

#: Returns the answer of the interface to a path below /api/v1 with its query.
Get = Callable[[str], Any]

_INSTRUCTIONS = """Sprung watches suspensions of vehicles. Answer from what the tools return, and state the source:
vehicle, alert, window or file. Changes are shares (-0.2: a loss of 20 %), times UTC nanoseconds since 1970.
Say "no change detected", never that a vehicle is healthy, and name the smallest loss that would have been found
(`detectable`); what is unknown is unknown. Nothing can be changed through these tools."""


def mcp(
    *,
    url: Annotated[str, option("URL", "Address of the monitor's pages.")] = "http://127.0.0.1:8737",
    token_file: Annotated[Path | None, option("FILE", "Secret of a token; omit on the monitor's machine.")] = None,
    files: Annotated[Path | None, option("FOLDER", "Recordings to read and identify; omit for none.")] = None,
) -> None:
    """Serve a monitor and recordings as read-only tools (MCP). Model Context Protocol on standard input and output."""
    secret = token_file.read_text(encoding="utf-8").strip() if token_file else ""
    server(lambda path: fetched(url, path, secret), files=files).run("stdio")


def fetched(url: str, path: str, secret: str = "") -> Any:
    """Return the answer of a monitor's interface to a path with its query.

    Raises
    ------
    DataError
        If the monitor refuses, cannot be reached, or something else answers.
    """
    from http.client import HTTPException
    from urllib.error import HTTPError
    from urllib.request import Request, urlopen

    headers = {"Authorization": f"Bearer {secret}"} if secret else {}
    try:
        with urlopen(Request(f"{url.rstrip('/')}/api/v1{path}", headers=headers), timeout=30) as answer:
            return json.load(answer)
    except HTTPError as error:
        raise DataError(f"{path}: {error.code} {error.read(500).decode(errors='replace')}") from None
    except (OSError, HTTPException, ValueError) as error:
        raise DataError(f"{url} does not answer as a monitor: {error}: check --url") from None


def server(get: Get, *, files: Path | None = None) -> "MCPServer":
    """Return the server of the tools.

    Parameters
    ----------
    get
        Asks the interface of the monitor.
    files
        Folder whose recordings may be read; None: none.
    """
    from sprung._checks import required

    required("mcp", purpose="sprung mcp", extra="mcp")
    from mcp.server.mcpserver import MCPServer
    from mcp.server.mcpserver.exceptions import ToolError
    from mcp.types import ToolAnnotations

    def reporting_errors(tool: Callable[..., str]) -> Callable[..., str]:
        @wraps(tool)
        def called(*values: Any, **named: Any) -> str:
            try:
                return tool(*values, **named)
            except SprungError as error:
                raise ToolError(str(error)) from None

        return called

    found = MCPServer("sprung", instructions=_INSTRUCTIONS)
    reads = ToolAnnotations(read_only_hint=True, destructive_hint=False, idempotent_hint=True)
    for tool in (*_of_monitor(get), *(_of_files(files) if files else ())):
        found.tool(annotations=reads, structured_output=False)(reporting_errors(tool))
    return found


def _of_monitor(get: Get) -> tuple[Callable[..., str], ...]:
    """Return the tools that ask the monitor."""

    def ask(**paths: str) -> str:
        return json.dumps({name: get(path) for name, path in paths.items()})

    def fleet(cursor: str = "") -> str:
        """Numbers of vehicles in each state, and the vehicles, the most urgent first; `next` is the cursor of more."""
        return ask(counts="/counts", page=f"/vehicles?{urlencode({'cursor': cursor})}" if cursor else "/vehicles")

    def vehicle(name: str) -> str:
        """A vehicle: verdict, changes of its parts with 95 % intervals, and by its baseline the losses detectable."""
        return ask(vehicle=_vehicle(name), changes=f"{_vehicle(name)}/changes", baseline=f"{_vehicle(name)}/baseline")

    def alerts(vehicle: str = "", cursor: str = "") -> str:
        """Open alerts, the most severe first, of one vehicle (with its verdict) or all; `next`: cursor of more."""
        wanted = {name: value for name, value in (("vehicle", vehicle), ("cursor", cursor)) if value}
        of_vehicle = {"vehicle": _vehicle(vehicle)} if vehicle else {}
        return ask(**of_vehicle, alerts=f"/alerts?{urlencode(wanted)}" if wanted else "/alerts")

    def evidence(alert: int) -> str:
        """The evidence of an alert by its number: change, onset, other hypotheses, windows, and what was detectable."""
        return ask(alert=f"/alerts/{alert}", evidence=f"/alerts/{alert}/evidence")

    def trends(vehicle: str, since: int | None = None, until: int | None = None) -> str:
        """Springs, dampers, tyres and modes of a vehicle over time (UTC ns)."""
        period = {name: value for name, value in {"since": since, "until": until}.items() if value is not None}
        return ask(trends=f"{_vehicle(vehicle)}/trends?{urlencode(period)}")

    def report(alert: int) -> str:
        """The work order of an alert by its number: what to inspect, why, and how sure that is."""
        return ask(work_order=f"/alerts/{alert}/work-order")

    def sensors(vehicle: str) -> str:
        """Data quality of each channel of a vehicle over its last windows."""
        return ask(channels=f"{_vehicle(vehicle)}/data-quality")

    def precision() -> str:
        """How many alerts the verdicts of the workshop have confirmed, and times to repair."""
        return ask(precision="/precision")

    def advice() -> str:
        """Of each type, the vehicle without a baseline whose inspection would teach most, and why; empty: none."""
        return ask(advice="/advice")

    return fleet, vehicle, alerts, evidence, trends, report, sensors, precision, advice


def _vehicle(name: str) -> str:
    """Return the path of a vehicle."""
    return f"/vehicles/{quote(name, safe='')}"


def _of_files(folder: Path) -> tuple[Callable[..., str], ...]:
    """Return the tools that read recordings of a folder."""
    if not folder.is_dir():
        raise ParameterError(f"--files {folder} is no folder: correct the path")

    def known(file: str) -> Path:
        path = (folder / file).resolve()
        if not path.is_relative_to(folder.resolve()) or not path.is_file():
            raise DataError(f"{file} is no file in the folder of recordings")
        return path

    def recordings() -> str:
        """Names of the files in the folder of recordings, for `read` and `identify`."""
        return json.dumps({"files": sorted(str(one.relative_to(folder)) for one in folder.rglob("*") if one.is_file())})

    def read(file: str) -> str:
        """Facts of a recording in the folder: channels, units, rate, gaps, and dead, clipped and stuck channels."""
        return _printed("info", str(known(file)))

    def identify(file: str) -> str:
        """Modes of a recording in the folder, with standard deviations, and notes on what could not be seen."""
        return _printed("identify", str(known(file)))

    return recordings, read, identify


def _printed(*words: str) -> str:
    """Return the document that a command of `sprung` writes."""
    import subprocess
    import sys

    command = [sys.executable, "-m", "sprung", *words, "--json", "-"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    if done.returncode:
        raise SprungError(done.stderr.strip() or f"sprung {words[0]} failed")
    return done.stdout
