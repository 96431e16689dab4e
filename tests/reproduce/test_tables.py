import numpy as np

from sprung.reproduce.thesis import theory_table


def test_tables_by_columns() -> None:
    table = theory_table("T", ("bounce",), ([2.0], [2.02]), ([10.0], [np.nan]), digits=(1, 2, 0, 1), remark="R.")
    assert table.columns == (
        "",
        "f published [Hz]",
        "f ours [Hz]",
        "deviation",
        "ξ published [%]",
        "ξ ours [%]",
        "deviation",
    )
    assert table.rows == (("bounce", "2.0", "2.02", "+1.00 %", "10", "–", "–"),)
    assert table.caption == "R."
