"""The numbers of long roads and of large studies as the texts that documents have."""

from __future__ import annotations

from typing import Any

from document_tables import table

_MILLI = 1e3


def long_road(km: int, plan: str) -> list[str]:
    """Return the largest memory of a plan of a long road [MB], and its CPU time [s/km]."""
    row = _long(km, plan)
    return [f"{row['peak_mb']:.0f}", f"{row['cpu_s_per_km']:.2f}"]


def handed_out() -> list[str]:
    """Return the driver's time for each of very many cells [ms], and its growth with tables [MB]."""
    rows = table("study-cells/study_cells.csv")
    last, end = rows.iloc[-2], rows.iloc[-1]
    spent = _MILLI * last["driver_cpu_s"] / last["cells"]
    return [f"{spent:.1f}", f"{end['mb']:.0f}"]


def _long(km: int, plan: str) -> dict[str, Any]:
    rows = table("long-roads/long_roads.csv")
    return {str(name): value for name, value in rows[(rows["km"] == km) & (rows["plan"] == plan)].iloc[0].items()}
