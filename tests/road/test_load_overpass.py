"""Answers of the Overpass API: ways and relations, with their own geometry or that of their nodes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hdvplan.errors import RoadError
from hdvplan.road.load_json import read_overpass
from hdvplan.road.options import RoadOptions

PLACES = [{"lat": 57.7, "lon": 11.95}, {"lat": 57.7, "lon": 11.951}, {"lat": 57.701, "lon": 11.952}]
WAY = {"type": "way", "id": 7, "geometry": PLACES, "tags": {"name": "Hamngatan", "region": "west", "edge": "left"}}


def read(*elements: Any, feature: str | None = None) -> Any:  # noqa: ANN401 - JSON
    return read_overpass({"elements": list(elements)}, "f", RoadOptions(feature=feature))


def test_a_way_with_its_geometry_is_a_road_with_the_attribution_of_the_map() -> None:
    raw = read(WAY)
    lon, lat = raw.to_lonlat(*raw.points.T)
    np.testing.assert_allclose(np.stack([lon, lat], axis=1), [[place["lon"], place["lat"]] for place in PLACES], atol=1e-9)
    assert raw.notice == "© OpenStreetMap contributors, ODbL 1.0"


def test_ways_are_chosen_by_name_or_id_and_may_take_their_places_from_nodes() -> None:
    nodes = [{"type": "node", "id": number, **place} for number, place in enumerate(PLACES)]
    other = {"type": "way", "id": 8, "nodes": [2, 1, 0]}
    np.testing.assert_allclose(read(WAY, other, *nodes, feature="8").points, read(WAY, other, feature="Hamngatan").points[::-1])
    with pytest.raises(RoadError, match="2 lines, and none is chosen: 'Hamngatan', '8'"):
        read(WAY, other, *nodes)


def test_a_relation_joins_its_ways_without_its_platforms() -> None:
    first, second = {"type": "way", "geometry": PLACES[:2], "role": ""}, {"type": "way", "geometry": PLACES[1:], "role": ""}
    platform = {"type": "way", "geometry": [{"lat": 57.6, "lon": 11.9}, {"lat": 57.6, "lon": 11.91}], "role": "platform"}
    relation = {"type": "relation", "id": 1, "members": [first, platform, second, {"type": "node", "ref": 3, "role": "stop"}]}
    assert len(read(relation).points) == 4


@pytest.mark.parametrize("elements", [[], [{"type": "way", "id": 1, "nodes": [1, 2]}], [5, {"type": "relation", "members": 3}]])
def test_an_answer_without_geometry_says_how_to_ask_for_it(elements: list[Any]) -> None:
    with pytest.raises(RoadError, match="no way with a geometry") as caught:
        read(*elements)
    assert "out geom" in str(caught.value.hint)


def test_nodes_and_roles_that_are_lists_are_no_nodes_and_no_roles() -> None:
    node: dict[str, Any] = {"type": "node", "id": [7], "lon": 12.0, "lat": 57.0}
    way = {"type": "way", "id": 1, "nodes": [[7], [7]]}
    relation = {"type": "relation", "id": 2, "members": [{"type": "way", "role": ["stop"], "nodes": [[7]]}]}
    with pytest.raises(RoadError, match="no way with a geometry among 4 elements"):
        read_overpass({"elements": [node, {**node, "id": 8}, way, relation]}, "road")
