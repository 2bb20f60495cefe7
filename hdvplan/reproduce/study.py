"""What every study returns: a table of published numbers beside ours, data, and a figure in the paper's layout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hdvplan.case import Case
from hdvplan.report.grid import markdown_table
from hdvplan.reproduce.published import Number

Progress = Callable[[float], None]
WORDS = ("study", "quantity", "unit", "remark")  # the columns of tables that hold no numbers


@dataclass(frozen=True)
class Row:
    """A quantity as published and as found here; ``published`` is None where the papers give no number.

    ``remark`` says why the two differ by more
    than the published number can be read, or that it is not explained; ``headline`` rows enter the summary.
    """

    quantity: str
    unit: str
    published: Number | None
    ours: float
    remark: str = ""
    headline: bool = False

    @property
    def difference(self) -> float | None:
        """Ours less the published value."""
        return None if self.published is None else self.ours - self.published.value

    @property
    def differs(self) -> bool:
        """Whether the difference is more than reading error."""
        return self.published is not None and not abs(self.ours - self.published.value) <= self.published.reading_error


@dataclass(frozen=True)
class Study:
    """One reproduced experiment; ``note`` says how it was set up, ``cases`` what was driven, ``figure`` draws it when asked."""

    name: str
    title: str
    source: str
    note: str
    cases: tuple[Case, ...]
    rows: tuple[Row, ...]
    data: pd.DataFrame
    figure: Callable[[], Figure]

    def table(self) -> pd.DataFrame:
        """Return the rows as numbers; NaN where nothing is published."""
        return pd.DataFrame(
            {
                "quantity": [row.quantity for row in self.rows],
                "unit": [row.unit for row in self.rows],
                "published": [np.nan if row.published is None else row.published.value for row in self.rows],
                "ours": [row.ours for row in self.rows],
                "difference": [np.nan if row.difference is None else row.difference for row in self.rows],
                "remark": [row.remark for row in self.rows],
            }
        )


def summary_of(studies: Sequence[Study]) -> pd.DataFrame:
    """Return the headline rows of several studies under each other, named by their study."""
    tables = [study.table()[[row.headline for row in study.rows]].assign(study=study.name) for study in studies]
    table = pd.concat(tables, ignore_index=True)
    return table[["study", *(column for column in table.columns if column != "study")]]


def shown(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table as text: four significant digits, a dash where there is no value."""
    text = pd.DataFrame(index=table.index)
    for column in table.columns:
        numeric = column in {"published", "ours", "difference"}
        text[column] = [_number(value, signed=column == "difference") if numeric else str(value) for value in table[column]]
    return text


def markdown(study: Study) -> str:
    """Return a study's table as Markdown, with its title, source and set-up above and its figure below."""
    table = markdown_table(shown(study.table()), text=WORDS)
    return f"# {study.title}\n\n{study.source}. {study.note}\n\n{table}\n\n![{study.title}]({study.name}.png)\n"


def _number(value: float, *, signed: bool) -> str:
    if np.isnan(value):
        return "-"
    size = abs(value)
    digits = 4 if size < 1.0 else 3 if size < 10.0 else 1 if size < 1000.0 else 0  # noqa: PLR2004 - about four significant digits
    text = f"{value:{'+' if signed else ''}.{digits}f}"
    return f"{value:{'+' if signed else ''}.1e}" if value != 0.0 and size < 0.001 else text  # noqa: PLR2004 - else all zeros
