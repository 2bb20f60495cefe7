"""``hdvplan reproduce``: figures and tables of papers and standards, published value beside ours."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.console import ExitCode, duration, note, print_json, print_tables, progress, rows_json, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, QuietOption, check_folder
from hdvplan.reproduce import STUDIES
from hdvplan.settings import choice

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hdvplan.reproduce.study import Progress, Study

NAMES = tuple(STUDIES)
_ALL = "all"
_LONG_S = 10.0  # that users are told beforehand


def reproduce(
    name: Annotated[str, typer.Argument(metavar="NAME", help=f"{', '.join(NAMES)} or all.")] = _ALL,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where to write.", rich_help_panel=OUTPUT)] = Path("results"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Repeat experiments of papers and turns of standards.

    Published numbers are beside ours. Writes NAME.md and NAME.csv (the table), NAME.png (the figure in the paper's layout), NAME-data.csv
    and NAME-run.json (what was driven, with which versions, on which machine) for every study, and a summary of all that are in DIR. Where
    published numbers and ours differ by more than the reading error (a column), a remark says why, or that it is not explained.
    """
    chosen = NAMES if choice("NAME", name, [*NAMES, _ALL]) == _ALL else (name,)
    check_folder(out)
    from hdvplan.machine import use_one_thread

    use_one_thread()  # before anything imports NumPy

    seconds = sum(STUDIES[study][1] for study in chosen)
    note(f"this takes about {duration(seconds)}", quiet=quiet or seconds < _LONG_S)
    with progress("reproducing", quiet=quiet, undisturbed=True) as on_progress:
        studies = _run(chosen, out, on_progress, quiet=quiet)
    if json:
        print_json({study.name: rows_json(study.table()) for study in studies})
    elif not quiet:
        _print(studies, out)
    return ExitCode.OK


def _run(names: Sequence[str], out: Path, on_progress: Progress, *, quiet: bool) -> list[Study]:
    from hdvplan.record import write_record
    from hdvplan.reproduce.study import write_study, write_summary

    total, done = sum(STUDIES[name][1] for name in names), 0.0
    studies: list[Study] = []
    with writing(f"to {out}"):
        for name in names:
            module, share = STUDIES[name]
            begin, part = done, share / total
            study = getattr(import_module(f"hdvplan.reproduce.{module}"), name.replace("-", "_"))
            studies.append(study(lambda share, begin=begin, part=part: on_progress(begin + part * share)))
            write_study(studies[-1], out)
            write_record(out, studies[-1].cases, name)
            note(f"wrote {out / name}.md, .csv, .png, -data.csv and -run.json", quiet=quiet or len(names) == 1)
            done += part
        write_summary(out)
    return studies


def _print(studies: list[Study], out: Path) -> None:
    from hdvplan.report.grid import grid
    from hdvplan.reproduce.study import counted, shown, summary_of

    several = len(studies) > 1
    found = summary_of({study.name: study.table() for study in studies}) if several else studies[0].table()
    table = shown(found)
    title = "published and reproduced" if several else f"{studies[0].title} ({studies[0].source})"
    table["quantity"] += [f" [{unit}]" if unit else "" for unit in table["unit"]]
    columns = [*(["study"] if several else []), "quantity", "published", "ours", "difference", "status"]
    rows = table[columns].itertuples(index=False, name=None)
    caption = f"{counted(found)}; written to {out}/; {'NAME' if several else studies[0].name}.md has the remarks"
    print_tables(grid(title, columns, rows, text=("study", "quantity", "status"), caption=caption))
