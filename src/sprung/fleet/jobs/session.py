"""Sessions of Spark with the settings that analyses need."""

import os
import shutil
import sys
import tempfile
from typing import TYPE_CHECKING, Any

from sprung._checks import required
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from pyspark.sql import SparkSession

#: Attempts at a task before a run fails: a lost worker costs one.
_ATTEMPTS = 4
#: Settings of every session.
_SETTINGS = {
    "spark.app.name": "sprung",
    "spark.sql.session.timeZone": "UTC",
    "spark.task.maxFailures": str(_ATTEMPTS),
    # One linear-algebra thread for each task: matrices are small.
    "spark.executorEnv.OPENBLAS_NUM_THREADS": "1",
    "spark.executorEnv.OMP_NUM_THREADS": "1",
    # Tasks take as long as their windows are many: what is late is not hung.
    "spark.network.timeout": "600s",
    "spark.sql.execution.arrow.pyspark.enabled": "true",
    "spark.sql.streaming.stateStore.providerClass": (
        "org.apache.spark.sql.execution.streaming.state.RocksDBStateStoreProvider"
    ),
}
_OF_ONE_MACHINE = {
    "spark.ui.enabled": "false",
    "spark.driver.bindAddress": "127.0.0.1",
    "spark.driver.host": "127.0.0.1",
    "spark.ui.showConsoleProgress": "false",
    "spark.sql.shuffle.partitions": "8",
}


def spark_session(master: str = "local[*]", *, settings: dict[str, str] | None = None) -> "SparkSession":
    """Return a session of Spark, or the one that this program has.

    Parameters
    ----------
    master
        local[N] for N processes on this machine (* for all cores), or the address of a cluster such as
        spark://HOST:PORT; "" for the one that spark-submit gives.
    settings
        Further settings of Spark.

    Raises
    ------
    MissingPackageError
        If PySpark is not installed.
    ParameterError
        If there is no Java, or no session can be made.

    Examples
    --------
    >>> settings = {"spark.sql.shuffle.partitions": "2"}
    >>> session = spark_session("local[2]", settings=settings)  # doctest: +SKIP
    >>> session.conf.get("spark.sql.session.timeZone")  # doctest: +SKIP
    'UTC'
    >>> session.conf.get("spark.sql.shuffle.partitions")  # doctest: +SKIP
    '2'
    """
    pyspark = required("pyspark", purpose="archives and streams of a fleet", extra="fleet")
    sql = required("pyspark.sql", purpose="archives and streams of a fleet", extra="fleet")
    if "JAVA_HOME" not in os.environ and shutil.which("java") is None:
        raise ParameterError("Spark needs Java 17 or later, which this machine lacks: install default-jre-headless")
    is_local = master.startswith("local")
    is_here = is_local or "//127.0.0.1" in master or "//localhost" in master
    chosen = dict(_SETTINGS)
    if is_here:
        chosen |= _OF_ONE_MACHINE
    if is_here:
        os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
        os.environ.setdefault("SPARK_LOCAL_IP", "127.0.0.1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    configuration = pyspark.SparkConf()
    for name, value in {**chosen, **(settings or {})}.items():
        configuration.setIfMissing(name, value)
    if master:
        configuration.setMaster(_with_attempts(master))
    session = sql.SparkSession.getActiveSession() or _started(configuration, is_quiet=is_here)
    session.sparkContext.setLogLevel("OFF" if is_here else "ERROR")
    return session


def _started(configuration: Any, *, is_quiet: bool) -> "SparkSession":
    """Return a new session; what Java says as it starts is shown only where it fails."""
    import pyspark
    from pyspark.java_gateway import launch_gateway
    from pyspark.sql import SparkSession

    with tempfile.TemporaryFile("w+", encoding="utf-8") as said:
        try:
            # One Java for all sessions of a process, as PySpark has it.
            gateway = pyspark.SparkContext._gateway or launch_gateway(  # type: ignore[no-untyped-call]
                configuration, {"stderr": said} if is_quiet else None
            )
            return SparkSession(pyspark.SparkContext(gateway=gateway, conf=configuration))
        except Exception as error:  # whatever Java makes of a wrong address
            said.seek(0)
            words = [line for line in (*str(error).splitlines(), *said.read().splitlines()) if "Exception" in line]
            reason = (words or [type(error).__name__])[-1].strip()[:200]
            where = configuration.get("spark.master", "the cluster")
            raise ParameterError(f"no session of Spark at {where}: {reason}") from None


def _with_attempts(master: str) -> str:
    """Return a local master that repeats tasks, as clusters do."""
    if master == "local":
        return f"local[1,{_ATTEMPTS}]"
    if master.startswith("local[") and "," not in master:
        return f"{master.removesuffix(']')},{_ATTEMPTS}]"
    return master
