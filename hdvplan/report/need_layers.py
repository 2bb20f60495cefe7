"""What pictures and drawings of a need show: the plan that decides it, and where the road must be widened for it."""

from __future__ import annotations

from dataclasses import replace

from hdvplan.judging.result import Result
from hdvplan.need.answer import Need
from hdvplan.need.search import on_road
from hdvplan.need.widening import Patch, Widening
from hdvplan.report.layers import Drawn, Layer, Value, drawn_features


def shown_plan(need: Need) -> tuple[Result, tuple[Patch, ...]] | None:
    """Return the plan to draw, and where the road is widened for it; None where no plan was found."""
    widened, road = need.widenings, need.case.road
    if widened is not None and widened.area is not None:
        return widened.area.result, widened.area.patches
    if widened is not None and widened.fitting is not None:
        return widened.fitting, ()
    best = need.room.result or (None if need.held is None else need.held.result)
    if best is None:
        return None
    return on_road(best, replace(road, limits=None, drawn=None, regions=(), faces=None)), ()


def need_features(need: Need, shown: Result) -> tuple[Drawn, ...]:
    """Return all features of a need's drawing: those of the plan ``shown`` on the road as it is, and the areas to be widened.

    Where these are known, what the plan sweeps beyond the road's limits is left out: it is the same with less around it.
    """
    widened = need.widenings
    areas = () if widened is None or widened.area is None else _areas(widened.area, Layer.WIDENING)
    depths = () if widened is None or widened.depth is None else _areas(widened.depth, Layer.WIDENING_LEAST_DEPTH)
    plan = drawn_features(shown)
    return (*(feature for feature in plan if not areas or feature.layer is not Layer.CONFLICTS), *areas, *depths)


def _areas(widening: Widening, layer: Layer) -> tuple[Drawn, ...]:
    found = []
    for patch in widening.patches:
        area = float(patch.polygon.area)
        properties: dict[str, Value] = {
            "depth_m": patch.depth,
            "area_m2": area,
            "s_m": patch.s_deepest,
            "s_from_m": patch.s_from,
            "s_to_m": patch.s_to,
            "side": patch.side,
            "region": patch.region,
            "fits_then": 1,
        }
        found.append(Drawn(layer, patch.polygon, properties, f"{patch.side}: {area:.1f} m2, {patch.depth:.2f} m deep"))
    return tuple(found)
