from __future__ import annotations

import pandas as pd

from hdvplan.report.grid import markdown_table


def test_words_stand_left_and_numbers_right_as_they_are_given() -> None:
    table = pd.DataFrame({"road": ["uturn", "s"], "mean [ms]": ["0.10", "12.00"]})
    assert markdown_table(table, text=("road",)).splitlines() == [
        "| road   |   mean [ms] |",
        "|:-------|------------:|",
        "| uturn  |        0.10 |",
        "| s      |       12.00 |",
    ]


def test_no_value_and_no_heading_can_end_a_cell_or_a_row() -> None:
    table = pd.DataFrame({"mean |left + right|": ["a | b\nc"]})
    header, _, row = markdown_table(table, text=()).splitlines()
    assert header == r"|   mean \|left + right\| |"
    assert row.strip("| ") == r"a \| b c"


def test_a_table_without_rows_has_its_heading() -> None:
    assert markdown_table(pd.DataFrame(columns=["road", "ms"]), text=("road",)).startswith("| road")
