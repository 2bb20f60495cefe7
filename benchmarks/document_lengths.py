"""The numbers of long roads as the texts that documents have."""

from __future__ import annotations

from typing import Any

from document_tables import table


def long_road(km: int, plan: str) -> list[str]:
    """Return the largest memory of a plan of a long road [MB], and its CPU time [s/km]."""
    row = _long(km, plan)
    return [f"{row['peak_mb']:.0f}", f"{row['cpu_s_per_km']:.2f}"]


def _long(km: int, plan: str) -> dict[str, Any]:
    rows = table("long-roads/long_roads.csv")
    return {str(name): value for name, value in rows[(rows["km"] == km) & (rows["plan"] == plan)].iloc[0].items()}
