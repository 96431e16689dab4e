"""A cluster of Spark on loopback: a master and workers, whose processes can be killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pyspark

SPARK_CLASS, SPARK_SUBMIT = (Path(pyspark.__file__).parent / "bin" / name for name in ("spark-class", "spark-submit"))
DEPLOY = "org.apache.spark.deploy"


class Cluster:
    """A master and workers with one core each.

    Parameters
    ----------
    folder
        Folder for logs and work.
    workers
        Number of workers.
    """

    def __init__(self, folder: Path, *, workers: int = 2) -> None:
        self._folder = folder
        self._n_workers = workers
        self._processes: list[subprocess.Popen[bytes]] = []
        self.port = _free_port()

    @property
    def url(self) -> str:
        return f"spark://127.0.0.1:{self.port}"

    def __enter__(self) -> "Cluster":
        self._folder.mkdir(parents=True, exist_ok=True)
        self._start(f"{DEPLOY}.master.Master", "--host", "127.0.0.1", "--port", str(self.port), "--webui-port", "0")
        _wait(lambda: _answers(self.port), "the master of Spark does not answer")
        for _ in range(self._n_workers):
            place = ("--host", "127.0.0.1", "--cores", "1", "--memory", "1g", "--webui-port", "0")
            self._start(f"{DEPLOY}.worker.Worker", *place, "--work-dir", str(self._folder / "work"), self.url)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(20)
            process.kill()
            process.wait()

    def executors(self) -> list[int]:
        """Return the processes that run tasks."""
        return [pid for worker in self._processes[1:] for pid in children(worker.pid)]

    def python_workers(self) -> list[int]:
        """Return the processes of Python that run tasks: children of each executor's daemon."""
        daemons = [pid for executor in self.executors() for pid in children(executor)]
        return [pid for daemon in daemons for pid in children(daemon)]

    def _start(self, *command: str) -> None:
        environment = {
            **os.environ,
            "SPARK_LOCAL_IP": "127.0.0.1",
            "SPARK_MASTER_HOST": "127.0.0.1",
            "PYSPARK_PYTHON": sys.executable,
            "SPARK_LOCAL_DIRS": str(self._folder / "local"),
            "OPENBLAS_NUM_THREADS": "1",
        }
        with (self._folder / "log.txt").open("ab") as log:
            process = subprocess.Popen([str(SPARK_CLASS), *command], env=environment, stdout=log, stderr=log)
        self._processes.append(process)


def children(pid: int) -> list[int]:
    """Return the children of a process."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            found += [int(child) for child in task.read_text().split()]
    return found


def kill(pids: list[int]) -> bool:
    """Kill one of some processes, and return whether there was one."""
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
            return True
    return False


def _free_port() -> int:
    with socket.socket() as opened:
        opened.bind(("127.0.0.1", 0))
        port: int = opened.getsockname()[1]
        return port


def _answers(port: int) -> bool:
    with socket.socket() as opened:
        opened.settimeout(1)
        return opened.connect_ex(("127.0.0.1", port)) == 0


def _wait(condition, reason: str, *, seconds: float = 90.0) -> None:  # type: ignore[no-untyped-def]
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(reason)
        time.sleep(0.2)
