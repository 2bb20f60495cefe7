"""The numbers of long roads and of large studies as the texts that documents have."""

from __future__ import annotations

from typing import Any

from document_tables import table

RUN_INS_M = (10, 20, 40, 60, 80, 100, 150)
_MILLI, _HOUR_S = 1e3, 3600.0
_CONTINENT_ROADS, _CONTINENT_KM, _CELLS_A_ROAD = 1e6, 1e7, 24


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
    """Return the driver's time for each of very many cells [ms], its growth without and with tables [MB], and the overhead [ms]."""
    rows = table("study-cells/study_cells.csv")
    last, end = rows.iloc[-2], rows.iloc[-1]
    spent = _MILLI * last["driver_cpu_s"] / last["cells"]
    return [f"{spent:.1f}", f"{last['mb']:.0f}", f"{end['mb']:.0f}", f"{end['overhead_ms_per_cell']:.1f}"]


def planned_in_stretches() -> list[str]:
    """Return the processor time [s/km] and the memory [MB] of 100 km in stretches."""
    memory, seconds = long_road(100, "stretches")
    return [seconds, memory]


def continent() -> list[str]:
    """Return how many core hours the plans of a very large study take at least, and how many hours the process that hands them out."""
    rows = table("study-cells/study_cells.csv")
    plans = _CONTINENT_KM * _CELLS_A_ROAD * _long(100, "stretches")["cpu_s_per_km"] / _HOUR_S
    last = rows.iloc[-2]
    handing = _CONTINENT_ROADS * _CELLS_A_ROAD * last["driver_cpu_s"] / last["cells"] / _HOUR_S
    return [f"{round(plans, -3):,.0f}", f"{handing:.0f}"]


def _long(km: int, plan: str) -> dict[str, Any]:
    rows = table("long-roads/long_roads.csv")
    return {str(name): value for name, value in rows[(rows["km"] == km) & (rows["plan"] == plan)].iloc[0].items()}


def _power(value: float) -> str:
    """Return a number to one digit, such as 7e-3."""
    return f"{value:.0e}".replace("e-0", "e-")
