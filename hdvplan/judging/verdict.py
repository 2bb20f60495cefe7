"""The verdict: whether the vehicle fits, how much room is to spare or lacking, where, and which part decides."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdvplan.answers import LINE, needs_text, room_text, word_of, worded
from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M, Place, places_of
from hdvplan.judging.bodies import contact
from hdvplan.judging.result import Proof, Result, body_name
from hdvplan.judging.sentences import farther_texts, passed_texts
from hdvplan.road.regions import OPEN_M, called, limit_called
from hdvplan.road.road import Road
from hdvplan.texts import place_text

_NO_MORE_M = 0.005  # to spare: 0.00 m in a sentence
_MILLI, _CENTI, _TENTHS = 1e3, 100.0, 10.0  # of a metre, and of a degree; what a driver may err is rounded down


@dataclass(frozen=True)
class Verdict:
    """Whether a plan fits its road, judged on its simulation, and the place that decides it.

    ``fits`` is None on a road without limits: then ``half_width`` is the answer. ``x``, ``y`` [m] and ``lonlat`` [deg] are the point of
    the vehicle that decides; ``lonlat`` is None where the road has no geographic coordinates.
    """

    fits: bool | None
    spare: float | None  #: least room to a limit or an obstacle, less the clearance wanted; negative: lacking; None without limits [m]
    clearance_wanted: float  #: room that was to be kept from everything [m]
    half_width: float  #: of the swept area about the line; where ``fits`` is None with the clearance wanted [m]
    s: float  #: arclength of the place that decides [m]
    x: float
    y: float
    lonlat: tuple[float, float] | None
    side: str  #: of the vehicle, "left" or "right"
    unit: int  #: index of the body
    part: str  #: of the body, see ``contact``
    region: str | None  #: of the limit, see ``Breach``; None without limits, or where an obstacle decides
    obstacle: str | None  #: the name of the obstacle that decides, "" for one without a name; None where a limit of the road does
    wheels_spare: float | None  #: least room of wheels and what lies between them on the whole road, without the clearance [m]
    proof: Proof | None = None  #: that no drive fits; None where ``fits``, and where no proof was found
    strays: tuple[float, float] | None = None  #: how far a driver may stray where it ``fits``, and the more that was asked for [m]

    @property
    def proved(self) -> bool:
        """Whether it is proved that nothing fits. A NO without a proof says only that no plan was found."""
        return self.proof is not None

    @property
    def holds(self) -> bool | None:
        """Whether the plan fits, for a driver who strays by as much as was asked for; None on a road without limits."""
        return self.fits and self.strays is None

    @property
    def word(self) -> str:
        """``YES``, ``NO`` or, without limits, ``NEEDS``."""
        return word_of(self.holds)


def verdict_of(result: Result) -> Verdict:
    """Return the verdict on a judged plan.

    A limit, or the clearance from it, counts as kept if it is broken by at most ``KEPT_M``.
    """
    found, wanted = _found(result), result.case.settings.tracking_error
    if found.fits is False:
        return replace(found, proof=result.proof)
    tracking = result.tracking if found.fits and wanted > 0.0 else None
    return found if tracking is None or tracking.error >= wanted else replace(found, strays=(tracking.error, wanted))


def _found(result: Result) -> Verdict:
    wanted, places = result.case.settings.clearance, places_of(result.drive.vehicle, result.balance.touches, result.approaches)
    known = [place for place in places if place.room <= OPEN_M or (place.obstacle is None and np.isfinite(place.room))]
    if not known:
        return _needs(result)
    near = min(known, key=lambda place: place.room)
    (room, s, x, y), decides = near[:4], near[4:]
    spare, half = room - wanted, result.balance.half_width
    wheels = result.wheel_room if near.obstacle is None and room < -KEPT_M else None
    return Verdict(spare >= -KEPT_M, spare, wanted, half, s, x, y, result.drive.road.lonlat(x, y), *decides, wheels)


def verdict_line(result: Result, verdict: Verdict, of: str = "") -> str:
    """Return the verdict as one line of at most ``LINE`` characters, which names a solver whose answers could not be used.

    Where it would be longer the body is left out, then the obstacle's name, at last all but the part. ``of`` follows the place: which leg.
    """
    unusable, steps = len(result.failed) + len(result.rescued), len(result.drive.plans)
    solver = f"; {result.solver} failed in {unusable} of {steps} steps" if unusable else ""
    lines = [f"{_answer(result, verdict, who, of)}{solver}" for who in _who(result, verdict)]
    cut = f"{lines[-1][: max(0, LINE - 3 - len(solver))]}...{solver}"
    return next((line for line in lines if len(line) <= LINE), cut)


def verdict_details(result: Result, verdict: Verdict, of: str = "") -> str:
    """Return what else is known, as one line: what the first had no room for, coordinates, wheels, and whether anything can fit."""
    who, line = _who(result, verdict)[0], verdict_line(result, verdict, of)
    parts = [] if who in line else [who] if verdict.strays is None else [_room(verdict, who, of)]
    parts.append(f"at {place_text(verdict.x, verdict.y, verdict.lonlat)}")
    if verdict.fits is None:
        parts.append("the road has no limits")
    elif not verdict.fits:
        parts += [text for text in (_wheels(result, verdict), _hit(result, verdict), _known(result, verdict)) if text]
    met = _meeting(result.drive.road)
    parts += [f"holds{met}"] if verdict.fits and met else []
    return "; ".join([*parts, *passed_texts(result), *farther_texts(result)])


def verdict_text(result: Result, verdict: Verdict) -> str:
    """Return verdict and details in one line."""
    return f"{verdict_line(result, verdict)}; {verdict_details(result, verdict)}"


def _who(result: Result, verdict: Verdict) -> list[str]:
    """Return what decides and beside what it is: in full, without the body, without the obstacle's name, and the part alone."""
    full = f"{verdict.part} of the {body_name(result.drive.vehicle, verdict.unit)}"
    if verdict.fits is None:
        return [f"{full} to the {verdict.side}", f"{verdict.part} to the {verdict.side}", verdict.part]
    beside = "beyond" if _broken(verdict) else "beside"
    against = _against(result, verdict)
    shortest = [f"{verdict.part} {beside} {called('')}"] if verdict.obstacle is not None else []
    return [f"{full} {beside} {against}", f"{verdict.part} {beside} {against}", *shortest, verdict.part]


def _answer(result: Result, verdict: Verdict, who: str, of: str) -> str:
    if verdict.fits is None:
        return f"{amount_text(verdict)} for the {result.drive.vehicle.name}: {who} at s = {verdict.s:z.1f} m{of}"
    return worded(verdict.word, strays_text(verdict) or _room(verdict, who, of))


def _room(verdict: Verdict, who: str, of: str) -> str:
    return f"{_amount(verdict)} at s = {verdict.s:z.1f} m{of}, {who}"


def strays_text(verdict: Verdict) -> str:
    """Return what a plan that fits lacks for a driver who strays by as much as was asked for; "" if nothing."""
    if verdict.strays is None:
        return ""
    return "holds for a driver who strays by {:.3f} m, not for the {:g} m asked for".format(*verdict.strays)


def _amount(verdict: Verdict) -> str:
    """Return the room to spare or lacking, and of how much to keep, if anything is."""
    wanted, spare = f"the {verdict.clearance_wanted:.2f} m to keep", verdict.spare or 0.0
    if verdict.clearance_wanted == 0.0:
        return amount_text(verdict)
    if verdict.fits and spare < _NO_MORE_M:  # what is kept may be less by as much as is tolerated
        kept, asked = f"{verdict.clearance_wanted + spare:.2f} m", f"{verdict.clearance_wanted:.2f} m"
        return f"{wanted} are kept" if kept >= asked else f"{kept} of {wanted}"
    between = "beyond" if verdict.fits else "of" if spare > -verdict.clearance_wanted else "with"
    return f"{amount_text(verdict)} {between} {wanted}"


def stray_text(error: float) -> str:
    """Return how far a driver may stray, rounded down."""
    return f"{np.floor(error * _CENTI) / _CENTI:.2f} m"


def _lacking_text(result: Result) -> str:
    """Return what a plan that counts as keeping its limits lacks; "" of one that lacks no millimetre."""
    lacking = result.case.settings.clearance - (result.balance.min_clearance or 0.0)
    return f": {_MILLI * lacking:.0f} mm are lacking, of which up to {_MILLI * KEPT_M:.0f} count as kept" if _MILLI * lacking >= 1.0 else ""


def tracking_line(result: Result) -> str:
    """Return how far the driver may stray from a plan that keeps the street, and what decides that, as one line; "" without limits."""
    tracking = result.tracking
    if tracking is None:
        return ""
    course = np.floor(np.degrees(tracking.error / tracking.length) * _TENTHS) / _TENTHS  # a bound is rounded to what it allows
    held = (
        f"holds while the driver keeps the front axle within {stray_text(tracking.error)} of the path, "
        f"its course within {course:.1f} degrees, without slip"
        if tracking.error * _CENTI >= 1.0
        else f"leaves the driver no room to stray{_lacking_text(result)}"
    )
    if not tracking.decided:
        return f"{held}; of more nothing is known"
    name = body_name(result.drive.vehicle, tracking.unit)
    return f"{held}; decided at s = {tracking.s:z.1f} m, {tracking.part} of the {name}"


def verdict_title(result: Result, verdict: Verdict) -> str:
    """Return the verdict as a short title: vehicle, word, amount and place."""
    place = "" if verdict.fits is None or verdict.strays is not None else f" at s = {verdict.s:z.0f} m"
    beside = _meeting(result.drive.road).partition(",")[0]
    return f"{result.drive.vehicle.name} on {result.drive.road.name}: {short_verdict(verdict)}{place}{beside}"


def short_verdict(verdict: Verdict) -> str:
    """Return word and amount of a verdict, or what it does not hold for."""
    if verdict.fits is None:
        return amount_text(verdict)
    word = f"{verdict.word} (proved)" if verdict.proved else verdict.word
    return f"{word}, {strays_text(verdict) or _amount(verdict)}"


def proof_text(proof: Proof, case: Case) -> str:
    """Return what a proof about a case says, without a capital or a full stop."""
    clearance = case.settings.clearance
    kept = "keeps the limits" if clearance == 0.0 else f"stays {clearance:.2f} m off the limits"
    kept += _meeting(case.road)
    if proof.kind == "place":
        return f"at s = {proof.s_to:z.1f} m there is no place for the {body_name(case.vehicle, proof.unit)} that {kept}"
    return f"between s = {proof.s_from:z.1f} and {proof.s_to:z.1f} m nothing that this vehicle can drive {kept}"


def _meeting(road: Road) -> str:
    """Return beside which plan the answer holds; "" where the vehicle meets none."""
    return next((f" beside the plan in {region.plan}" for region in road.regions if region.plan), "")


def _known(result: Result, verdict: Verdict) -> str:
    if verdict.proof is None:
        return "no plan was found, and none is excluded" if result.planned else "another path may fit: `hdvplan plan` looks for one"
    return f"proved: {proof_text(verdict.proof, result.case)}"


def amount_text(verdict: Verdict) -> str:
    """Return the room to spare or lacking or, with its word, the room needed."""
    return needs_text(verdict.half_width) if verdict.fits is None else room_text(verdict.spare or 0.0, fits=verdict.fits)


def _needs(result: Result) -> Verdict:
    given, wanted = result.balance.beside_given, result.case.settings.clearance
    near = _furthest(result) if given is None else min(places_of(result.drive.vehicle, given[1]), key=lambda place: place.room)
    half, lonlat = result.balance.half_width + wanted, result.drive.road.lonlat(near.x, near.y)
    return Verdict(None, None, wanted, half, near.s, near.x, near.y, lonlat, near.side, near.unit, near.part, None, None, None)


def _furthest(result: Result) -> Place:
    envelope = result.envelope
    left, right = envelope.left, -envelope.right
    side = "left" if np.nanmax(left) >= np.nanmax(right) else "right"
    reach = left if side == "left" else right
    unit, at = (int(number) for number in np.unravel_index(np.nanargmax(reach), reach.shape))
    most, s = float(reach[unit, at]), float(envelope.s[at])
    x, y = (float(of[0]) for of in result.drive.stations.path.to_plane(np.array([s]), np.array([most if side == "left" else -most])))
    return Place(-most, s, x, y, side, unit, contact(result.drive, unit, side, s), None, None)


def _against(result: Result, verdict: Verdict) -> str:
    if verdict.obstacle is not None:
        return called(verdict.obstacle)
    return limit_called(verdict.side, result.drive.road.binds(verdict.side, str(verdict.region), verdict.x, verdict.y))


def _broken(verdict: Verdict) -> bool:
    return verdict.spare is not None and verdict.spare + verdict.clearance_wanted < -KEPT_M


def _wheels(result: Result, verdict: Verdict) -> str:
    """Return what the wheels do where a limit is broken: an overhang over a kerb is another matter than a wheel on it."""
    if verdict.wheels_spare is None:
        return ""
    if verdict.wheels_spare >= -KEPT_M:
        return "only overhangs pass over it, the wheels keep it"
    return f"wheels, or sides between axles, leave the {'drivable area' if result.two_regions else 'road'} by {-verdict.wheels_spare:.2f} m"


def _hit(result: Result, verdict: Verdict) -> str:
    """Return which obstacle is entered too, where a limit of the road decides, or which limit is broken where an obstacle does."""
    others = [(-near.distance, f"into {called(near.obstacle.label)}") for near in result.approaches]
    if verdict.obstacle is not None:
        others = [(one.depth, f"beyond the {one.side} limit") for one in result.balance.breaches if one.obstacle is None]
    lacking, against = max(others, default=(0.0, ""))
    return f"{lacking:.2f} m {against} as well" if lacking > KEPT_M else ""
