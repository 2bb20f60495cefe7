"""A study from its definition to its tables: what is known already is skipped, the rest runs on an engine, and all is put together."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hdvplan.answers import NO
from hdvplan.case import settings_json
from hdvplan.errors import OptionError
from hdvplan.fileio import csv_bytes, json_bytes, read_json, write_atomically
from hdvplan.machine import commit, machine_facts, software
from hdvplan.record import command, now
from hdvplan.study.cells import CONDITIONS, Cell, cells_of
from hdvplan.study.engine import PLANNED, REFUSED, UNANSWERED, Engine
from hdvplan.study.pools import LocalEngine
from hdvplan.study.spec import Study, read_study, study_of
from hdvplan.study.store import CELLS, KEPT, PLACES, Store, write_whole

if TYPE_CHECKING:
    import pandas as pd

RECORD, RANKING, STRAYING, PAGE, WORKBOOK, PLAIN = "study.json", "ranking.csv", "straying.csv", "map.html", "table.xlsx", "cells.csv"
_TABLES = (CELLS, PLACES, RANKING, STRAYING, PAGE, WORKBOOK, PLAIN)
_OURS = (*_TABLES, KEPT)
_FORMER = "parts"  # where cells were once kept

Json = dict[str, Any]


@dataclass(frozen=True)
class Results:
    """A finished study in its folder."""

    folder: Path
    outcomes: Mapping[str, int]  # cells by how they ended: planned, no plan, refused, failed, hung, killed
    fits: Mapping[str, int]  # planned cells by the words of their verdicts

    @property
    def unanswered(self) -> int:
        """How many cells have no answer: refused, or failed, hung or killed at their last attempt."""
        return sum(self.outcomes.get(ending, 0) for ending in (REFUSED, *UNANSWERED))

    def reasons(self) -> Counter[tuple[str, str]]:
        """Return why cells have no answer: pairs of ending and reason, each with its number of cells."""
        both = _rows(self.folder / CELLS, "outcome", "reason")
        return Counter((str(outcome), str(reason)) for outcome, reason in both if outcome in (REFUSED, *UNANSWERED))

    def unfit(self) -> list[str]:
        """Return a line for each cell whose vehicle does not fit: road, vehicle, what varies, and the verdict or why there is no plan."""
        import pyarrow.parquet as pq  # noqa: PLC0415 - slow to load

        cells = self.folder / CELLS
        names = pq.read_schema(cells).names
        known = [*names[names.index("vehicle") + 1 : names.index("outcome")], *(column.name for column in CONDITIONS)]
        columns: dict[tuple[object, ...], str] = {}  # once each: a half width is also that to the left and to the right
        for name, values in zip(known, zip(*_rows(cells, *known), strict=True), strict=True):
            columns.setdefault(values, name)
        vary = [name for values, name in columns.items() if len(set(values)) > 1]
        found = []
        for word, verdict, reason, road, vehicle, *own in _rows(cells, "word", "verdict", "reason", "road", "vehicle", *vary):
            if word == NO:
                told = [f"{name} {value}" for name, value in zip(vary, own, strict=True) if value is not None]
                found.append(f"{', '.join([road, vehicle, *told])}: {verdict or reason}")
        return found

    def notes(self) -> Counter[str]:
        """Return what was noted of roads, each with its number of cells: layers that are not read, kerbs that are bridged."""
        return Counter(note for (notes,) in _rows(self.folder / CELLS, "notes") for note in (notes or "").splitlines())

    def rescued(self) -> int:
        """Return in how many cells another solver planned steps that the cell's own one failed at."""
        return sum(bool(steps) for (steps,) in _rows(self.folder / CELLS, "rescued_steps"))

    def cells(self) -> pd.DataFrame:
        """Return one row a cell, in the study's order."""
        return _table(self.folder / CELLS)

    def places(self) -> pd.DataFrame:
        """Return every tightest place, breach, dead end and widening, in the order of the cells."""
        return _table(self.folder / PLACES)

    def ranking(self) -> pd.DataFrame:
        """Return the places that keep vehicles out, those that need the least widening first."""
        import pandas as pd  # noqa: PLC0415 - slow to load

        from hdvplan.study.tables import WORDS  # noqa: PLC0415 - as above

        words = dict.fromkeys(WORDS, str)  # a road may be called 007, or NA
        return pd.read_csv(self.folder / RANKING, dtype=words, keep_default_na=False, na_values=[""])


def run(
    study: Study | str | Path | Mapping[str, object],
    out: str | Path,
    engine: Engine | None = None,
    *,
    on_progress: Callable[[int, int], None] | None = None,
    on_damage: Callable[[str], None] | None = None,
) -> Results:
    """Plan and judge all cells of a study that ``out`` does not hold yet, and write its tables, its ranking and its map there.

    ``study`` is a TOML file, its entries, or a ``Study``; without an ``engine`` it runs in processes on this machine. ``on_progress``
    receives the number of cells that have ended, and of all. Whatever interrupts the run: the cells that ended are kept, and tables of an
    earlier run, whose cells are kept, go first where others are to be planned. Where what is kept is damaged its cells are planned again,
    and ``on_damage`` receives a line; see ``Store``.

    Raises:
        HdvplanError: a definition that makes no study (see ``read_study``), or a folder with files of others.
        OSError: a file cannot be written.

    """
    defined = study if isinstance(study, Study) else study_of(study) if isinstance(study, Mapping) else read_study(Path(study))
    folder = Path(out)
    _refuse_others(folder)
    folder.mkdir(parents=True, exist_ok=True)
    chosen = LocalEngine() if engine is None else engine
    record, former = _begun(defined, folder, chosen), [folder / table for table in _TABLES if (folder / KEPT).exists()]
    with closing(Store(folder, on_damage or (lambda _: None))) as store:
        _plan(defined, store, chosen, on_progress or (lambda _done, _all: None), former)
        write_whole(folder, defined.varied, store, cells_of(defined))
    return _finished(folder, defined.varied, record)


def _plan(study: Study, store: Store, engine: Engine, on_progress: Callable[[int, int], None], former: Sequence[Path]) -> None:
    total = len(study)
    done = total - sum(1 for _ in _left(study, store))
    for table in former if done < total else ():  # who is interrupted shall not find an earlier run's
        table.unlink(missing_ok=True)
    on_progress(done, total)
    with closing(engine.run(_left(study, store))) as ending:
        for ended in ending:
            store.add(ended)
            done += 1
            on_progress(done, total)


def _left(study: Study, store: Store) -> Iterator[Cell]:
    return (cell for cell in cells_of(study) if not store.has_answer(cell.key))


def _refuse_others(folder: Path) -> None:
    """Refuse a folder that cannot hold a study, or holds files of the same names that are not of one."""
    if folder.exists() and not folder.is_dir():
        msg = f"{folder} is a file, not a folder"
        raise OptionError(msg)
    if any("\ud800" <= sign <= "\udfff" for sign in str(folder)):
        msg = f"{folder} has bytes in its name that are no text; files of tables cannot lie there"
        raise OptionError(msg, hint="choose another folder with --out")
    there = next((name for name in (*_OURS, RECORD) if os.path.lexists(folder / name)), None)
    if there is not None and not _sessions(folder):
        damaged = os.path.lexists(folder / RECORD)
        msg = f"{folder / RECORD} is damaged, or not of a study" if damaged else f"{folder} holds {there}, which is not of a study"
        back = f"put back {RECORD} from a copy, or " if damaged else ""
        raise OptionError(msg, hint=f"{back}choose another folder with --out, or move it")
    if there is not None and (folder / _FORMER).is_dir():
        msg = f"{folder / _FORMER} holds cells of an older hdvplan, which this one cannot read"
        raise OptionError(msg, hint="delete it to plan them again, or choose another folder with --out")


def _sessions(folder: Path) -> list[Json]:
    """Return what the record of a study in a folder says of its sessions; nothing where there is none."""
    try:
        found = read_json(folder / RECORD)
    except (OSError, ValueError):
        return []
    sessions = found.get("sessions") if isinstance(found, dict) else None
    if not isinstance(sessions, list) or not all(isinstance(one, dict) and isinstance(one.get("started"), str) for one in sessions):
        return []
    return sessions


def _begun(study: Study, folder: Path, engine: Engine) -> Json:
    """Write and return the record of a study whose session begins: what was asked, and all sessions with machine and software."""
    described = asdict(study)
    described["manners"] = described.pop("setups")  # as the file has always called them
    for setup, own in zip(described["manners"], study.setups, strict=True):
        setup["settings"] = settings_json(own.settings)
    session = {
        "started": now(),
        "command": command(),
        "engine": repr(engine),
        "software": software(study.solvers, study.objectives),
        "commit": commit(),
        "machine": machine_facts(),
    }
    record = {"study": described, "cells": len(study), "sessions": [*_sessions(folder), session], "finished": None}
    write_atomically(folder / RECORD, json_bytes(record))
    return record


def _finished(folder: Path, varied: tuple[str, ...], record: Json) -> Results:
    from hdvplan.study.map_page import write_page  # noqa: PLC0415 - they load pandas, which needs memory that cells have use for
    from hdvplan.study.tables import ranking_of, straying_of, write_plain, write_workbook  # noqa: PLC0415 - as above

    cells = folder / CELLS
    outcomes, fits = Counter[str](), Counter[str]()
    for (outcome, word), count in Counter(_rows(cells, "outcome", "word")).items():
        outcomes[outcome] += count
        if outcome == PLANNED:
            fits[str(word)] += count
    results = Results(folder, outcomes, fits)
    ranking = ranking_of(cells, folder / PLACES, varied)
    write_atomically(folder / RANKING, csv_bytes(ranking))
    write_atomically(folder / STRAYING, csv_bytes(straying_of(cells, varied)))
    write_workbook(folder / WORKBOOK, cells, varied)
    write_plain(folder / PLAIN, cells)
    write_page(folder / PAGE, cells, ranking, record["sessions"][0]["started"])
    ended = {"outcomes": dict(results.outcomes), "fits": dict(results.fits), "finished": now()}
    write_atomically(folder / RECORD, json_bytes(record | ended))
    return results


def _rows(cells: Path, *columns: str) -> Iterator[tuple[Any, ...]]:
    import pyarrow.parquet as pq  # noqa: PLC0415 - slow to load

    for batch in pq.ParquetFile(cells).iter_batches(columns=list(columns)):
        yield from zip(*(batch[column].to_pylist() for column in columns), strict=True)


def _table(path: Path) -> pd.DataFrame:
    import pandas as pd  # noqa: PLC0415 - slow to load

    return pd.read_parquet(path)
