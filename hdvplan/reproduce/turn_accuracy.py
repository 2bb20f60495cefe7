"""How far the swept envelope of a turn is from exact as its poses get coarser."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.reproduce.figures import accuracy_figure
from hdvplan.reproduce.published import AUTOTURN_MM
from hdvplan.reproduce.study import Progress, Row, Study
from hdvplan.turning.follow import Followed, follow
from hdvplan.turning.swept import Band, band_of
from hdvplan.turning.templates import load_template
from hdvplan.vehicle.load import load_vehicle

SPACINGS_M = (0.05, 0.1, 0.25, 0.5, 1.0)
_EXACT_M = 0.0125  # between the poses of the reference
_VEHICLES = ("CITY-BUS", "WB-62")
_STATED = "AutoTURN states 2 to 3 mm at 0.1 m; how it joins its poses is not said"
_PLAN = "the spacing at which `hdvplan plan` measures"


def turn_accuracy(on_progress: Progress) -> Study:
    """Measure the envelope of AASHTO's minimum turns with poses further and further apart, joined and as outlines alone."""
    rows, data = [], []
    for number, name in enumerate(_VEHICLES, start=1):
        vehicle, template = load_vehicle(name), load_template("aashto-180")
        manoeuvre = template.manoeuvre(vehicle)
        exact = follow(vehicle, manoeuvre, spacing=_EXACT_M)
        reference = band_of(exact)
        for spacing in SPACINGS_M:
            driven = follow(vehicle, manoeuvre, spacing=spacing)
            joined, outlines = (_error_mm(reference, band_of(driven, joined=joined), exact) for joined in (True, False))
            data.append({"vehicle": name, "spacing_m": spacing, "joined_mm": joined, "outlines_mm": outlines})
            stated = AUTOTURN_MM if spacing == 0.1 else None  # noqa: PLR2004 - its spacing
            remark = _STATED if stated else _PLAN if spacing == 0.25 else ""  # noqa: PLR2004 - the plan's
            rows.append(Row(f"{name}: every {spacing:g} m, joined", "mm", stated, joined, remark, headline=stated is not None))
            rows.append(Row(f"{name}: every {spacing:g} m, outlines alone", "mm", None, outlines))
        on_progress(number / len(_VEHICLES))
    table = pd.DataFrame(data)
    return Study(
        "turn-accuracy",
        "Accuracy of the swept envelope",
        "AutoTURN: helpdesk.transoftsolutions.com, article 31417619910291",
        "Largest difference of either edge of the swept band, over the turn, from poses "
        f"every {1e3 * _EXACT_M:g} mm; AASHTO's half turn, outline points 0.1 m apart. The motion itself is integrated in steps "
        "of 12.5 mm throughout, exact to 1e-10 rad.",
        (),
        tuple(rows),
        table,
        partial(accuracy_figure, table),
    )


def _error_mm(reference: Band, coarse: Band, driven: Followed) -> float:
    """Return the largest difference of the edges of two bands over the turn itself [mm]."""
    stations = reference.t[(reference.t >= 0.0) & (reference.t <= driven.manoeuvre.radius * driven.angle)]

    def at(band: Band, edge: FloatArray) -> FloatArray:
        return np.interp(stations, band.t, edge)

    inner = np.abs(at(coarse, coarse.inner) - at(reference, reference.inner))
    outer = np.abs(at(coarse, coarse.outer) - at(reference, reference.outer))
    return 1e3 * float(max(inner.max(), outer.max()))
