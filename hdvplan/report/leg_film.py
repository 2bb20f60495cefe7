"""A drive of several legs as a film: one map of all of them, the vehicle moving forwards and backwards over it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import LegsResult
from hdvplan.report.animation import LAST_MS, Pose, frames_of, gif_bytes, ground_of, paced
from hdvplan.report.colours import answer_colour
from hdvplan.report.leg_maps import draw_ground, stops_of
from hdvplan.report.maps import ROOM_M, finish_map, frame
from hdvplan.road.legs import direction_of

_STANDS_MS = 900  # at a cusp, while the steering turns


def legs_film_bytes(driven: LegsResult) -> bytes:
    """Return the drive as an animated GIF that waits at every cusp, and tells the articulation there."""
    first = driven.results[0].drive
    outline = np.concatenate([np.asarray(area.bounds).reshape(2, 2) for result in driven.results for area in result.swept])

    def draw(axes: Axes) -> None:
        draw_ground(axes, driven)
        frame(axes, outline, ROOM_M)
        finish_map(axes, north=first.road.to_lonlat is not None)

    swept = [f"swept {direction_of(backward=backward)}" for backward in (False, True)]
    title = f"{first.vehicle.name} on {driven.legs.name}: {driven.text.partition(' at s = ')[0]}"  # the place is where it moves
    head = (title, answer_colour(fits=driven.fits), first.road.notice)
    return gif_bytes(frames_of(ground_of(draw, swept, head, bodies=len(first.vehicle.units)), _poses(driven)))


def _poses(driven: LegsResult) -> Iterator[Pose]:
    """Yield all poses in the order of driving; every simulated one sweeps, a few are shown, and every stop is."""
    ends = stops_of(driven)[1:]
    for at, (result, leg, end) in enumerate(zip(driven.results, driven.legs.legs, ends, strict=True)):
        drive, swept = result.drive, (int(leg.backward),) * len(result.drive.vehicle.units)
        order = np.arange(len(drive.poses_s))[:: -1 if leg.backward else 1]
        stride = paced(float(drive.poses_s[1] - drive.poses_s[0]))
        outlines = corners(drive, order)
        for number, bodies in enumerate(outlines[:-1], start=1):
            shown = (len(order) - number) % stride == 0
            yield Pose(bodies, swept, f"leg {at + 1} of {len(ends)}, {leg.direction}" if shown else None)
        yield Pose(outlines[-1], swept, end.text, LAST_MS if at == len(ends) - 1 else _STANDS_MS)
