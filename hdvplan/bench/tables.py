"""What both rooms read of a run's tables: how drives ended, the columns that name cells, and the files themselves."""

from __future__ import annotations

import gzip
from io import BytesIO
from pathlib import Path

import pandas as pd

from hdvplan.fileio import refuse_endless

OK, FAILED, OVER_BUDGET = "ok", "failed", "over budget"
UNRECORDED = "nothing recorded"  # of a sample: the reference cannot drive the course, whatever the solver
UNFAIR = "unfair"  # right or not: it waits, changes clocks or remembers answers
CRASHED, HUNG, OUT_OF_MEMORY = "crashed", "out of time", "out of memory"
WRONG, WRONG_PATH = "wrong optimum", "wrong path"
LOST = frozenset({FAILED, CRASHED, HUNG, OUT_OF_MEMORY, WRONG, WRONG_PATH})  # no plan that is right, which is no matter of a budget
_LARGEST = 1_000_000_000  # bytes of an unpacked table: ten million planning steps


def read_plain(path: Path) -> pd.DataFrame:
    """Return a table that was written as CSV, packed by gzip or not.

    Raises:
        OSError: it cannot be read, or is too large.
        EOFError: it is cut off.
        ValueError: it is no table, or unpacks to too much.
        zlib.error: it is damaged.

    """
    refuse_endless(path)
    if path.suffix != ".gz":
        return pd.read_csv(path)
    with gzip.open(path) as file:
        content = file.read(_LARGEST + 1)  # a megabyte can be a gigabyte of nothing
    if len(content) > _LARGEST:
        msg = f"it unpacks to more than {_LARGEST / 1e6:.0f} MB"
        raise ValueError(msg)
    return pd.read_csv(BytesIO(content))
