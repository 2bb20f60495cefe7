"""Tables, figures and files of studies, on small ones and made-up ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from hdvplan.reproduce.published import Number
from hdvplan.reproduce.study import Row, Study, best_fit, counted, explained, markdown, shown, summary_of, write_study, write_summary
from hdvplan.reproduce.timing import timing
from tests.reproduce.conftest import silent


def made_up(name: str, *rows: Row) -> Study:
    return Study(name, name.title(), "[GEO] fig. 0", "Made up.", (), rows, pd.DataFrame({"s": [0.0, 1.0]}), Figure)


ROWS = (
    Row("reach", "m", Number(2.0, 0.01), 2.005),
    Row("width", "m", Number(2.0, 0.01), 2.5, "another road"),
    Row("count", "", None, 3.0),
    Row("height", "m", Number(2.0, 0.01), 2.5, "not explained: neither road gives it"),
    Row("depth", "m", Number(2.0, 0.01), 2.5),
)


def test_a_row_differs_beyond_reading_error_only() -> None:
    assert [row.differs for row in ROWS] == [False, True, False, True, True]
    assert Row("lost", "m", Number(2.0, 0.01), float("nan")).differs


def test_numbers_are_reproduced_explained_or_open_and_counted() -> None:
    study = made_up("one", *ROWS)
    assert [row.status for row in ROWS] == ["reproduced", "explained", "", "open", "open"]
    fitted = replace(ROWS[0], fitted=True)
    assert fitted.status == "fitted"  # it counted as reproduced
    assert replace(fitted, ours=2.5).status == "open"
    assert counted(study.table()) == "1 reproduced, 0 fitted, 1 explained, 2 open of 4 published numbers"


def test_one_value_of_what_is_not_published_is_fitted_to_all_rows_and_explains_what_it_meets() -> None:
    rows = [
        Row("reach", "m", Number(2.0, 0.01), 2.5),
        Row("width", "m", Number(4.2, 0.1), 5.0),
        Row("free", "m", Number(2.0, 0.01), 2.5, "its own remark"),
        Row("met", "m", Number(2.0, 0.01), 2.0),
        Row("count", "", None, 3.0),
    ]

    def again(value: float) -> list[float]:
        return [value, 2.0 * value, 2.0, 2.0, value]

    value = best_fit(rows, again, (1.0, 3.0))
    assert abs(value - (2.0 * 1e4 + 8.4 * 1e2) / (1e4 + 4e2)) < 2e-3  # weighted least squares, to the thousandth of the bounds asked for
    told = explained(rows, again(value), "another road")
    assert [row.status for row in told] == ["explained", "open", "explained", "reproduced", ""]
    remarks = ["2.004 with another road", "not explained: 4.008 with another road", "its own remark", "", ""]
    assert [row.remark for row in told] == remarks


def test_a_table_keeps_its_numbers_and_says_nothing_where_nothing_is_published() -> None:
    table = made_up("one", *ROWS).table()
    assert table["difference"][1] == 0.5
    assert np.isnan(table["published"][2])
    assert np.array_equal(table["reading_error"], [np.nan if row.published is None else row.published.reading_error for row in ROWS], True)
    text = shown(table)
    assert list(text["published"]) == ["2.000", "2.000", "-", "2.000", "2.000"]
    assert list(text["difference"]) == ["+0.0050", "+0.5000", "-", "+0.5000", "+0.5000"]


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0.0000"), (4e-5, "4.0e-05"), (0.0539, "0.0539"), (2.298, "2.298"), (19.87, "19.9"), (1247.6, "1248")]
)
def test_numbers_are_shown_with_the_digits_that_matter(value: float, text: str) -> None:
    assert shown(made_up("one", Row("x", "", None, value)).table())["ours"][0] == text


def test_a_summary_holds_the_published_numbers_of_all_studies() -> None:
    summary = summary_of({"one": made_up("one", *ROWS).table(), "two": made_up("two", ROWS[0]).table()})
    names = [("one", "reach"), ("one", "width"), ("one", "height"), ("one", "depth"), ("two", "reach")]
    assert list(zip(summary["study"], summary["quantity"], strict=True)) == names


def test_a_study_is_written_as_table_figure_and_data(tmp_path: Path) -> None:
    study, new = made_up("bus-uturn", *ROWS), tmp_path / "new"
    write_study(study, new)
    write_summary(new)
    assert sorted(path.name for path in new.iterdir()) == [f"bus-uturn{end}" for end in ("-data.csv", ".csv", ".md", ".png")]
    assert pd.read_csv(new / "bus-uturn.csv")["ours"].tolist() == [2.005, 2.5, 3.0, 2.5, 2.5]
    assert (new / "bus-uturn.png").read_bytes().startswith(b"\x89PNG")
    assert "another road" in (new / "bus-uturn.md").read_text(encoding="utf-8")


def test_a_study_that_joins_others_in_a_folder_renews_their_summary(tmp_path: Path) -> None:
    for name in ("overhang", "bus-uturn"):
        write_study(made_up(name, *ROWS), tmp_path)
    write_summary(tmp_path)
    told = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "2 reproduced, 0 fitted, 2 explained, 4 open of 8 published numbers." in told
    rows = pd.read_csv(tmp_path / "summary.csv", keep_default_na=False)
    assert rows["study"].tolist() == ["bus-uturn"] * 4 + ["overhang"] * 4
    assert rows["remark"].tolist()[:2] == ["", "another road"]


def pipes(study: Study) -> set[int]:
    return {line.count("|") for line in markdown(study).splitlines() if line.startswith("|")}


@pytest.mark.slow
def test_times_of_a_busy_machine_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.reproduce.timing.load_average", lambda: [9.0, 1.0, 1.0])
    assert "**BUSY MACHINE: load 9.0 at the start, load 9.0 at the end on" in markdown(timing(silent, ("goteborg_lindholmsallen_uturn",)))


@pytest.mark.slow
def test_every_row_that_differs_has_a_remark_and_every_remark_is_one_line(uturn_study: Study, roundabout_study: Study) -> None:
    for study in (uturn_study, roundabout_study, timing(silent, ("goteborg_lindholmsallen_uturn",))):
        assert [row.quantity for row in study.rows if row.differs and not row.remark] == []
        assert all("\n" not in row.remark for row in study.rows)
        assert len(pipes(study)) == 1  # no cell breaks its table


def labels(figure: Figure) -> set[str]:
    return {text.get_text() for axes in figure.axes for legend in [axes.get_legend()] if legend for text in legend.get_texts()}


def test_the_figures_show_what_the_papers_do(uturn_study: Study, roundabout_study: Study) -> None:
    assert {"previous: rear axle centred", "proposed: geometric weight", "limits"} <= labels(uturn_study.figure())
    figure = roundabout_study.figure()
    assert {"published", "planned", "geometric", "road", "limits", "swept by the tractor"} <= labels(figure)
    assert [axes.get_title(loc="left")[:6] for axes in figure.axes] == ["fig. 8", "fig. 9", "fig. 1", "fig. 1"]
