"""What every study drives, returns and leaves: drives and what they sweep, published numbers beside ours, data, a figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.fileio import csv_bytes, write_atomically
from hdvplan.judging.result import Result, result_of
from hdvplan.planning.objectives import Objective
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.report.grid import markdown_table
from hdvplan.report.style import figure_bytes
from hdvplan.reproduce import STUDIES
from hdvplan.reproduce.published import Number
from hdvplan.road.road import Road

REFERENCE_STEP_M = 0.5  # [GEO]'s
Progress = Callable[[float], None]
WORDS = ("study", "quantity", "unit", "status", "remark")  # the columns of tables that hold no numbers
STATUSES = ("reproduced", "fitted", "explained", "open")
NOT_EXPLAINED = "not explained"  # in a remark


@dataclass(frozen=True)
class Row:
    """A quantity as published and as found here; ``published`` is None where the papers give no number.

    ``remark`` says why the two differ by more than the published number can be read, or that it is not explained.
    ``counted`` is not for what tells more of a number that has a row of its own, or compares curves. ``fitted``: what is chosen here, by
    the published number or as a limit, makes them agree.
    """

    quantity: str
    unit: str
    published: Number | None
    ours: float
    remark: str = ""
    counted: bool = True
    fitted: bool = False

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
            return "fitted" if self.fitted else "reproduced"
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
        known = [Number(np.nan, np.nan) if row.published is None else row.published for row in self.rows]
        table["published"] = [number.value for number in known]
        table.insert(4, "difference", table["ours"] - table["published"])
        table.insert(3, "reading_error", [number.reading_error for number in known])
        return table


def best_fit(rows: Sequence[Row], again: Callable[[float], Sequence[float]], bounds: tuple[float, float]) -> float:
    """Return the value of a parameter that is not published, the same for all rows, with which published numbers are met best.

    ``again`` returns what rows hold with a value of it; each row counts by how exactly its published number can be read.
    """

    def misfit(value: float) -> float:
        pairs = zip(again(value), rows, strict=True)
        return sum(((ours - row.published.value) / row.published.reading_error) ** 2 for ours, row in pairs if row.published)

    return float(scipy.optimize.minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-3 * np.ptp(bounds)}).x)


def explained(rows: Sequence[Row], again: Sequence[float], words: str) -> list[Row]:
    """Return rows with what another set-up, the same for all, makes of those that differ and have no remark; ``words`` name it."""
    told = [f"{_number(ours, signed=False)} with {words}" for ours in again]
    return [
        replace(row, remark=f"{NOT_EXPLAINED}: {remark}" if replace(row, ours=ours).differs else remark)
        if row.differs and not row.remark
        else row
        for row, ours, remark in zip(rows, again, told, strict=True)
    ]


def summary_of(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the published numbers of several studies' tables under each other, named by their study."""
    every = pd.concat([table.assign(study=name) for name, table in tables.items()], ignore_index=True)
    every = every[["study", *(column for column in every.columns if column != "study")]]
    return every[every["status"] != ""].reset_index(drop=True)


def counted(table: pd.DataFrame) -> str:
    """Return in one sentence how many published numbers of a table are reproduced."""
    counts = table["status"].value_counts()
    return ", ".join(f"{counts.get(status, 0)} {status}" for status in STATUSES) + f" of {sum(table['status'] != '')} published numbers"


def shown(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table as text: four significant digits, a dash where there is no value."""
    text = pd.DataFrame(index=table.index)
    for column in table.columns:
        numeric = column in {"published", "reading_error", "ours", "difference"}
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
    """Write ``<name>.md``, ``.csv``, ``.png`` and ``<name>-data.csv`` into ``directory``, made if need be."""
    directory.mkdir(parents=True, exist_ok=True)
    write_atomically(directory / f"{study.name}.md", markdown(study).encode())
    write_atomically(directory / f"{study.name}.csv", csv_bytes(study.table()))
    write_atomically(directory / f"{study.name}.png", figure_bytes(study.figure(), "png"))
    write_atomically(directory / f"{study.name}-data.csv", csv_bytes(study.data))


def write_summary(directory: Path) -> None:
    """Write the published numbers of all studies that ``directory`` holds as ``summary.md`` and ``summary.csv``, if these are several."""
    files = {name: directory / f"{name}.csv" for name in STUDIES}
    tables = {name: pd.read_csv(path).fillna(dict.fromkeys(WORDS, "")) for name, path in files.items() if path.is_file()}
    if len(tables) > 1:
        table = summary_of(tables)
        told = f"{counted(table)}. Each study's own table has more rows."
        text = markdown_table(shown(table), text=WORDS)
        write_atomically(directory / "summary.md", f"# Published and reproduced\n\n{told}\n\n{text}\n".encode())
        write_atomically(directory / "summary.csv", csv_bytes(table))


def swept(case: Case, objective: Objective | None = None) -> Result:
    """Drive a case and judge what it sweeps; see ``drive_case`` and ``result_of`` for the errors.

    ``objective`` is what ``case.objective`` calls it where that is no name that users know.
    """
    return result_of(drive_case(case, objective), solver=case.solver, objective=case.objective)


def unevenness(found: Result) -> FloatArray:
    """Return how much further a drive reaches to the left than to the right, over the envelope's arclengths, shape (n,) [m]."""
    return found.envelope.reach_left + found.envelope.reach_right


def area_difference(found: Result) -> float:
    """Return the area swept to the left less that to the right, in the road-aligned frame [m^2]."""
    return float(np.trapezoid(unevenness(found), found.envelope.s))


def sides_of(found: Mapping[str, Result]) -> pd.DataFrame:
    """Return over the s of the first drive the reaches of all, a column a side, left positive [m]."""
    columns = {"s": next(iter(found.values())).envelope.s}
    for name, one in found.items():
        columns |= {f"{name}_left": one.envelope.reach_left, f"{name}_right": one.envelope.reach_right}
    return pd.DataFrame(columns)


def predicted(planned: Result) -> Result:
    """Return what the first plan of a drive predicted that it would sweep: its own states in the place of the simulation.

    The drive must have been planned in one horizon.
    """
    plan, driven = planned.drive.plans[0], planned.drive
    believed = replace(driven, z=plan.z, poses_s=driven.stations.s[: len(plan.z)], poses_z=plan.z)
    return result_of(believed, solver=planned.case.solver, objective=planned.case.objective)


def whole_manoeuvre(road: Road, step: float) -> PlannerSettings:
    """Return the settings that plan all of ``road`` in one horizon, to convergence.

    The smoothness weight is that of the same continuous problem: sums of squares scale with 1 / step, sums of squared curvature
    changes with step.
    """
    length = step * float(np.ceil(road.path.length / step - 1e-9))
    smoothness = PlannerSettings().smoothness * (REFERENCE_STEP_M / step) ** 2
    return PlannerSettings(scheme=Scheme.SQP, horizon=length, replan=length, step=step, smoothness=smoothness)
