"""A driven plan as a chain of planned tracks: of the front axle, and of every unit's axle and coupling behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.driving.drive import POSE_SPACING_M, Drive, simulate
from hdvplan.road.arcs import wrapped
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.model import Vehicle

LINK = core.record("hdv_link")  # one unit over one interval: hdvplan/core/tracking.h has the fields
FINER = 5  # poses for every simulated one that is kept
SPACING_M = POSE_SPACING_M  # of nodes on the front axle's planned track
_LEAST_M = 1e-3  # way of an axle within an interval below which its direction is that of its body


@dataclass(frozen=True)
class Chain:
    """A drive's poses, close together, and where each is on the planned track of the lead unit's front axle.

    ``s`` are the line's arclengths (poses,), ``poses`` the bodies (poses, units) of ``POSE``, ``front`` the front axle's way until there
    (poses,) [m].
    """

    vehicle: Vehicle
    s: FloatArray
    poses: Records
    front: FloatArray
    nodes: Records  # (nodes, units), poses every SPACING_M of the front axle's track

    @cached_property
    def links(self) -> Records:
        """The units between two nodes, to first order, (nodes - 1, units) of ``LINK``."""
        return _links(self.vehicle, self.nodes)


def chain_of(drive: Drive) -> Chain:
    """Return the chain of a drive."""
    vehicle, units, path = drive.vehicle, drive.vehicle.table(), drive.stations.path
    spacing, wheels = float(drive.poses_s[1] - drive.poses_s[0]), drive.poses_z[:, vehicle.rigid_states :]
    z = simulate(units, path, float(drive.poses_s[0]), spacing, drive.poses_z[0], drive.poses_kappa, FINER, wheels)
    s = float(drive.poses_s[0]) + spacing / FINER * np.arange(len(z), dtype=np.float64)
    poses = place_many(units, evaluate_many(path, s), z)
    lead, wheelbase = poses[:, 0], vehicle.lead.wheelbase
    x, y = lead["x"] + wheelbase * lead["cos"], lead["y"] + wheelbase * lead["sin"]
    front = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    at = np.interp(SPACING_M * np.arange(int(front[-1] / SPACING_M) + 1), front, s)
    between = np.stack([np.interp(at, s, column) for column in z.T], axis=1)
    return Chain(vehicle, s, poses, front, place_many(units, evaluate_many(path, at), between))


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
