"""A driven plan as a chain of planned tracks: of the front axle, and of every unit's axle and coupling behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.driving.drive import POSE_SPACING_M, Drive
from hdvplan.road.arcs import wrapped
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.model import Vehicle

LINK = core.record("hdv_link")  # one unit over one interval: hdvplan/core/tracking.h has the fields
FINER = 5  # poses for every simulated one, where they are looked at closely
SPACING_M = POSE_SPACING_M  # of nodes on the front axle's planned track
_LEAST_M = 1e-3  # way of an axle within an interval below which its direction is that of its body
_states_between = core.function(
    "hdv_states_between", core.POINTER, core.INT, core.INT, core.POINTER, core.INT, core.POINTER, core.POINTER, core.POINTER, core.INT,
    core.POINTER, core.POINTER,
)  # fmt: skip


class Posed(NamedTuple):
    """Poses in a row, and where each is on the planned track of the lead unit's front axle."""

    s: FloatArray  # (poses,), the line's arclengths [m]
    poses: Records  # (poses, units) of ``POSE``
    front: FloatArray  # (poses,), the front axle's way until there [m]


@dataclass(frozen=True)
class Chain:
    """A drive as it was simulated, ``posed``, and its poses ``nodes`` (n, units) every SPACING_M of the front axle's track."""

    drive: Drive
    posed: Posed
    nodes: Records

    @property
    def vehicle(self) -> Vehicle:
        """What is driven."""
        return self.drive.vehicle

    @cached_property
    def links(self) -> Records:
        """The units between two nodes, to first order, (nodes - 1, units) of ``LINK``."""
        return _links(self.vehicle, self.nodes)

    def closely(self, first: int = 0, last: int = -1) -> Posed:
        """Return poses from the simulated one ``first`` to ``last``, FINER for each."""
        s, front = self.posed.s, self.posed.front
        at = np.arange(FINER * (first % len(s)), FINER * (last % len(s)) + 1) / FINER
        number = np.arange(len(s), dtype=np.float64)
        s_at = np.interp(at, number, s)
        return Posed(s_at, _posed(self.drive, s_at), np.interp(at, number, front))


def chain_of(drive: Drive) -> Chain:
    """Return the chain of a drive."""
    s, wheelbase = drive.poses_s, drive.vehicle.lead.wheelbase
    poses = place_many(drive.vehicle.table(), evaluate_many(drive.stations.path, s), drive.poses_z)
    lead = poses[:, 0]
    x, y = lead["x"] + wheelbase * lead["cos"], lead["y"] + wheelbase * lead["sin"]
    front = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    at = np.interp(SPACING_M * np.arange(int(front[-1] / SPACING_M) + 1), front, s)
    return Chain(drive, Posed(s, poses, front), _posed(drive, at))


def _posed(drive: Drive, s: FloatArray) -> Records:
    """Return where a drive's bodies were with the lead axle at arclengths ``s`` (n,), in ascending order, (n, units)."""
    units, path, states = drive.vehicle.table(), drive.stations.path, np.empty((len(s), drive.poses_z.shape[1]))
    arrays = [np.ascontiguousarray(array) for array in (drive.poses_s, drive.poses_z, drive.poses_kappa, s)]
    poses_s, z, kappa, at = (core.address(array) for array in arrays)
    _states_between(
        core.address(units), len(units), states.shape[1], core.address(path.record), len(drive.poses_s), poses_s, z, kappa, len(s), at,
        core.address(states),
    )  # fmt: skip
    return place_many(units, evaluate_many(path, s), states)


def _links(vehicle: Vehicle, nodes: Records) -> Records:
    units = vehicle.table()
    wheelbase, hitch = units["wheelbase"], units["hitch_offset"]
    heading = np.unwrap(np.arctan2(nodes["sin"], nodes["cos"]), axis=0)
    turned = np.diff(heading, axis=0)
    middle = 0.5 * (heading[1:] + heading[:-1])
    way = {
        "axle": (np.diff(nodes["x"], axis=0), np.diff(nodes["y"], axis=0)),
        "coupling": (np.diff(nodes["x"] + wheelbase * nodes["cos"], axis=0), np.diff(nodes["y"] + wheelbase * nodes["sin"], axis=0)),
    }
    links = np.zeros(middle.shape, LINK)
    course = {}
    for name, (x, y) in way.items():
        ahead = np.where(x * np.cos(middle) + y * np.sin(middle) < 0.0, -1.0, 1.0)  # an axle may roll backwards
        length = np.hypot(x, y)
        links[f"{name}_speed"] = ahead * length / SPACING_M
        off = np.where(length > _LEAST_M, wrapped(np.arctan2(ahead * y, ahead * x) - middle), 0.0)
        links[f"{name}_off"] = np.where(units["steering_ratio"] == 0.0, 0.0, off) if name == "axle" else off
        course[name] = middle + links[f"{name}_off"]
    links["course"], links["turning"] = course["coupling"], turned / SPACING_M
    bend = np.abs(np.diff(course["axle"], axis=0)) / np.maximum(np.abs(links["axle_speed"][1:]) * SPACING_M, _LEAST_M)
    links["bend"][:-1] = bend
    links["bend"][1:] = np.maximum(links["bend"][1:], bend)
    links["next_off"][:, :-1] = wrapped(course["coupling"][:, 1:] - middle[:, :-1])
    coupling, axle, behind = links["coupling_off"], links["axle_off"], links["next_off"]
    links["by_offset"] = 1.0 / (wheelbase * np.cos(coupling))
    links["by_axle"] = np.cos(coupling - axle) * links["by_offset"]
    links["next_by_axle"], links["next_by_heading"] = np.cos(behind - axle), -hitch * np.cos(behind)
    links["steered"][:, 0], links["steered"][:, 1:] = coupling[:, 0], middle[:, :-1] - middle[:, 1:]
    _add_laws(vehicle, units, links)
    return links


def _add_laws(vehicle: Vehicle, units: Records, links: Records) -> None:
    """Write how wheels follow the articulation, or the front wheels, where no stop holds them; those that the plan steers keep to it."""
    coupling, axle, behind = links["coupling_off"], links["axle_off"], links["next_off"]
    for number, unit in enumerate(vehicle.units):
        if unit.active or unit.steering_ratio == 0.0:
            continue
        own, record = links[:, number], units[number]
        slope = np.where(unit.steering_ratio * np.abs(own["steered"]) < unit.max_steering_angle, -unit.steering_ratio, 0.0)
        along_axle, along_heading = np.sin(coupling[:, number] - axle[:, number]), record["wheelbase"] * np.sin(coupling[:, number])
        if number == 0:
            own["law_by_course"] = slope
            turning = slope * np.gradient(own["course"], SPACING_M)
        else:
            ahead = links[:, number - 1]
            turning = slope * ahead["turning"] / own["coupling_speed"]
            own["law_by_ahead"] = -turning * np.sin(behind[:, number - 1] - axle[:, number - 1])
            own["law_by_turned"] = slope + turning * units[number - 1]["hitch_offset"] * np.sin(behind[:, number - 1])
        own["law_by_axle"], own["law_by_heading"] = turning * along_axle, -slope + turning * along_heading
