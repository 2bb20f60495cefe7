"""Read the files of a plan back, as far as a report needs them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from hdvplan.errors import OptionError

_TABLES = ("path", "envelope", "profile", "steps")


@dataclass(frozen=True)
class PlanFiles:
    """One plan as ``hdvplan plan`` wrote it: the summary, and the tables of the files of the same names."""

    directory: Path
    summary: dict[str, Any]
    path: pd.DataFrame
    envelope: pd.DataFrame
    profile: pd.DataFrame
    steps: pd.DataFrame


def read_plan(directory: Path) -> PlanFiles:
    """Return the plan in a folder.

    Raises:
        OptionError: the folder holds no plan, or one whose files are incomplete or damaged.

    """
    if not (directory / "summary.json").is_file():
        what = f"{directory} holds no plan: it has no summary.json" if directory.is_dir() else f"{directory} is no folder"
        raise OptionError(what, hint="give folders that `hdvplan plan` has written")
    try:
        summary = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
        tables = {name: pd.read_csv(directory / f"{name}.csv") for name in _TABLES}
        plan = PlanFiles(directory, summary, **tables)
        _check(plan)
    except FileNotFoundError as error:
        msg = f"the plan in {directory} has no {Path(error.filename).name}"
        raise OptionError(msg, hint="plan again: a run that was stopped, or an older version, wrote it") from error
    except (OSError, ValueError, KeyError) as error:
        msg = f"the plan in {directory} cannot be read: {error}"
        raise OptionError(msg, hint="plan again") from error
    return plan


def _check(plan: PlanFiles) -> None:
    """Refuse tables that do not belong together.

    Raises:
        KeyError: a column or entry is missing.
        ValueError: tables differ in length, or have no rows.

    """
    bodies = len(plan.summary["bodies"])
    for table, needed in (
        (plan.path, ["s", "x", "y", "heading", "e_y", "e_psi", "kappa", *(f"beta{number}" for number in range(1, bodies))]),
        (plan.envelope, ["s", "left", "right", "left_limit", "right_limit", "expected_left"]),
        (plan.profile, ["s", "clearance", *(f"{side}{number}" for number in range(1, bodies + 1) for side in ("left", "right"))]),
        (plan.steps, ["s", "total_ms"]),
    ):
        missing = [column for column in needed if column not in table]
        if missing:
            msg = f"column {missing[0]} is missing"
            raise KeyError(msg)
        if table.empty:
            msg = "a table has no rows"
            raise ValueError(msg)
    if len(plan.envelope) != len(plan.profile):
        msg = "envelope.csv and profile.csv differ in length"
        raise ValueError(msg)
