"""The chain of a route's ways: which way round each is driven, and from which of its nodes to which.

Two ways that are driven one after the other share a joint, a node of both. All joints of a route are found together, as the cheapest chain
in the order of its members (dynamic programming): first with the fewest breaks, then with the fewest ways driven against a one-way or a
role, then with as little as possible left out of the ways, then by the shorter way round circles. If a route is mapped for both directions
at once, its relation lists one branch after the other where the directions part. Ways that may be driven in one direction only can be
passed over, if the ways before and after them meet.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from hdvplan.network.osm import Places, Way, length_of

_BREAK_M = 1e9  # cost of a break, as metres left out of a way
_AGAINST_M = 1e6  # the same of driving a way against its one-way or its role,
_LEFT_OUT_M = 1e4  # of a way that is left at the node where it was entered,
_PASSED_M = 100.0  # of a way that is passed over, besides its length,
_ROUND = 1e-3  # and of a metre round a circle
_MOST_PASSED = 60  # ways that are passed over in a row
_MOST_JOINTS = 50  # nodes shared by two ways that are tried

Trail = tuple[Any, ...]  # a linked list of what was driven: (trail before, number of the member, pass), () at the start


@dataclass(frozen=True)
class Step:
    """A way of a route, and the direction in which it may be driven: 1 its own, -1 the other, 0 both; by its one-way and by its role."""

    way: Way
    one_way: int = 0
    role: int = 0

    @property
    def directed(self) -> bool:
        """Whether it may be driven in one direction only."""
        return bool(self.one_way or self.role)

    def against(self, direction: int) -> int:
        """Return how many of one-way and role are against driving in ``direction``."""
        return sum(allowed == -direction for allowed in (self.one_way, self.role))


@dataclass(frozen=True)
class Pass:
    """How a step is driven: its nodes in driven order, the direction, and what it costs."""

    step: Step
    nodes: tuple[int, ...]
    direction: int
    cost: float


Run = list[tuple[int, Pass]]  # steps that are driven one after the other without a break, with the numbers of their members


def runs_of(steps: Sequence[Step | None], places: Places) -> list[Run]:
    """Return the runs of a route's members, in order; None stands for a member that is not in the map, where every run ends."""
    beside = _beside(steps)
    free: list[tuple[float, Trail] | None] = [(0.0, ()), *(None for _ in steps)]  # before each member, where no run goes on
    going: list[dict[int | None, tuple[float, Trail]]] = [{} for _ in steps]  # at each member, by the node where it is entered
    for number, step in enumerate(steps):
        paid = free[number]
        if step is None:
            free[number + 1] = _cheaper(free[number + 1], paid)
            continue
        if paid is not None:
            going[number][None] = (paid[0] + _BREAK_M, (paid[1], number, None))
            if beside[number]:
                free[number + 1] = _cheaper(free[number + 1], (paid[0] + _passing(step, places), paid[1]))
        following = _following(steps, number, places)
        for enter, (cost, trail) in going[number].items():
            for one in _passes(step, enter, None, places):
                free[number + 1] = _cheaper(free[number + 1], (cost + one.cost, (trail, number, one)))
            for after, joint, over in following:
                for one in _passes(step, enter, joint, places):
                    state = (cost + one.cost + over, (trail, number, one))
                    going[after][joint] = _cheaper(going[after].get(joint), state)
    last = free[-1]
    return [] if last is None else _unlinked(last[1])


def _beside(steps: Sequence[Step | None]) -> list[bool]:
    """Tell which members can be passed over where no run goes on: rows of one-ways that meet another way of the route."""
    rows = [(directed, list(row)) for directed, row in groupby(steps, key=lambda step: step is not None and step.directed)]
    nodes = [{node for step in row if step is not None for node in step.way.nodes} for _, row in rows]
    shared = {node for node, count in Counter(node for of_row in nodes for node in of_row).items() if count > 1}
    return [directed and not shared.isdisjoint(own) for (directed, row), own in zip(rows, nodes, strict=True) for _ in row]


def _cheaper(known: tuple[float, Trail] | None, other: tuple[float, Trail] | None) -> Any:  # noqa: ANN401 - one of the two
    if known is None or other is None:
        return known or other
    return other if other[0] < known[0] else known


def _following(steps: Sequence[Step | None], number: int, places: Places) -> list[tuple[int, int, float]]:
    """Return the members that a member can lead to: their numbers, the joints, and what passing over those between costs."""
    step, over, found = steps[number], 0.0, []
    for after in range(number + 1, min(number + 2 + _MOST_PASSED, len(steps))):
        other = steps[after]
        if step is None or other is None:
            break
        found += [(after, joint, over) for joint in _joints(step.way, other.way)]
        if not other.directed:
            break
        over += _passing(other, places)
    return found


def _passing(step: Step, places: Places) -> float:
    return _PASSED_M + length_of(step.way.nodes, places)


def _unlinked(trail: Trail) -> list[Run]:
    runs: list[Run] = [[]]
    while trail:
        trail, number, one = trail
        if one is None:  # the start of a run
            runs.append([])
        else:
            runs[-1].append((number, one))
    return [run[::-1] for run in runs[::-1] if run]


def _joints(before: Way, after: Way) -> list[int]:
    """Return the nodes where a way may be left for another: those of both, ends first where there are many."""
    if before.id == after.id and not before.closed:
        return list(dict.fromkeys((before.nodes[-1], before.nodes[0])))
    shared = set(after.nodes) & set(before.nodes)
    ends = {before.nodes[0], before.nodes[-1], after.nodes[0], after.nodes[-1]}
    return sorted(shared, key=lambda node: (node not in ends, node))[:_MOST_JOINTS]


def _passes(step: Step, enter: int | None, leave: int | None, places: Places) -> list[Pass]:
    """Return the ways to drive a step from one of its nodes to another; None is wherever it is driven whole from, or to."""
    return _rounds(step, enter, leave, places) if step.way.closed else _along(step, enter, leave, places)


def _along(step: Step, enter: int | None, leave: int | None, places: Places) -> list[Pass]:
    nodes = step.way.nodes
    whole = length_of(nodes, places)
    starts, ends = ([0, len(nodes) - 1] if node is None else _where(nodes, node) for node in (enter, leave))
    found = []
    for start in starts:
        for end in ends:
            direction = 1 if end >= start else -1
            driven = nodes[start : end + 1] if direction > 0 else nodes[end : start + 1][::-1]
            left_out = whole - length_of(driven, places) + (_LEFT_OUT_M if start == end else _AGAINST_M * step.against(direction))
            found.append(Pass(step, driven, direction, left_out))
    return found


def _rounds(step: Step, enter: int | None, leave: int | None, places: Places) -> list[Pass]:
    """Return the two ways round a circle; entered and left at the same node, all of it."""
    ring = step.way.nodes[:-1]
    start = ring.index(enter if enter is not None else leave if leave is not None else ring[0])
    end = start if enter is None or leave is None else ring.index(leave)
    found = []
    for direction in (1, -1):
        count = (direction * (end - start) - 1) % len(ring) + 1  # segments: all where it ends where it starts
        driven = tuple(ring[(start + direction * number) % len(ring)] for number in range(count + 1))
        found.append(Pass(step, driven, direction, _ROUND * length_of(driven, places) + _AGAINST_M * step.against(direction)))
    return found


def _where(nodes: Sequence[int], node: int) -> list[int]:
    return [number for number, other in enumerate(nodes) if other == node]
