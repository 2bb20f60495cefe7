"""Stitch the ways of a route to lines: every way is turned so that it meets the next, and driven as far as the route follows it.

The line is cut where two ways do not meet, or a way between them is missing in the map: nothing is bridged. It is also cut where it turns
back on the spot. ``chain.py`` finds how each way is driven.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby

from hdvplan.network.chain import Pass, Run, Step, runs_of
from hdvplan.network.osm import Member, Place, Places, Way, distance, length_of, turn
from hdvplan.texts import some_of

_TURN_BACK_DEG = 150.0  # a sharper turn at one node is no bend of a road: the vehicle would have to turn on the spot
_ROLES = {"forward": 1, "backward": -1}
_NAMED = 4  # ways that a sentence names


class Trouble(StrEnum):
    """What is wrong or odd about a route as it is mapped; the line is cut at the first four."""

    MISSING = "missing"  # ways are not in the map
    GAP = "gap"  # a way does not meet the next
    ORDER = "order"  # a way does not meet the next, but another one of the route
    TURN = "turn"  # the line turns back on the spot
    OTHER = "other direction"  # ways of one direction are passed over: the route is mapped for both at once
    ONE_WAY = "one-way"  # a way is driven against its one-way
    ROLE = "role"  # a way is driven against its role, forward or backward
    LEFT_OUT = "left out"  # a way is left where it was entered, so that nothing of it is driven
    IN_PART = "in part"  # a way is entered or left at a node in it, so that some of it is not driven
    ROUND = "round"  # a circle is left where it was entered, so that it is driven once round


CUTS = frozenset({Trouble.MISSING, Trouble.GAP, Trouble.ORDER, Trouble.TURN})


@dataclass(frozen=True)
class Finding:
    """Something wrong: its kind, a sentence without capital and full stop, and where it is [deg], None where the map does not say."""

    trouble: Trouble
    text: str
    place: Place | None = None


@dataclass(frozen=True)
class Part:
    """A line of nodes without gaps, n of them, and the way that each of its n - 1 segments lies on."""

    nodes: tuple[int, ...]
    ways: tuple[Way, ...]


def stitched(
    members: Sequence[Member], ways: Mapping[int, Way], places: Places, kind: str = "bus"
) -> tuple[tuple[Part, ...], tuple[Finding, ...]]:
    """Return the lines that the driven members of a route make, in its order, and what is wrong with it.

    ``kind`` is the route's: ``oneway:bus=no`` lets buses alone drive against a one-way.
    """
    steps = [
        None if member.kind != "w" or member.ref not in ways else Step(
            ways[member.ref], one_way(ways[member.ref].tags, kind), _ROLES.get(member.role, 0)
        )
        for member in members
    ]  # fmt: skip
    runs = runs_of(steps, places)
    findings: list[Finding] = list(_passed_over(steps, runs, places))
    parts: list[Part] = []
    last = -1
    place: Place | None = None
    for run in runs:
        start, end = run[0][1].nodes[0], run[-1][1].nodes[-1]
        findings += _before(members, steps, last, run[0][0], places, places[start] if place is None else place)
        for _, one in run:
            findings += _remarks(one, places)
        line, turns = _line([one for _, one in run], places)
        parts += line
        findings += turns
        last, place = run[-1][0], places[end]
    return tuple(parts), (*findings, *_before(members, steps, last, len(members), places, place))


def one_way(tags: Mapping[str, str], kind: str = "bus") -> int:
    """Return in which direction of a way traffic of a kind runs: 1 the way's own, -1 the other, 0 both."""
    oneway = next((tags[key] for key in (f"oneway:{kind}", "oneway:psv", "oneway") if key in tags), None)
    if oneway in {"yes", "true", "1"}:
        opposite = any(tags.get(key, "").startswith("opposite") for key in ("busway", "busway:left", "busway:right"))
        return 0 if opposite else 1
    if oneway in {"-1", "reverse"}:
        return -1
    implied = tags.get("junction") in {"roundabout", "circular"} or tags.get("highway") == "motorway"
    return 1 if oneway is None and implied else 0


def _line(run: Sequence[Pass], places: Places) -> tuple[list[Part], list[Finding]]:
    """Return the line of a run, cut where it turns back, and the findings of that."""
    nodes: list[int] = [run[0].nodes[0]]
    ways: list[Way] = []
    for one in run:
        for node in one.nodes[1:]:
            if places[node] == places[nodes[-1]]:  # a line needs no point twice
                nodes[-1] = node
                continue
            nodes.append(node)
            ways.append(one.step.way)
    parts, findings, begin = [], [], 0
    for at in range(1, len(nodes) - 1):
        angle = turn(*(places[node] for node in nodes[at - 1 : at + 2]))
        if angle > _TURN_BACK_DEG:
            text = f"way {ways[at].id} continues way {ways[at - 1].id} with a turn of {angle:.0f} degrees on the spot"
            findings.append(Finding(Trouble.TURN, text, places[nodes[at]]))
            parts.append(Part(tuple(nodes[begin : at + 1]), tuple(ways[begin:at])))
            begin = at
    if len(nodes) - begin > 1:
        parts.append(Part(tuple(nodes[begin:]), tuple(ways[begin:])))
    return parts, findings


def _passed_over(steps: Sequence[Step | None], runs: Sequence[Run], places: Places) -> Iterator[Finding]:
    """Return the findings of ways that are passed over, row by row."""
    driven = {number for run in runs for number, _ in run}
    for over, group in groupby(enumerate(steps), key=lambda one: one[0] not in driven and one[1] is not None):
        row = [step.way for _, step in group if step is not None]
        if over:
            listed = some_of((str(way.id) for way in row), _NAMED)
            yield Finding(Trouble.OTHER, f"left out as part of the other direction: {_ways(len(row))} {listed}", places[row[0].nodes[0]])


def _ways(count: int) -> str:
    return "way" if count == 1 else f"{count} ways"


def _remarks(one: Pass, places: Places) -> Iterator[Finding]:
    name, place, way = f"way {one.step.way.id}", places[one.nodes[0]], one.step.way
    if len(one.nodes) == 1:
        yield Finding(Trouble.LEFT_OUT, f"the route leaves {name} where it enters it: nothing of it is driven", place)
        return
    if len(one.nodes) < len(way.nodes) and not way.closed:
        driven, whole = (length_of(nodes, places) for nodes in (one.nodes, way.nodes))
        yield Finding(
            Trouble.IN_PART, f"of {name} only {driven:.0f} of {whole:.0f} m are driven: it is not split where the route leaves it", place
        )
    if one.nodes[0] == one.nodes[-1] and way.closed:
        yield Finding(Trouble.ROUND, f"{name} is a circle that the route leaves where it enters it: it is driven once around", place)
    if one.step.one_way == -one.direction:
        yield Finding(Trouble.ONE_WAY, f"{name} is driven against its one-way direction", place)
    if one.step.role == -one.direction:
        yield Finding(Trouble.ROLE, f"{name} is driven against its role", place)


def _before(
    members: Sequence[Member], steps: Sequence[Step | None], last: int, next_: int, places: Places, place: Place | None
) -> Iterator[Finding]:
    """Return the finding of what lies between two runs, by the numbers of the members before and after; or before and after all runs.

    ``place`` is where the run before ends, or the first one begins.
    """
    before = steps[last] if last >= 0 else None
    after = steps[next_] if next_ < len(steps) else None
    missing = [member for member, step in zip(members[last + 1 : next_], steps[last + 1 : next_], strict=True) if step is None]
    if missing:
        what = f"{len(missing)} members are" if len(missing) > 1 else f"{_KINDS[missing[0].kind]} {missing[0].ref} is"
        where = " and ".join(f"{word} way {step.way.id}" for word, step in (("after", before), ("before", after)) if step is not None)
        yield Finding(Trouble.MISSING, f"{what} not in the map{', ' if where else ''}{where}", place)
    elif before is not None and after is not None:
        yield _apart(steps, last, next_, places)


_KINDS = {"w": "way", "r": "relation"}


def _apart(steps: Sequence[Step | None], before: int, after: int, places: Places) -> Finding:
    """Return the finding of two members that follow each other and do not meet."""
    first, second = _way(steps, before), _way(steps, after)
    apart, place = min(
        (distance(places[a], places[b]), places[a]) for a in (first.nodes[0], first.nodes[-1]) for b in (second.nodes[0], second.nodes[-1])
    )
    text = f"way {second.id} follows way {first.id} and does not meet it"
    for number, other in ((before, first), (after, second)):
        beside = {node for near in (number - 1, number + 1) for node in _nodes(steps, near)}
        loose = {other.nodes[0], other.nodes[-1]} - beside
        elsewhere = (at for at in range(len(steps)) if abs(at - number) > 1 and loose & _nodes(steps, at))
        meets = next((_way(steps, at).id for at in elsewhere), other.id)
        if meets != other.id:
            return Finding(Trouble.ORDER, f"{text}; way {other.id} meets way {meets}, which is elsewhere in the route", place)
    return Finding(Trouble.GAP, f"{text}: a gap of {apart:.0f} m", place)


def _way(steps: Sequence[Step | None], number: int) -> Way:
    step = steps[number]
    assert step is not None  # noqa: S101 - for the type checker: only members that are in the map are asked for
    return step.way


def _nodes(steps: Sequence[Step | None], number: int) -> set[int]:
    step = steps[number] if 0 <= number < len(steps) else None
    return set() if step is None else set(step.way.nodes)
