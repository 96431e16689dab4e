"""Sources of streams: windows of a lake, and messages of vehicles in files or in Kafka."""

from pathlib import Path
from typing import TYPE_CHECKING

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.fleet.jobs.files import spark_schema
from sprung.fleet.lake import SCHEMA, Lake, absolute_location

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Largest size of the files in a batch [bytes].
_MAX_BYTES = 1 << 30
#: Largest number of the messages of Kafka in a batch.
_MAX_MESSAGES = 1_000_000
#: Columns of messages: the vehicle, and a frame v1, report or state of its box.
_MESSAGES = "key string, value binary"


def windows_of_lake(session: "SparkSession", lake: Lake) -> "DataFrame":
    """Return the stream of the windows that a lake holds and receives: where they are, without samples.

    Parameters
    ----------
    session
        Session of Spark.
    lake
        Windows of samples.

    Raises
    ------
    DataError
        If there is no lake.

    Notes
    -----
    Spark lists the files of the lake, also those of interrupted commits and rewritten ones; a window counts once, by
    its key.

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> from sprung.fleet.lake import Lake
    >>> windows = windows_of_lake(spark_session("local[2]"), Lake("lake"))  # doctest: +SKIP
    >>> windows.isStreaming, windows.columns[:3]  # doctest: +SKIP
    (True, ['vehicle', 'start', 'digest'])
    """
    lake.table.open()
    files = session.readStream.schema(spark_schema(SCHEMA)).option("pathGlobFilter", "*.parquet")
    files = files.option("ignoreMissingFiles", True).option("maxBytesPerTrigger", _MAX_BYTES)
    keys = (
        "vehicle",
        "start",
        "digest",
        "duration",
        "date",
        "_metadata.file_path AS path",
        "_metadata.row_index AS row",
    )
    return files.parquet(lake.location).selectExpr(*keys, "0L AS n_refused", "'' AS refusal")


def messages_in_folder(session: "SparkSession", folder: str | Path) -> "DataFrame":
    """Return the stream of messages in Parquet files with the columns `key` (vehicle) and `value` in a folder.

    Parameters
    ----------
    session
        Session of Spark.
    folder
        Folder, or URL of an object store; files must appear in it whole.

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> messages = messages_in_folder(spark_session("local[2]"), "messages")  # doctest: +SKIP
    >>> messages.isStreaming, messages.columns  # doctest: +SKIP
    (True, ['key', 'value'])
    """
    files = session.readStream.schema(_MESSAGES).option("pathGlobFilter", "*.parquet")
    return files.option("maxBytesPerTrigger", _MAX_BYTES).parquet(absolute_location(folder))


def messages_in_kafka(session: "SparkSession", servers: str, topic: str) -> "DataFrame":
    """Return the stream of messages of a topic of Kafka from its beginning, whose keys are vehicles.

    Parameters
    ----------
    session
        Session of Spark, with the connector for Kafka among its packages.
    servers
        Addresses of the brokers, such as "kafka-1:9092,kafka-2:9092".
    topic
        Name of the topic.

    Raises
    ------
    ParameterError
        If Spark has no connector for Kafka.

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> settings = {"spark.jars.packages": "org.apache.spark:spark-sql-kafka-0-10_2.13:4.3.0"}
    >>> session = spark_session("local[2]", settings=settings)  # doctest: +SKIP
    >>> messages = messages_in_kafka(session, "kafka-1:9092,kafka-2:9092", "sprung")  # doctest: +SKIP
    >>> messages.isStreaming, messages.columns  # doctest: +SKIP
    (True, ['key', 'value'])
    """
    reader = session.readStream.format("kafka").option("kafka.bootstrap.servers", servers).option("subscribe", topic)
    reader = reader.option("startingOffsets", "earliest").option("maxOffsetsPerTrigger", _MAX_MESSAGES)
    try:
        return reader.load().selectExpr("CAST(key AS STRING) AS key", "value")
    except Exception as error:  # whatever Java makes of an absent connector
        first = str(error).strip().splitlines()[0]
        raise ParameterError(
            f"no stream from Kafka at {servers}: {first[:200]}: start Spark with the package "
            f"org.apache.spark:spark-sql-kafka-0-10_2.13:{session.version}"
        ) from None


def windows_of_messages(messages: "DataFrame", *, duration: float = 600.0) -> "DataFrame":
    """Return the stream of the windows that frames of vehicles complete, with their samples.

    Parameters
    ----------
    messages
        Messages from `messages_in_folder` or `messages_in_kafka`, in any order.
    duration
        Length of a window without its gaps [s].

    Raises
    ------
    ParameterError
        If the duration is out of range.

    Notes
    -----
    The state of a vehicle has the frames of its incomplete window and those that wait for earlier ones
    (`sprung.link.windows.WindowAssembly`).

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> from sprung.fleet.streams import STREAM_SETTINGS
    >>> session = spark_session("local[2]", settings=STREAM_SETTINGS)  # doctest: +SKIP
    >>> windows = windows_of_messages(messages_in_folder(session, "messages"), duration=300.0)  # doctest: +SKIP
    >>> windows.isStreaming, windows.columns[:3]  # doctest: +SKIP
    (True, ['date', 'vehicle', 'start'])
    """
    from pyspark.sql.types import LongType, StringType

    from sprung.fleet.streams.frame_state import FrameState

    check_number("duration", duration, at_least=60, at_most=7200)
    columns = spark_schema(SCHEMA).add("n_refused", LongType()).add("refusal", StringType())
    by_vehicle = messages.where("key IS NOT NULL").groupBy("key")
    windows = by_vehicle.transformWithState(FrameState(duration), columns, "Append", "None")
    return windows.selectExpr("*", "CAST(NULL AS string) AS path", "0L AS row")
