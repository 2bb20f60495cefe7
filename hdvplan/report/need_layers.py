"""What pictures and drawings of a need show: the plan that decides it, and where the road must be widened for it."""

from __future__ import annotations

from dataclasses import replace

from hdvplan.judging.result import Result, result_of
from hdvplan.need.answer import Need
from hdvplan.need.widening import Widening
from hdvplan.report.layers import Drawn, Layer, Value, drawn_features
from hdvplan.report.needs import Patch, patches_of
from hdvplan.road.road import Road


def shown_plan(need: Need) -> tuple[Result, tuple[Patch, ...]] | None:
    """Return the plan to draw, on the road that is asked about, and where that road is widened; None where no plan was found."""
    widened, road = need.widenings, need.case.road
    widening, own = None if widened is None else widened.area, road.own_limits
    if widening is not None and widening.result is not None and own is not None:
        return _on(widening.result, road), patches_of(widening, own, road.path)
    if widened is not None and widened.fitting is not None:
        return widened.fitting, ()
    best = need.room.result or (None if need.held is None else need.held.result)
    if best is None:
        return None
    return _on(best, replace(road, limits=None, band=None, edges=None, regions=())), ()


def _on(result: Result, road: Road) -> Result:
    """Return the same drive judged on another road of the same line."""
    return result_of(replace(result.drive, road=road), solver=result.solver, objective=result.objective)


def need_features(need: Need, shown: Result) -> tuple[Drawn, ...]:
    """Return all features of a need's drawing: those of the plan ``shown`` on the road as it is, and the areas to be widened.

    Where these are known, what the plan sweeps beyond the road's limits is left out: it is the same with less around it.
    """
    widened = need.widenings
    areas = () if widened is None or widened.area is None else _areas(need, widened.area, Layer.WIDENING)
    depths = () if widened is None or widened.depth is None else _areas(need, widened.depth, Layer.WIDENING_LEAST_DEPTH)
    plan = drawn_features(shown)
    return (*(feature for feature in plan if not areas or feature.layer is not Layer.CONFLICTS), *areas, *depths)


def _areas(need: Need, widening: Widening, layer: Layer) -> tuple[Drawn, ...]:
    road = need.case.road
    assert road.own_limits is not None  # noqa: S101 - there is a widening
    found = []
    for patch in patches_of(widening, road.own_limits, road.path):
        area = float(patch.polygon.area)
        properties: dict[str, Value] = {
            "depth_m": patch.depth,
            "area_m2": area,
            "s_m": patch.s_deepest,
            "s_from_m": patch.s_from,
            "s_to_m": patch.s_to,
            "side": patch.side,
            "region": patch.region,
            "fits_then": int(widening.result is not None),
        }
        found.append(Drawn(layer, patch.polygon, properties, f"{patch.side}: {area:.1f} m2, {patch.depth:.2f} m deep"))
    return tuple(found)
