"""Read the files of a plan back, as far as a report needs them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from hdvplan.errors import OptionError
from hdvplan.fileio import read_json, refuse_endless, settle

_TABLES = ("path", "envelope", "profile", "steps")
_ENTRIES = dict.fromkeys(("road", "vehicle", "scheme", "solver", "objective", "status"), str) | {"time_ms": dict}
_LISTS = {
    "bodies": ("name", "wheelbase_m", "hitch_offset_m", "front_m", "rear_m", "width_m"),
    "breaches": ("s_from", "s_to", "s_deepest", "depth_m", "side", "unit", "region"),
    "obstacles": ("name", "distance_m", "s_m", "unit"),
}
_REGION = ("region", "rings")


@dataclass(frozen=True)
class PlanFiles:
    """One plan as ``hdvplan plan`` wrote it: the summary, the regions, and the tables of the files of the same names."""

    directory: Path
    summary: dict[str, Any]
    path: pd.DataFrame
    envelope: pd.DataFrame
    profile: pd.DataFrame
    steps: pd.DataFrame
    regions: list[dict[str, Any]]


def read_plan(directory: Path) -> PlanFiles:
    """Return the plan in a folder.

    Raises:
        OptionError: the folder holds no plan, or one whose files are incomplete or damaged.

    """
    try:
        settle(directory)
    except OSError as error:
        msg = f"the plan in {directory} cannot be read: {error}"
        raise OptionError(msg) from error
    if not (directory / "summary.json").is_file():
        what = f"{directory} has no plan: summary.json is missing" if directory.is_dir() else f"{directory} is not a folder"
        raise OptionError(what, hint="give folders that `hdvplan plan` has written")
    try:
        summary, regions = (read_json(directory / f"{name}.json") for name in ("summary", "regions"))
        _check_summary(summary)
        _check_list(regions, _REGION, "regions.json")
        tables = {name: _table(directory / f"{name}.csv") for name in _TABLES}
        plan = PlanFiles(directory, summary, **tables, regions=regions)
        _check_tables(plan)
    except FileNotFoundError as error:
        msg = f"the plan in {directory} has no {Path(error.filename).name}"
        raise OptionError(msg, hint="plan again: a run that was stopped, or an older version, wrote it") from error
    except (OSError, ValueError) as error:
        msg = f"the plan in {directory} cannot be read: {error}"
        raise OptionError(msg, hint="plan again") from error
    return plan


def _table(path: Path) -> pd.DataFrame:
    refuse_endless(path)
    return pd.read_csv(path, low_memory=False)  # a word in a long column of numbers: an object column, and no warning


def _check_summary(summary: object) -> None:
    """Refuse what is no summary of a plan, or an older one.

    Raises:
        ValueError: an entry is missing, or something else than it should be.

    """
    entries = summary if isinstance(summary, dict) else {}
    for name, kind in _ENTRIES.items():
        if not isinstance(entries.get(name), kind):
            msg = f"summary.json has no {name}"
            raise ValueError(msg)  # noqa: TRY004 - of a file's content
    for name, value in entries.items():
        if name.endswith("_m") and not isinstance(value, int | float | None):
            msg = f"{name} of summary.json must be a number, not {value!r}"
            raise ValueError(msg)
    for name, needed in _LISTS.items():
        _check_list(entries.get(name), needed, f"{name} of summary.json")


def _check_list(items: object, needed: tuple[str, ...], where: str) -> None:
    if not isinstance(items, list) or not all(isinstance(item, dict) and set(needed) <= set(item) for item in items):
        msg = f"{where} must be a list of entries with {', '.join(needed)}"
        raise ValueError(msg)


def _check_tables(plan: PlanFiles) -> None:
    """Refuse tables that do not belong together.

    Raises:
        ValueError: a column is missing or holds no numbers; tables differ in length, or have no rows.

    """
    bodies = len(plan.summary["bodies"])
    for table, needed in (
        (plan.path, ["s", "x", "y", "heading", "e_y", "e_psi", "kappa", *(f"beta{number}" for number in range(1, bodies))]),
        (plan.envelope, ["s", "left", "right", "left_limit", "right_limit", "expected_left", "expected_right"]),
        (plan.profile, ["s", "clearance", *(f"{side}{number}" for number in range(1, bodies + 1) for side in ("left", "right"))]),
        (plan.steps, ["s", "total_ms"]),
    ):
        missing = [column for column in needed if column not in table]
        if missing:
            msg = f"column {missing[0]} is missing"
            raise ValueError(msg)
        if table.empty:
            msg = "a table has no rows"
            raise ValueError(msg)
        words = [column for column in needed if is_bool_dtype(table[column]) or not is_numeric_dtype(table[column])]
        if words:
            msg = f"column {words[0]} has values that are not numbers"
            raise ValueError(msg)
    if len(plan.envelope) != len(plan.profile):
        msg = "envelope.csv and profile.csv differ in length"
        raise ValueError(msg)
