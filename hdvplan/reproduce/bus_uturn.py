"""[GEO] fig. 7: the bus in a U-turn, centred by its rear axle alone (previous method) and by the geometric weight."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pandas as pd

from hdvplan.case import Case
from hdvplan.reproduce import published
from hdvplan.reproduce.figures import uturn_figure
from hdvplan.reproduce.study import Progress, Row, Study
from hdvplan.reproduce.swept import Swept, swept
from hdvplan.road.scenarios import uturn
from hdvplan.vehicle.load import load_vehicle

# What other curvatures, ramps and smoothness weights do was tried: 0.057 to 0.060 1/m, 15 to 30 m, 1e2 to 1e5.
_ROAD = "the road is read off a figure: a curvature of 0.058 instead of 0.060 1/m gives 1.81 m; ramps of 15 to 30 m give 1.85 to 1.88 m"
_RIGHT = "the road is read off a figure: a curvature of 0.059 instead of 0.060 1/m gives 2.46 m"
_LEFT = "a curvature of 0.058 instead of 0.060 1/m gives 2.44 m; their 3 cm between left and right are not explained"


def bus_uturn(on_progress: Progress) -> Study:
    """Drive the bus through the U-turn with limits at +-3.0 m by both methods."""
    case = Case(uturn(), load_vehicle("bus"))
    previous = swept(replace(case, objective="lead-axle"))
    on_progress(0.5)
    proposed = swept(case)
    on_progress(1.0)
    return Study(
        "bus-uturn",
        "Bus in a U-turn",
        f"{published.GEO} fig. 7",
        "Limits at +-3.0 m, curvature up to 0.060 1/m; receding horizon (RTI), envelope of the exact simulation.",
        (previous.case, proposed.case),
        _rows(previous, proposed),
        _data(previous, proposed),
        partial(uturn_figure, previous, proposed),
    )


def _rows(previous: Swept, proposed: Swept) -> tuple[Row, ...]:
    expected = float(proposed.expected.half_width.max())
    return (
        Row("previous method, max right", "m", published.UTURN_PREVIOUS_RIGHT, float(previous.right.max()), headline=True),
        Row("previous method, max left", "m", published.UTURN_PREVIOUS_LEFT, float(previous.left.max()), _ROAD, headline=True),
        Row("proposed method, max right", "m", published.UTURN_PROPOSED_RIGHT, float(proposed.right.max()), _RIGHT, headline=True),
        Row("proposed method, max left", "m", published.UTURN_PROPOSED_LEFT, float(proposed.left.max()), _LEFT, headline=True),
        Row("geometric half width", "m", None, expected, "what the balanced circle at the largest curvature needs on either side"),
    )


def _data(previous: Swept, proposed: Swept) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "s": proposed.envelope.s,
            "previous_left": previous.left,
            "previous_right": -previous.right,
            "proposed_left": proposed.left,
            "proposed_right": -proposed.right,
            "geometric_half_width": proposed.expected.half_width,
        }
    )
