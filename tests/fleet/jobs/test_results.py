"""Tables of results: compaction writes few large files, in groups of rows that fit into memory."""

import pyarrow as pa
import pyarrow.parquet as pq

from sprung.fleet.jobs import Results
from sprung.fleet.jobs.results import SCHEMAS
from sprung.fleet.jobs.spark import write_rows

DATE = {"date": "2026-11-21"}


def test_compaction_keeps_rows_and_limits_groups(tmp_path) -> None:
    """One group for a whole file would take a gigabyte of the driver's memory."""
    results = Results(tmp_path)
    table = results["windows"]
    table.create()
    files = []
    for part in range(3):
        rows = [{"vehicle": f"car-{part}", "start": number, "document": "{}"} for number in range(200)]
        files.append(write_rows(rows, location=table.location, schema=SCHEMAS["windows"], partition=DATE))
    table.commit(files)
    before = table.rows(["vehicle", "start", "document"])
    results.compact()
    (whole,) = table.files()
    groups = pq.ParquetFile(table.uri(whole)).metadata
    assert whole.n_rows == groups.num_rows == 600
    assert max(groups.row_group(number).num_rows for number in range(groups.num_row_groups)) <= 256
    order = [("vehicle", "ascending"), ("start", "ascending")]
    after: pa.Table = table.rows(["vehicle", "start", "document"])
    assert after.sort_by(order).equals(before.sort_by(order))
