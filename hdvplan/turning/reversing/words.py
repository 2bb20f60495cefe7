"""What is said of a manoeuvre in its site."""

from __future__ import annotations

import numpy as np

from hdvplan.answers import LINE, NEEDS, NO, YES, room_text, worded
from hdvplan.turning.reversing.answer import Answer, Tried
from hdvplan.turning.reversing.options import Template
from hdvplan.vehicle.model import Vehicle

_TOLD_M = 0.01
_STANDING = "; the front wheels turn while it stands, else it needs more"


def verdict(answer: Answer) -> str:
    """Return one line of at most ``LINE`` characters: whether the manoeuvre fits, or what room it needs."""
    chosen, size = answer.chosen, f"{answer.size:.2f} m of {answer.template.words}"
    if answer.given is None:
        least = min(answer.tried, key=lambda one: one.manoeuvre.rounded)
        less = f"; {least.manoeuvre.rounded:.2f} m in {least.legs}" if least.manoeuvre.rounded < chosen.manoeuvre.rounded else ""
        return _with_name(worded(NEEDS, f"{size}: {{}} {_does(answer)} in {_legs(chosen)}{less}"), answer.vehicle)
    if answer.fits:
        spare = room_text(answer.given - chosen.manoeuvre.size, fits=True).replace(" to spare", " of it to spare")
        return _with_name(worded(YES, f"{{}} {_does(answer)} in {_legs(chosen)} in {size}, {spare}"), answer.vehicle)
    return _with_name(worded(NO, f"no way was found for {{}} in {_given(answer)}; {size} do, in {_legs(chosen)}"), answer.vehicle)


def details(answer: Answer) -> str:
    """Return the second line: how sure the answer is."""
    chosen, sizes = answer.chosen, answer.chosen.sizes
    if answer.template.docks and chosen.polished:
        out = f"polished from {sizes[0]:.2f} m, with which it drives straight out, then turns at full lock"
        return f"{out}{_kept(answer)}; less may do: nothing is proved impossible{_STANDING}"
    if answer.template.docks:
        formula = closed_form(answer.vehicle, answer.template, chosen)
        formula_text = "" if formula is None else f", {formula:.2f} m by formula"
        out = f"out, it drives {straight_out(chosen):.2f} m straight to pass its neighbours, then turns at full lock{formula_text}"
        return f"{out}{_kept(answer)}; less may do where it swings out: nothing is proved impossible{_STANDING}"
    arms = f"arms of {arms_text(answer)}; with equal arms this drive takes {answer.size_of_equal_arms:.2f} m; " if answer.arms else ""
    which = "which found" if len(sizes) == chosen.starts else f"{len(sizes)} of which found a way, in"
    over = chosen.manoeuvre.over_kerbs
    kerbs = f"; bodies reach {over:.2f} m over kerbs" if over >= _TOLD_M else ""
    spread = " to ".join(dict.fromkeys(f"{size:.2f}" for size in (sizes[0], sizes[-1])))
    found = f"the best of {chosen.starts} starts, {which} {spread} m"
    less = f", polished to {chosen.manoeuvre.size:.2f} m" if sizes[0] - chosen.manoeuvre.size >= _TOLD_M else ""
    return f"{arms}{found}{less}; less may do: nothing is proved impossible{_kept(answer)}{kerbs}{_STANDING}"


def arms_text(answer: Answer) -> str:
    """Return how long the arms of a head are, which may lie to one side of the road."""
    return "{:.2f} m left and {:.2f} m right of the road's axis".format(*answer.arms)


def _kept(answer: Answer) -> str:
    clearance = answer.chosen.manoeuvre.site.clearance
    return f"; {clearance:.2f} m of clearance are kept" if clearance > 0.0 else ""


def refusal(answer: Answer) -> str:
    """Return what is said as an error where nothing was found that fits."""
    short = answer.chosen.manoeuvre.size - (answer.given or 0.0)
    return f"{_given(answer)} are {short:.2f} m less than the least that was found to do"


def closed_form(vehicle: Vehicle, template: Template, tried: Tried) -> float | None:
    """Return the size by a formula where there is one, else None [m].

    A half turn in one move without swinging out takes the circles of the outer front corner and of the outer tail, one for each side. A
    pull-out that is not polished reaches as far as the outer front corner's circle, whose centre lies beside where the turn begins.
    """
    radius, half, kept = 1.0 / vehicle.max_curvature, 0.5 * vehicle.lead.width, tried.manoeuvre.site.clearance
    front = float(np.hypot(vehicle.lead.front, radius + half)) + kept
    if vehicle.lead.steering_ratio > 0.0:
        return None
    if template is Template.THREE_POINT and tried.legs == 1:
        return front + float(np.hypot(vehicle.lead.rear_overhang, radius + half)) + kept
    if template is Template.DOCK_90 and not tried.polished:
        return straight_out(tried) + vehicle.reach_behind + front
    return None


def straight_out(tried: Tried) -> float:
    """Return how far a docked vehicle pulls straight out before it turns [m]."""
    out = tried.manoeuvre.legs[-1].reversed()
    turned = np.flatnonzero(out.kappa != 0.0)
    return float(out.s[turned[0]]) if len(turned) else out.length


def _does(answer: Answer) -> str:
    return "docks" if answer.template.docks else "turns round"


def _given(answer: Answer) -> str:
    return f"{answer.given:.2f} m of {answer.template.words}"


def _legs(tried: Tried) -> str:
    return "one leg" if tried.legs == 1 else f"{tried.legs} legs"


def _with_name(text: str, vehicle: Vehicle) -> str:
    named = text.format(f"the {vehicle.name}")
    return named if len(named) <= LINE else text.format("the vehicle")
