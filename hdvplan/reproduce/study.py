"""What every study returns and leaves: a table of published numbers beside ours, data, and a figure in the paper's layout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hdvplan.case import Case
from hdvplan.fileio import csv_bytes, write_atomically
from hdvplan.report.grid import markdown_table
from hdvplan.report.style import DPI
from hdvplan.reproduce.published import Number

Progress = Callable[[float], None]
WORDS = ("study", "quantity", "unit", "status", "remark")  # the columns of tables that hold no numbers
STATUSES = ("reproduced", "explained", "open")
NOT_EXPLAINED = "not explained"  # in a remark


@dataclass(frozen=True)
class Row:
    """A quantity as published and as found here; ``published`` is None where the papers give no number.

    ``remark`` says why the two differ by more than the published number can be read, or that it is not explained; ``headline`` rows enter
    the summary. ``counted`` is not for what tells more of a number that has a row of its own, or compares curves.
    """

    quantity: str
    unit: str
    published: Number | None
    ours: float
    remark: str = ""
    headline: bool = False
    counted: bool = True

    @property
    def differs(self) -> bool:
        """Whether the difference is more than reading error."""
        return self.published is not None and not abs(self.ours - self.published.value) <= self.published.reading_error

    @property
    def status(self) -> str:
        """One of ``STATUSES``; nothing where no number of its own is published."""
        if self.published is None or not self.counted:
            return ""
        if not self.differs:
            return "reproduced"
        return "open" if NOT_EXPLAINED in self.remark or not self.remark else "explained"


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
        names = ("quantity", "unit", "published", "ours", "status", "remark")
        table = pd.DataFrame([[getattr(row, name) for name in names] for row in self.rows], columns=list(names))
        table["published"] = [np.nan if row.published is None else row.published.value for row in self.rows]
        table.insert(4, "difference", table["ours"] - table["published"])
        return table


def every_row(studies: Sequence[Study]) -> pd.DataFrame:
    """Return the rows of several studies under each other, named by their study."""
    table = pd.concat([study.table().assign(study=study.name) for study in studies], ignore_index=True)
    return table[["study", *(column for column in table.columns if column != "study")]]


def summary_of(studies: Sequence[Study]) -> pd.DataFrame:
    """Return the headline rows of ``every_row``."""
    return every_row(studies)[[row.headline for study in studies for row in study.rows]].reset_index(drop=True)


def counted(table: pd.DataFrame) -> str:
    """Return in one sentence how many published numbers of a table are reproduced."""
    counts = table["status"].value_counts()
    return ", ".join(f"{counts.get(status, 0)} {status}" for status in STATUSES) + f" of {sum(table['status'] != '')} published numbers"


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


def write_study(study: Study, directory: Path) -> None:
    """Write ``<name>.md``, ``.csv``, ``.png`` and ``<name>-data.csv`` into ``directory``, made if need be.

    Raises:
        OSError: the folder or a file cannot be written.

    """
    directory.mkdir(parents=True, exist_ok=True)
    picture = BytesIO()
    study.figure().savefig(picture, format="png", dpi=DPI)
    write_atomically(directory / f"{study.name}.md", markdown(study).encode())
    write_atomically(directory / f"{study.name}.csv", csv_bytes(study.table()))
    write_atomically(directory / f"{study.name}.png", picture.getvalue())
    write_atomically(directory / f"{study.name}-data.csv", csv_bytes(study.data))


def write_summary(studies: Sequence[Study], directory: Path) -> None:
    """Write the headline rows of several studies as ``summary.md`` and ``summary.csv``.

    Raises:
        OSError: a file cannot be written.

    """
    table, every = summary_of(studies), every_row(studies)
    text = markdown_table(shown(table), text=WORDS)
    told = f"{counted(every)}. Below are {sum(table['status'] != '')} of them that say most; each study's own table has all."
    write_atomically(directory / "summary.md", f"# Published and reproduced\n\n{told}\n\n{text}\n".encode())
    write_atomically(directory / "summary.csv", csv_bytes(table))
