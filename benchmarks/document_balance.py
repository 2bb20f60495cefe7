"""The numbers of the study of the balanced objective as the texts that documents have."""

from __future__ import annotations

from document_tables import table


def balance_row(vehicle: str, objective: str) -> list[str]:
    """Return one row of the study of the balance: imbalance [m], gains [%], growth of the reach [%] and of the curvature."""
    rows = table("balanced/summary.csv")
    row = rows[(rows["vehicle"] == vehicle) & (rows["objective"] == objective)].iloc[0]
    forms = {"gain_percent": "{:.1f}", "least_gain_percent": "{:.1f}", "furthest_mean_percent": "{:.1f}", "furthest_most_percent": "{:.1f}"}
    forms |= {"squared_changes_ratio": "{:.2f}", "max_kappa_ratio": "{:.2f}"}
    return [f"{row['mean_abs_imbalance_m']:.2g}"] + [form.format(row[name]) for name, form in forms.items()]


def worst_imbalance() -> str:
    """Return the largest imbalance of a place with the geometric weight [m]."""
    rows = table("balanced/summary.csv")
    return f"{rows[rows['objective'] == 'geometric']['max_abs_imbalance_m'].max():.1f}"


def trailer_gains() -> list[str]:
    """Return the least and the largest gain of the tractor-trailer on real roads [%]."""
    gains = _gains_on_roads("tractor-trailer").values()
    return [f"{gain:.0f}" for gain in (min(gains), max(gains))]


def bus_gains() -> list[str]:
    """Return the least and the largest gain of the bus on the roads where its steering suffices, then those of the other two [%]."""
    gains = _gains_on_roads("bus")
    tight = [gains.pop(road) for road in ("liechtenstein_planken", "monaco_fairmont_hairpin")]
    return [f"{gain:.0f}" for gain in (min(gains.values()), max(gains.values()), *tight)]


def reaches() -> list[str]:
    """Return in how many drives on real roads the largest reach falls, of how many, and by how much it grows at most [%]."""
    rows = table("balanced/roads.csv")
    ratio = rows["furthest_balanced_m"] / rows["furthest_geometric_m"]
    return [str(int((ratio < 1.0).sum())), str(len(ratio)), f"{100.0 * (ratio.max() - 1.0):.1f}"]


def _gains_on_roads(vehicle: str) -> dict[str, float]:
    rows = table("balanced/roads.csv")
    rows = rows[rows["vehicle"] == vehicle]
    return dict(zip(rows["road"], rows["gain_percent"], strict=True))
