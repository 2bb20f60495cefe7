"""Write studies down: table, figure and data of each, and the summary of several."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from hdvplan.fileio import csv_bytes, write_atomically
from hdvplan.report.grid import markdown_table
from hdvplan.report.style import DPI
from hdvplan.reproduce.study import WORDS, Study, markdown, shown, summary_of


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
    table = summary_of(studies)
    text = markdown_table(shown(table), text=WORDS)
    write_atomically(directory / "summary.md", f"# Published and reproduced\n\n{text}\n".encode())
    write_atomically(directory / "summary.csv", csv_bytes(table))
