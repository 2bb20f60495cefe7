"""The published numbers, each with its source and how exactly it can be read. Lengths in metres, angles in radians.

[GEO] Oliveira, Ljungqvist, Lima, Mårtensson, Wahlberg, "A Geometric Approach to On-road Motion Planning for Long and
Multi-Body Heavy-Duty Vehicles", IEEE IV 2020. [ART] Oliveira, Ljungqvist, Lima, Wahlberg, "Optimization-Based On-Road
Path Planning for Articulated Vehicles", IFAC 2020. [BUS] Oliveira, Lima, Collares Pereira, Mårtensson, Wahlberg, "Path Planning
for Autonomous Bus Driving in Highly Constrained Environments", ITSC 2019.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources
from typing import NamedTuple

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.settings import METRES


@dataclass(frozen=True)
class Number:
    """A published value and how far off its true one may be: half of its last digit, or what a figure allows."""

    value: float
    reading_error: float


def _printed(value: float, last_digit: float) -> Number:
    return Number(value, 0.5 * last_digit * (1.0 + 1e-9))


_FIGURE_M = 0.01  # a vector figure's curves can be read to a centimetre
GEO, ART, BUS = "[GEO]", "[ART]", "[BUS]"

# [GEO] fig. 7: furthest reach of the bus in a U-turn, to the right (outside) and to the left.
UTURN_PREVIOUS_RIGHT = Number(3.00, _FIGURE_M)
UTURN_PREVIOUS_LEFT = Number(1.82, _FIGURE_M)
UTURN_PROPOSED_RIGHT = Number(2.47, _FIGURE_M)
UTURN_PROPOSED_LEFT = Number(2.44, _FIGURE_M)

# [GEO] fig. 9 and its caption: the tractor-trailer in a roundabout.
ROUNDABOUT_LEFT = _printed(2.30, 0.01)
ROUNDABOUT_RIGHT = _printed(2.26, 0.01)
ROUNDABOUT_EXPECTED = _printed(2.27, 0.01)
ROUNDABOUT_KAPPA = Number(0.0539, 1e-4)  # fig. 10, constant part [1/m]
ROUNDABOUT_BETA = Number(0.4605, 2e-4)  # fig. 10, constant part [rad]

# [BUS] figs. 6-8: no wheelbase constraint, with it, and with the overhangs' cost; and how near bodies come to a limit.
OVERHANG_M = tuple(_printed(value, 0.01) for value in (1.29, 0.90, 0.85))
OVERHANG_AREA_M2 = tuple(_printed(value, 0.1) for value in (18.7, 15.0, 10.5))
KEPT_FROM_LIMIT = _printed(0.06, 0.01)


class ObjectiveResult(NamedTuple):
    """A row of [ART] table 2: furthest reaches [m], area difference aL - aR [m^2], computation time [s]."""

    left: Number
    right: Number
    area: Number
    time: Number


# [ART] table 2: a U-turn of curvature 0.065 1/m over 134.2 m, sampled every 0.1 m.
OBJECTIVES = {
    name: ObjectiveResult(*map(_printed, values, (0.01, 0.01, 1.0, 0.01)))
    for name, *values in (
        ("J1", 8.34, 2.06, 312.0, 7.92),
        ("J2", 1.79, 7.83, -302.0, 17.93),
        ("J3", 4.79, 4.82, -5.0, 22.03),
        ("J4", 4.25, 4.82, -406.0, 13.53),
        ("J5", 4.70, 4.78, 4.0, 770.71),
    )
}
# [ART] sec. 5: the weights found by exhaustive search, for its vehicles of table 1 and table 3.
SEARCHED = {"tractor-trailer-24m": _printed(0.45, 0.01), "tractor-trailer": _printed(0.40, 0.01)}

# [GEO] fig. 11: largest improvement of D by a varying K over a fixed one [%].
IMPROVEMENT = {"bus": Number(10.0, 1.0), "tractor-trailer": Number(5.0, 1.0)}


class StepTime(NamedTuple):
    """A cell of [GEO] table I: mean and largest time of one planning step [ms]."""

    mean: Number
    most: Number


# [GEO] table I, by vehicle and scheme: MATLAB and OSQP on a laptop with an i7-6820HQ.
TIMES = {
    ("bus", "sqp"): StepTime(_printed(79.0, 1.0), _printed(742.0, 1.0)),
    ("bus", "rti"): StepTime(_printed(30.0, 1.0), _printed(48.0, 1.0)),
    ("tractor-trailer", "sqp"): StepTime(_printed(137.0, 1.0), _printed(1248.0, 1.0)),
    ("tractor-trailer", "rti"): StepTime(_printed(50.0, 1.0), _printed(137.0, 1.0)),
}


def curves() -> dict[str, FloatArray]:
    """Return the curves of [GEO] figs. 9 and 10 as digitised from the vector figures, each of shape (n, 2): s [m], value.

    ``env_geo_left``, ``env_plan_right``, ...: geometric and planned envelope [m]; ``kappa_road``, ``kappa_geo``,
    ``kappa_plan`` [1/m]; ``beta_geo``, ``beta_plan`` [rad].
    """
    text = (resources.files("hdvplan.reproduce") / "paper_fig8_10.json").read_text(encoding="utf-8")
    return {name: np.array(points, dtype=np.float64) for name, points in json.loads(text).items()}


# Turning figures of highway manuals; only what was read in the source named. Feet and inches as printed.
FOOT_M, INCH_M = METRES["ft"], METRES["in"]
GREEN_BOOK = "AASHTO Green Book 2018, figs. 2-23, 2-24"
SDDC = "SDDC/TEA, Turning characteristics"


def _feet(value: float, last_digit: float = 0.1) -> Number:
    return _printed(value * FOOT_M, last_digit * FOOT_M)


# Least inside radius of the wheel tracks in the minimum turn of 180 degrees [m].
TURN_INSIDE = {"P": _feet(14.4), "CITY-BUS": _feet(24.5), "WB-40": _feet(19.3), "WB-62": _feet(7.4), "WB-67": _feet(1.9)}
# Radius of the outer front wheel, and of the front overhang [m].
TURN_OUTSIDE = {
    "P": _feet(23.8), "CITY-BUS": _feet(41.6), "WB-40": _feet(39.9), "WB-62": _feet(44.8), "WB-67": _feet(44.8),
    "SU-30": _feet(41.8), "SU-40": _feet(51.2), "S-BUS-36": _feet(38.6),
}  # fmt: skip
TURN_OVERHANG = {"WB-62": _feet(46.3), "WB-67": _feet(46.3)}
TURN_ARTICULATION = {"WB-62": _printed(65.0, 1.0), "WB-67": _printed(68.5, 0.5)}  # [degrees]
TURN_STEERING = {"WB-62": _printed(28.4, 0.1)}  # [degrees]
# De Saxe, Kienhofer, Nordengen, HVTT12 2012: tail swing for rear overhangs of 3.7 and 7 m [m].
PBS = "De Saxe et al., HVTT12 2012"
TAIL_SWING = {3.7: _printed(0.30, 0.01), 7.0: _printed(1.25, 0.01)}
# FHWA MAP-21, 2015: low-speed off-tracking of the control vehicle with a trailer of 53 ft, axles of the tractor and of the trailer [m].
MAP21 = "FHWA MAP-21, 2015"
MAP21_OFF_TRACKING = (Number(50.0 * INCH_M, 1.0 * INCH_M), Number(244.0 * INCH_M, 1.0 * INCH_M))
