"""The numbers of long roads and of large studies as the texts that documents have."""

from __future__ import annotations

from typing import Any

from document_tables import table

RUN_INS_M = (10, 20, 40, 60, 80, 100, 150)
_MILLI = 1e3


def forgotten() -> list[str]:
    """Return how far a bus's plan is from one that began this far before it, at most [m]."""
    rows = table("long-roads/forgetting.csv")
    most = rows[rows["vehicle"] == "bus"].set_index("run_in_m")["max_m"]
    return [_power(most[run_in]) for run_in in RUN_INS_M]


def long_road(km: int, plan: str) -> list[str]:
    """Return the largest memory of a plan of a long road [MB], and its CPU time [s/km]."""
    row = _long(km, plan)
    return [f"{row['peak_mb']:.0f}", f"{row['cpu_s_per_km']:.2f}"]


def joints() -> list[str]:
    """Return in how many stretches the longest road was planned, and how far they lie apart where they meet [m]."""
    row = _long(1000, "stretches")
    return [str(row["stretches"]), _power(row["stretches_apart_mm"] / _MILLI)]


def handed_out() -> list[str]:
    """Return the driver's time for each of very many cells [ms], and its growth with tables [MB]."""
    rows = table("study-cells/study_cells.csv")
    last, end = rows.iloc[-2], rows.iloc[-1]
    spent = _MILLI * last["driver_cpu_s"] / last["cells"]
    return [f"{spent:.1f}", f"{end['mb']:.0f}"]


def planned_in_stretches() -> list[str]:
    """Return the processor time [s/km] and the memory [MB] of 100 km in stretches."""
    memory, seconds = long_road(100, "stretches")
    return [seconds, memory]


def _long(km: int, plan: str) -> dict[str, Any]:
    rows = table("long-roads/long_roads.csv")
    return {str(name): value for name, value in rows[(rows["km"] == km) & (rows["plan"] == plan)].iloc[0].items()}


def _power(value: float) -> str:
    """Return a number to one digit, such as 7e-3."""
    return f"{value:.0e}".replace("e-0", "e-")
