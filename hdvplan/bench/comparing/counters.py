"""What a benchmark counts: work, outcome and envelope of every cell, the same in every run of the same program."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from hdvplan.bench import ENVELOPE_M
from hdvplan.bench.measuring.samples import LOST, OK, OVER_BUDGET
from hdvplan.bench.suite import KEY
from hdvplan.errors import OptionError
from hdvplan.fileio import csv_bytes, write_atomically

COUNTS = ("steps", "failures", "unsolved", "nonzeros")
WORK = ("qps", "iterations")  # sums over all planning steps of a drive
LENGTHS = ("max_left_m", "max_right_m", "mean_abs_imbalance_m", "min_clearance_m", "limit_violation_m")
IN_STEPS = "step by step"  # a digest of every step's counts and status
WORK_TOLERANCE = 0.02
_LARGEST = 2.0**53  # whole number that a float holds beside its neighbours


@dataclass(frozen=True)
class Tolerance:
    """How far counters may differ unreported: ``work`` as a share of the sums of QPs and iterations, ``envelope`` [m].

    Two runs on one machine do exactly the same work. Another processor rounds otherwise, and an iteration that ends close
    to its tolerance may be one more or less: a committed baseline needs some room.
    """

    work: float = 0.0
    envelope: float = ENVELOPE_M


@dataclass(frozen=True)
class Change:
    """One counter of one cell that is not what it was; ``base`` and ``new`` as they are shown."""

    cell: tuple[str, ...]  # as in KEY
    counter: str
    base: str
    new: str
    why: str = ""  # of a cell that is no longer planned: what its drive said last

    @property
    def is_missing(self) -> bool:
        """Whether it is a cell of the base that was not measured."""
        return self.counter == "cell" and self.new == "missing"

    @property
    def is_new(self) -> bool:
        """Whether it is a cell that the base does not have."""
        return self.counter == "cell" and not self.is_missing

    def is_red(self, *, expected: bool) -> bool:
        """Whether it is a regression where changed counters are ``expected`` or not."""
        return self.is_lost or not (expected or self.is_new)

    @property
    def is_lost(self) -> bool:
        """Whether it is a cell that was planned to its end, and rightly, before, and is not now."""
        return self.is_missing or (self.counter == "status" and self.base == OK and self.new in LOST)


def counters_of(samples: pd.DataFrame, timing: pd.DataFrame, envelope: pd.DataFrame) -> pd.DataFrame:
    """Return one row a cell: KEY, status, counts, work, lengths and the digest of the first drive's steps.

    Raises:
        ValueError: a table has something else than numbers; of tables that were read, other errors as well.

    """
    _check_numbers(envelope, LENGTHS)
    first = samples[samples["round"] == 0]
    rows = []
    for key, steps in first.groupby(KEY, sort=False):
        counted = steps[["qp_count", "iterations", "status", "usable"]]
        rows.append(
            dict(zip(KEY, key, strict=True))
            | {
                "steps": len(steps),
                "failures": int((~steps["usable"]).sum()),
                "unsolved": int((steps["status"] != "solved").sum()),
                "qps": int(steps["qp_count"].sum()),
                "iterations": int(steps["iterations"].sum()),
                IN_STEPS: sha256(counted.to_csv(index=False).encode()).hexdigest()[:12],
            }
        )
    done = pd.DataFrame(rows, columns=[*KEY, "steps", "failures", "unsolved", *WORK, IN_STEPS])
    table = timing[[*KEY, "status", "nonzeros"]].merge(done, on=KEY, how="left").merge(envelope[[*KEY, *LENGTHS]], on=KEY, how="left")
    whole = [*COUNTS, *WORK]
    counts = table[whole].astype(float).fillna(0.0)  # a cell that failed before its first step
    if np.any(np.abs(counts) > _LARGEST):
        msg = "a table counts more than can be counted"
        raise ValueError(msg)
    table[whole] = counts.astype(int)
    table[IN_STEPS] = table[IN_STEPS].fillna("none")
    return table[[*KEY, "status", *COUNTS, *WORK, *LENGTHS, IN_STEPS]]


def changes_of(base: pd.DataFrame, new: pd.DataFrame, tolerance: Tolerance) -> list[Change]:
    """Return what differs between two tables of counters, cell by cell; the step-by-step digest only if both have it.

    Of cells that ended at their budget on both sides only the non-zeros count: how far they came is a matter of time.
    """
    here, there = _by_cell(base), _by_cell(new)
    exact = ["status", *COUNTS]
    if tolerance.work == 0.0 and IN_STEPS in base and IN_STEPS in new:
        exact.append(IN_STEPS)
    changes = []
    for cell in dict.fromkeys([*here, *there]):
        if cell not in here or cell not in there:
            changes.append(Change(cell, "cell", *("measured" if cell in side else "missing" for side in (here, there))))
            continue
        old, now = here[cell], there[cell]
        if old["status"] == now["status"] == OVER_BUDGET:
            changes += [Change(cell, name, str(old[name]), str(now[name])) for name in ("nonzeros",) if old[name] != now[name]]
            continue
        found = [Change(cell, name, str(old[name]), str(now[name])) for name in exact if old[name] != now[name]]
        found += [
            Change(cell, name, str(old[name]), str(now[name]))
            for name in WORK
            if abs(now[name] - old[name]) > tolerance.work * max(abs(old[name]), 1)
        ]
        found += [
            Change(cell, name, _metres(old[name]), _metres(now[name]))
            for name in LENGTHS
            if np.isnan(old[name]) != np.isnan(now[name]) or abs(now[name] - old[name]) > tolerance.envelope
        ]
        digests_only = [change.counter for change in found] == [IN_STEPS]
        changes += found if digests_only else [change for change in found if change.counter != IN_STEPS]
    return changes


def broken_in_both(base: pd.DataFrame, new: pd.DataFrame) -> list[Change]:
    """Return the statuses of cells that are alike not ok in two tables of counters: nothing changed, and nothing holds there."""
    here, there = ({cell: str(row["status"]) for cell, row in _by_cell(table).items()} for table in (base, new))
    return [
        Change(cell, "status", status, status)
        for cell, status in here.items()
        if status == there.get(cell) and status not in {OK, OVER_BUDGET}
    ]


def _check_numbers(table: pd.DataFrame, columns: tuple[str, ...]) -> None:
    """Refuse columns with words, or with numbers that no float holds."""
    words = next((name for name in columns if not is_numeric_dtype(table[name])), None)
    if words is not None and len(table):
        msg = f"column {words} has values that are not numbers"
        raise ValueError(msg)


def _check_cells(table: pd.DataFrame) -> None:
    """Refuse counts from which nothing differs, and a cell that hides another."""
    spoilt = next((name for name in (*COUNTS, *WORK) if not np.all(np.isfinite(table[name]))), None)
    if spoilt is not None:
        msg = f"column {spoilt} has values that are not finite"
        raise ValueError(msg)
    if table.duplicated(list(KEY)).any():
        msg = "a cell is there twice"
        raise ValueError(msg)


def _by_cell(table: pd.DataFrame) -> dict[tuple[str, ...], dict[str, Any]]:
    return {tuple(str(row[name]) for name in KEY): {str(name): value for name, value in row.items()} for row in table.to_dict("records")}


def _metres(length: float) -> str:
    return "-" if np.isnan(length) else f"{length:.4f}"


def write_counters(table: pd.DataFrame, path: Path) -> None:
    """Write a baseline to be committed: what is the same on every machine, lengths to 0.1 mm.

    Raises:
        OptionError: the file cannot be written.

    """
    try:
        write_atomically(path, csv_bytes(table.drop(columns=IN_STEPS).round(dict.fromkeys(LENGTHS, 5))))
    except OSError as error:
        msg = f"cannot write the counters to {path}: {error.strerror or error}"
        raise OptionError(msg) from error


def read_counters(path: Path) -> pd.DataFrame:
    """Return a committed baseline.

    Raises:
        OptionError: no such file, or not a table of counters.

    """
    try:
        table = pd.read_csv(path, compression=None)  # a packed one is no table: unpacking raises anything
        missing = [name for name in (*KEY, "status", *COUNTS, *WORK, *LENGTHS) if name not in table]
        if missing:
            msg = f"there is no column {missing[0]!r}"
            raise ValueError(msg)  # noqa: TRY301 - told as what pandas refuses
        _check_numbers(table, (*COUNTS, *WORK, *LENGTHS))
        _check_cells(table)
    except (OSError, ValueError) as error:  # also of its encoding
        msg = f"counters {path} cannot be read: {getattr(error, 'strerror', None) or error}"
        raise OptionError(msg, hint=f"--renew {'writes' if isinstance(error, OSError) else 'rewrites'} them") from error
    return table
