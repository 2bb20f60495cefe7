"""The numbers of README and docs, each taken from the tables in results as the text that a document has."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from hdvplan.reproduce import STUDIES
from hdvplan.reproduce.study import STATUSES

ROOT = Path(__file__).parents[1]
_MILLI = 1e3
_SAME_M = 1e-4  # an exact program that breaks limits by less sees what the planner sees
COMPETITORS = ("hpipm", "acados", "piqp")  # in README's order
UTURN, SIDES = ("proposed method, max right", "proposed method, max left"), ("max left", "max right")


def table(name: str) -> pd.DataFrame:
    """Return a table of results."""
    return pd.read_csv(ROOT / "results" / name)


def counted(*numbers: float) -> list[str]:
    """Return whole numbers as texts."""
    return [str(int(number)) for number in numbers]


def paper(study: str, quantity: str) -> tuple[float, float]:
    """Return the published value of a quantity, and ours."""
    rows = table("paper/summary.csv")
    row = rows[(rows["study"] == study) & (rows["quantity"] == quantity)].iloc[0]
    return float(row["published"]), float(row["ours"])


def pairs(study: str, quantities: Sequence[str]) -> list[str]:
    """Return the published values of quantities, then ours."""
    both = [paper(study, quantity) for quantity in quantities]
    return [f"{published:.2f}" for published, _ in both] + [f"{ours:.2f}" for _, ours in both]


def step(vehicle: str, scheme: str, solver: str, column: str = "fastest_mean_ms") -> float:
    """Return a number of the headline table."""
    rows = table("headline/summary.csv")
    return float(rows[(rows["vehicle"] == vehicle) & (rows["scheme"] == scheme) & (rows["solver"] == solver)].iloc[0][column])


def headline(solver: str) -> list[str]:
    """Return a solver's row of the headline table [ms]."""
    texts = []
    for vehicle in ("bus", "tractor-trailer"):
        for scheme in ("rti", "sqp"):
            mean, most = (step(vehicle, scheme, solver, f"fastest_{which}_ms") for which in ("mean", "max"))
            texts += [f"{mean:.3g}", f"{most:.2g}" if most < 100.0 else f"{most:.0f}"]  # noqa: PLR2004 - no exponents
    return texts


def readme_speed() -> list[str]:
    """Return the planning step of both vehicles [ms], and how many times as long it takes with HPIPM, acados and PIQP."""
    own, *others = ([step(vehicle, "rti", solver) for vehicle in ("bus", "tractor-trailer")] for solver in ("riccati", *COMPETITORS))
    return [f"{value:.2f}" for value in own] + [f"{theirs / ours:.0f}" for other in others for theirs, ours in zip(other, own, strict=True)]


def followers() -> list[str]:
    """Return the least and the largest E and l that drivers made on a road, then controllers [m]."""
    rows, texts = table("loop/loop.csv"), []
    human = rows["follower"] == "driver"
    for own in (rows[human], rows[~human]):
        texts += [f"{value:.{digits}f}" for of, digits in (("error_m", 2), ("length_m", 1)) for value in (own[of].min(), own[of].max())]
    return texts


def loops_judged() -> list[str]:
    """Return how many widest runs were judged, how many of them kept to their bound, and how many of these the street."""
    rows = table("loop/loop.csv")
    held = rows["error_widest_m"] <= rows["allowed_m"]
    return counted(len(rows), held.sum(), (held & (rows["spare_driven_m"] >= 0.0)).sum())


def least_room() -> list[str]:
    """Return how many cases fit within 1 cm more than needed, of how many, and how many plans do within 2 cm less, of how many."""
    rows = table("need/need.csv")
    fits = rows["fits_1_cm_wider"].astype(str) == "True"
    return counted(fits.sum(), len(rows), rows["fitting_2_cm_narrower"].sum(), rows["tried_2_cm_narrower"].sum())


def spread(solver: str) -> list[str]:
    """Return the least and the largest factor of a solver's QP over the fastest one's, strict and at equal accuracy."""
    texts = []
    for regime in ("strict", "accuracy"):
        rows = table(f"solvers/{regime}/summary.csv")
        ratio = rows[rows["solver"] == solver]["ratio"]
        texts += [f"{ratio.min():.2g}", f"{ratio.max():.2g}" if ratio.max() < 100.0 else f"{ratio.max():.0f}"]  # noqa: PLR2004 - no exponents
    return texts


def solvers() -> str:
    """Return how many solvers were measured on the same QPs."""
    return str(table("solvers/strict/summary.csv")["solver"].nunique())


_WEIGHED = ("tractor-trailer-24m", "tractor-trailer")


def weights() -> list[str]:
    """Return the best weights of two vehicles, as searched and as published, then those that geometry gives."""
    searched = [f"{paper('objectives', f'{vehicle}: K by search')[1]:.2f}" for vehicle in _WEIGHED]
    return searched + [f"{paper('objectives', f'{vehicle}: K geometric')[1]:.3f}" for vehicle in _WEIGHED]


def all_weights() -> list[str]:
    """Return the published weights, then ``weights``."""
    return [f"{paper('objectives', f'{vehicle}: K by search')[0]:.2f}" for vehicle in _WEIGHED] + weights()


def gains() -> list[str]:
    """Return how much a varying weight gains over a fixed one, for both vehicles, then the published values [%]."""
    both = [paper("s-turns", f"{vehicle}: gain in absolute D, most") for vehicle in ("bus", "tractor-trailer")]
    return [f"{ours:.0f}" for _, ours in both] + [f"{published:.0f}" for published, _ in both]


def kept(vehicle: str) -> str:
    """Return in how many of the runs of several widths a vehicle keeps all limits."""
    rows = table("widths/widths.csv")
    return str(int(((rows["vehicle"] == vehicle) & (rows["verdict"] == "kept")).sum()))


def vans(apart: float) -> list[str]:
    """Return the least and the largest factor that parked vans cost a step, this far apart [m]."""
    rows = table("obstacles/obstacles.csv")
    ratio = rows[rows["apart_m"] == apart]["ratio"]
    return [f"{ratio.min():.1f}", f"{ratio.max():.1f}"]


def schemes() -> list[str]:
    """Return how many times as long SQP takes as RTI, for both vehicles, and how far their envelopes differ at most [mm]."""
    rows = table("roads/schemes.csv")
    rows = rows[rows["solver"] == "riccati"]
    means = rows.groupby("vehicle")[["rti_mean_ms", "sqp_mean_ms"]].sum()
    ratio = means["sqp_mean_ms"] / means["rti_mean_ms"]
    return [f"{ratio[vehicle]:.1f}" for vehicle in ("bus", "tractor-trailer")] + [f"{_MILLI * rows['envelope_difference_m'].max():.2f}"]


def peers() -> list[str]:
    """Return the least and largest factor of the exact programs' time, and how far their optima are off where they keep all limits [m]."""
    rows = table("peers/peers.csv")
    ratio, differs = rows[["ipopt_ratio", "fatrop_ratio"]].to_numpy(), rows[["ipopt_differs_m", "fatrop_differs_m"]].max(axis=1)
    return [f"{ratio.min():.0f}", f"{ratio.max():.0f}", f"{differs[rows['ipopt_cuts_m'] < _SAME_M].max():.0e}"]


def proved(vehicle: str) -> list[str]:
    """Return how many of a vehicle's NO are proved, and of how many."""
    rows = table("proof/widths.csv")
    no = rows[(rows["vehicle"] == vehicle) & (rows["fits"].astype(str) == "False")]
    return counted(no["kind"].notna().sum(), len(no))


def proofs() -> list[str]:
    """Return of the bus how many are proved of how many, of the tractor-trailer too."""
    return proved("bus") + proved("tractor-trailer")


def gaps() -> list[str]:
    """Return the median of what lies between the least room planned and the most proved too little, of both vehicles [m]."""
    rows = table("proof/need.csv")
    medians = (rows["half_width"] - rows["proved_below"]).groupby(rows["vehicle"]).median()
    return [f"{medians[vehicle]:.2f}" for vehicle in ("bus", "tractor-trailer")]


def proof_seconds() -> list[str]:
    """Return the mean processor time of an examination, of both vehicles [s]."""
    means = table("proof/widths.csv").groupby("vehicle")["proof_cpu_s"].mean()
    return [f"{means[vehicle]:.1f}" for vehicle in ("bus", "tractor-trailer")]


def contradictions() -> str:
    """Return in a word how many runs are planned within their limits and called impossible."""
    rows = table("proof/widths.csv")
    return _or_none(((rows["fits"].astype(str) == "True") & rows["kind"].notna()).sum())


def drawn() -> list[str]:
    """Return of the random cases how many there are, how many are called impossible, and of the narrower ones how many are, of how many."""
    rows = table("proof/random/random.csv")
    rows = rows[rows["way"].notna()]
    controls = rows["narrower_proved"].dropna().astype(str)
    return [str(len(rows)), _or_none(rows["proof"].notna().sum()), *counted((controls == "True").sum(), len(controls))]


def _or_none(number: int) -> str:
    return str(number) if number else "none"


def published() -> list[str]:
    """Return how many numbers are published, and how many of them are of each status."""
    status = pd.concat([table(f"paper/{study}.csv")["status"] for study in STUDIES]).dropna()
    return counted(len(status), *((status == one).sum() for one in STATUSES))


def uturn_and_roundabout() -> list[str]:
    """Return of both studies ours, then the published values."""
    texts = []
    for study, quantities in (("bus-uturn", UTURN), ("roundabout", SIDES)):
        both = pairs(study, quantities)
        texts += both[2:] + both[:2]
    return texts


def liechtenstein(vehicle: str) -> list[str]:
    """Return for each width how many routes a bus can drive, and its share of their length in per cent."""
    rows = table("liechtenstein/shares.csv")
    rows = rows[rows["vehicle"] == vehicle]
    shares = 100.0 * rows["km"] / rows["of_km"]
    return [text for routes, share in zip(rows["routes"], shares, strict=True) for text in (str(routes), f"{share:.0f}")]


def extracted() -> list[str]:
    """Return the number of roads, and their length [km]."""
    first = table("liechtenstein/shares.csv").iloc[0]
    return [str(first["of_roads"]), f"{first['of_km']:.0f}"]


def narrow() -> list[str]:
    """Return how many places keep a bus out at the least and at the largest width."""
    counts = table("liechtenstein/ranking.csv")["half_width_m"].value_counts().sort_index()
    return counted(counts.iloc[0], counts.iloc[-1])


def whole_routes() -> str:
    """Return how many routes are extracted without a gap."""
    return str((table("liechtenstein/lines.csv")["whole"] == "yes").sum())


def kills() -> str:
    """Return how often the study was killed."""
    return str(len(table("liechtenstein/kills.csv")))


def checked() -> list[str]:
    """Return how many cells were planned again, by how much they differ at most [m], and how many are proved."""
    rows = table("liechtenstein/checked.csv")
    apart = (rows["spare_m"] - rows["study_spare_m"]).abs().max()
    return [str(len(rows)), f"{apart:.2g}", str(int(rows["proved_from_m"].notna().sum()))]


def gate() -> list[str]:
    """Return how many comparisons of the toy program with itself were red, of how many, and the same of changes for the worse."""
    rows = table("gate/gate.csv")
    sides = (rows[rows["program"] == "the same"], rows[rows["program"] != "the same"])
    return counted(*(side[column].sum() for side in sides for column in ("regressed", "comparisons")))


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
    return [*counted((ratio < 1.0).sum(), len(ratio)), f"{100.0 * (ratio.max() - 1.0):.1f}"]


def _gains_on_roads(vehicle: str) -> dict[str, float]:
    rows = table("balanced/roads.csv")
    rows = rows[rows["vehicle"] == vehicle]
    return dict(zip(rows["road"], rows["gain_percent"], strict=True))


def long_road(km: int, plan: str) -> list[str]:
    """Return the largest memory of a plan of a long road [MB], and its CPU time [s/km]."""
    rows = table("long-roads/long_roads.csv")
    row = rows[(rows["km"] == km) & (rows["plan"] == plan)].iloc[0]
    return [f"{row['peak_mb']:.0f}", f"{row['cpu_s_per_km']:.2f}"]
