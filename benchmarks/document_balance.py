"""The numbers of the study of the balanced objective as the texts that documents have."""

from __future__ import annotations

from document_tables import table

ROUNDED, SQUARES = 0.05, 1000.0  # up to which imbalance the objective is quadratic [m]


def balance_row(vehicle: str, objective: str) -> list[str]:
    """Return one row of the study of the balance: imbalance [m], gains [%], growth of the reach [%] and of the curvature."""
    rows = table("balanced/summary.csv")
    row = rows[(rows["vehicle"] == vehicle) & (rows["objective"] == objective)].iloc[0]
    forms = {"gain_percent": "{:.1f}", "least_gain_percent": "{:.1f}", "furthest_mean_percent": "{:.1f}", "furthest_most_percent": "{:.1f}"}
    forms |= {"squared_changes_ratio": "{:.2f}", "max_kappa_ratio": "{:.2f}"}
    return [f"{row['mean_abs_imbalance_m']:.2g}"] + [form.format(row[name]) for name, form in forms.items()]


def balance_time(vehicle: str, limits: str) -> list[str]:
    """Return the time of a step with the geometric objective and with the balance [ms], and the factor."""
    rows = table("balanced/step-times.csv")
    row = rows[(rows["vehicle"] == vehicle) & (rows["limits"] == limits)].iloc[0]
    return [f"{row['geometric_ms']:.3f}", f"{row['balanced_ms']:.3f}", f"{row['ratio']:.2f}"]


def balance_more() -> list[str]:
    """Return the least and the most that the balance adds to a step [us]."""
    rows = table("balanced/step-times.csv")
    more = 1e3 * (rows["balanced_ms"] - rows["geometric_ms"])
    return [f"{more.min():.0f}", f"{more.max():.0f}"]


def worst_imbalance() -> str:
    """Return the largest imbalance of a place with the geometric weight [m]."""
    rows = table("balanced/summary.csv")
    return f"{rows[rows['objective'] == 'geometric']['max_abs_imbalance_m'].max():.1f}"


def relaxed() -> list[str]:
    """Return the mean imbalance to which the relaxed and the plain step of the bus converge [mm]."""
    rows = table("balanced/convergence.csv")
    rows = rows[(rows["vehicle"] == "bus") & (rows["rounds"] == rows["rounds"].max())]
    last = dict(zip(rows["rule"], rows["mean_abs_imbalance_m"], strict=True))
    return [f"{1e3 * last[f'balanced, step x {step}']:.1f}" for step in ("1.33", "1.00")]


def trade_offs(*settings: tuple[float, float]) -> list[str]:
    """Return for rounding [m] and share of the stationary residual the tractor-trailer's gain and how much further it reaches [%]."""
    rows, texts = table("balanced/trade-off.csv"), []
    for rounding, share in settings:
        found = (rows["vehicle"] == "tractor-trailer") & (rows["rounding_m"] == rounding) & (rows["share"] == share)
        row = rows[found].iloc[0]
        texts += [f"{row['gain_percent']:.1f}", f"{row['furthest_most_percent']:.1f}"]
    return texts


def trailer_peaks() -> list[str]:
    """Return how many times as high the tractor-trailer's curvature is in gentle transitions, least and most, and in sharp ones, most."""
    gentle, sharp = _peaks("tractor-trailer", 0.005), _peaks("tractor-trailer", 0.02)
    return [f"{factor:.2f}" for factor in (min(gentle), max(gentle), max(sharp))]


def bus_peaks() -> list[str]:
    """Return how many times as high the bus's curvature is, least and most."""
    peaks = [factor for sharpness in (0.005, 0.01, 0.02) for factor in _peaks("bus", sharpness)]
    return [f"{factor:.2f}" for factor in (min(peaks), max(peaks))]


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


def _peaks(vehicle: str, sharpness: float) -> list[float]:
    """Return how many times as high as with the geometric weight the curvature is, on each S-turn of a sharpness [1/m^2]."""
    rows = table("balanced/s-turns.csv")
    rows = rows[(rows["vehicle"] == vehicle) & (rows["sharpness"] == sharpness)].sort_values("curvature")
    ours, geometric = (rows[rows["objective"] == objective]["max_kappa_per_m"] for objective in ("balanced", "geometric"))
    return [high / low for high, low in zip(ours, geometric, strict=True)]


def _gains_on_roads(vehicle: str) -> dict[str, float]:
    rows = table("balanced/roads.csv")
    rows = rows[rows["vehicle"] == vehicle]
    return dict(zip(rows["road"], rows["gain_percent"], strict=True))
