"""What several benchmarks share: options, runs of a vehicle on a shipped road, loaded as `hdvplan plan` loads it, and results."""

from __future__ import annotations

import tomllib
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path

import pandas as pd

from hdvplan.case import Case
from hdvplan.record import write_record
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.vehicle.load import load_vehicle


def options_of(doc: str, folder: str) -> ArgumentParser:
    """Return the parser of a benchmark's options: what its docstring says, and ``--out``, which is a folder of results/ unless given."""
    parser = ArgumentParser(description=doc, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results", folder), metavar="DIR")
    return parser


@cache
def free_case(road: str, name: str) -> Case:
    """Return the run of a vehicle on a road, both by their names, without limits."""
    vehicle = load_vehicle(name)
    loaded = load_road(road, RoadOptions().followed_by(vehicle.max_curvature))
    return Case(replace(loaded, limits=None), vehicle)


def case_within(case: Case, half_width: float) -> Case:
    """Return a run with limits so far to each side of the line [m]."""
    return replace(case, road=case.road.with_limits(half_width, half_width))


def suite_roads() -> list[str]:
    """Return the roads of the committed benchmark."""
    roads: list[str] = tomllib.loads(Path("benchmarks/suite.toml").read_text(encoding="utf-8"))["roads"]
    return roads


def words(text: str) -> list[str]:
    """Return the words of an option that lists them."""
    return text.split(",")


def numbers(text: str) -> list[float]:
    """Return the numbers of an option that lists them."""
    return [float(part) for part in words(text)]


def write_results(
    out: Path, tables: Mapping[str, pd.DataFrame], pages: Mapping[str, str], cases: Sequence[Case], form: str | None = "%.4f"
) -> None:
    """Write tables as CSV and pages as Markdown, by their names, and run.json; see ``write_table`` for ``form``."""
    out.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        write_table(out / f"{name}.csv", table, form)
    for name, page in pages.items():
        (out / f"{name}.md").write_text(page, encoding="utf-8")
    write_record(out, cases)


def write_table(file: Path, table: pd.DataFrame, form: str | None = "%.4f") -> None:
    """Write a table as CSV, its numbers in a ``form`` or, without one, exactly."""
    table.to_csv(file, index=False, float_format=form, lineterminator="\n")


def fill_by_seed(
    file: Path, done: set[int], row_of: Callable[[int], Mapping[str, object] | None], *, first: int, most: int, form: str
) -> None:
    """Append rows of seeds from ``first`` on to a table, until ``most`` are ``done``; a seed may have no row."""
    for seed in count(first):
        if len(done) >= most:
            return
        row = None if seed in done else row_of(seed)
        if row is not None:
            done.add(seed)
            append_row(file, row, form)


def append_row(file: Path, row: Mapping[str, object], form: str = "%.4f") -> None:
    """Append a row to a table, which is begun if it is not there."""
    pd.DataFrame([row]).to_csv(file, mode="a", header=not file.exists(), index=False, float_format=form, lineterminator="\n")
