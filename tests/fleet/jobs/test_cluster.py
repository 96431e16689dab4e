"""A standalone cluster on this machine, with a job by spark-submit whose processes are killed: the same tables."""

import os
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest

from sprung.errors import ParameterError
from sprung.fleet.jobs import FleetSettings, Results, run
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.jobs.spark import spark_session
from sprung.fleet.lake import Lake

pytestmark = pytest.mark.slow

FLEET = Path(__file__).parents[3] / "benchmarks" / "fleet"
FAULT = "rear_left.damper=-0.5"
#: As many tasks of a shuffle as workers, as the session of the other tests has.
FEW_TASKS = ("--conf", "spark.sql.shuffle.partitions=2")


@pytest.fixture
def cluster(spark, monkeypatch, tmp_path):
    """The module of clusters, and a cluster with two workers; paths are relative to a new folder."""
    monkeypatch.syspath_prepend(str(FLEET))
    module = import_module("cluster")
    monkeypatch.chdir(tmp_path)
    with module.Cluster(tmp_path / "cluster", workers=2) as opened:
        yield module, opened


def test_a_submitted_job_whose_processes_are_killed_gives_the_same_tables(cluster, spark, tables, window, car_text):
    module, machines = cluster
    Path("vehicles").mkdir()
    for number in range(2):
        Path(f"vehicles/car{number}.toml").write_text(car_text, encoding="utf-8")
    Lake("lake").write(window(f"car{v}", k, FAULT if v == 0 and k >= 3 else None) for v in range(2) for k in range(6))
    Path("sprung-fleet.py").write_text("from sprung.cli import main\nraise SystemExit(main())\n", encoding="utf-8")
    words = "fleet run lake --vehicles vehicles --out submitted --steps baseline,diagnose --learn 3"
    submitted = subprocess.Popen(
        [module.SPARK_SUBMIT, "--master", machines.url, *FEW_TASKS, "sprung-fleet.py", *words.split(), "--master", ""],
        env={**os.environ, "PYSPARK_PYTHON": sys.executable, "SPARK_LOCAL_IP": "127.0.0.1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    killed = {"python worker": False, "executor": False}
    while submitted.poll() is None:
        if not killed["python worker"]:
            killed["python worker"] = module.kill(machines.python_workers())
        elif not killed["executor"] and Results("submitted")["windows"].exists:
            killed["executor"] = module.kill(machines.executors())
        time.sleep(0.1)
    said, _ = submitted.communicate()
    assert submitted.returncode == 0, said[-3000:]
    assert killed == {"python worker": True, "executor": True}
    settings = FleetSettings(
        steps=("baseline", "diagnose"),
        assessment=AssessmentSettings(learning_windows=3),
    )
    run(spark, Lake("lake"), "vehicles", Results("local"), settings=settings)
    assert tables(Results("submitted")) == tables(Results("local"))
    assert [row["vehicle"] for row in Results("local")["diagnoses"].rows().to_pylist() if row["is_discovery"]] == [
        "car0"
    ]


@pytest.mark.parametrize(
    ("home", "place"), [(None, "this machine lacks"), ("", "this machine lacks"), ("/none", "/none")]
)
def test_without_java_one_sentence_says_what_to_install(monkeypatch, tmp_path, home, place) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("JAVA_HOME", raising=False)
    if home is not None:
        monkeypatch.setenv("JAVA_HOME", home)
    with pytest.raises(
        ParameterError, match=f"Spark needs Java 17 or later, .*{place}.*: install default-jre-headless"
    ):
        spark_session("local[1]")
