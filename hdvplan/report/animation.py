"""The drive as a film: bodies moving over the map, what they have swept growing behind them.

The film shows the tightest places one after the other. Matplotlib draws each map once; the bodies are painted
on it as pixels, which takes milliseconds a frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BytesIO
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image, ImageDraw

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import verdict_of, verdict_title
from hdvplan.report import answer_colour, body_colour
from hdvplan.report.layers import Layer, drawn_features
from hdvplan.report.maps import HEAD, around, centre_of, draw_direction, draw_features, finish_map, frame, reach_within, swept_label
from hdvplan.report.rooms import Window, half_length, joined, tightest_windows
from hdvplan.report.style import body_fill, styled, write_head

_GROUND = {Layer.ROAD, Layer.OBSTACLES, Layer.SWEEPABLE, Layer.LIMITS}  # what stays as it is
_SIZE_IN = (8.0, 6.0)
_DPI = 100
_OVERSAMPLED = 2  # Pillow draws without anti-aliasing
_PACE_M = 0.75  # of road between two frames
_FRAME_MS = 50
LAST_MS = 1500  # the last frame stays
_COLOURS = 48  # in the film's palette
_NEAR_WHITE = 12  # of 255

Pixels = list[tuple[float, float]]
Box = tuple[int, int, int, int]  # left, upper, right, lower
Colour = tuple[int, int, int]


class Pose(NamedTuple):
    """A pose of the vehicle in a film: what it sweeps on the way there, and what is written where it is shown."""

    outlines: FloatArray  # of the bodies (bodies, 4, 2) [m]
    swept: tuple[int, ...]  # which of the film's areas each body sweeps
    caption: str | None = None  # None where the pose is not shown
    wait: int = _FRAME_MS  # until the next one [ms]


class Ground(NamedTuple):
    """What stays the same in all frames, transparent elsewhere, the axes that place points on it, and the colours of swept areas."""

    overlay: Image.Image
    axes: Axes
    fills: tuple[Colour, ...]
    bodies: int


def film_bytes(result: Result) -> bytes:
    """Return the drive as an animated GIF: its tightest places in order of s, as large as the vehicle can be looked at."""
    return gif_bytes(frame for window in _stretches(result) for frame in frames_of(_map(result, window), _poses(result, window)))


def gif_bytes(frames: Iterable[tuple[Image.Image, int]]) -> bytes:
    """Return an animated GIF of frames, each with the time until the next one [ms]."""
    images, times = zip(*frames, strict=True)
    buffer = BytesIO()
    images[0].save(buffer, format="GIF", save_all=True, append_images=images[1:], duration=list(times), loop=0, optimize=False)
    return buffer.getvalue()


def frames_of(ground: Ground, poses: Iterable[Pose]) -> Iterator[tuple[Image.Image, int]]:
    """Yield a frame with its time [ms] for every pose that is shown; what bodies swept since the last pose grows behind them."""
    overlay, axes, fills, count = ground
    left, right, low, high = (round(edge) for edge in (axes.bbox.x0, axes.bbox.x1, axes.bbox.y0, axes.bbox.y1))
    inside = (left, overlay.height - high, right, overlay.height - low)
    shown = Image.new("RGB", overlay.size, "white")
    shown.paste(overlay, mask=overlay)
    masks = [Image.new("L", overlay.size, 0) for _ in fills]
    palette, before = _palette(shown, fills, count), list[Pixels]()
    for pose in poses:
        bodies = [_pixels(axes, outline) for outline in pose.outlines]
        for unit, mask in enumerate(pose.swept):
            _sweep(masks[mask], (before or bodies)[unit], bodies[unit])
        _repaint(shown, masks, ground, [*before, *bodies], inside)
        before = bodies
        if pose.caption is not None:
            yield _frame(shown, bodies, pose.caption).quantize(palette=palette, dither=Image.Dither.NONE), pose.wait


def paced(spacing: float) -> int:
    """Return how many simulated poses ``spacing`` apart [m] lie between two frames."""
    return max(1, round(_PACE_M / spacing))


def _stretches(result: Result) -> list[Window]:
    length, half = result.drive.road.path.length, half_length(result.drive.vehicle)
    middles = ((0.5 * (window.s_from + window.s_to), window.label) for window in tightest_windows(result))
    return joined(Window(max(0.0, middle - half), min(length, middle + half), label) for middle, label in middles)


def _poses(result: Result, window: Window) -> Iterator[Pose]:
    """Yield the poses of one stretch; every simulated one sweeps, one in ``_PACE_M`` is shown."""
    drive = result.drive
    begin = window.s_from - drive.vehicle.reach_ahead - drive.vehicle.reach_behind  # from where the stretch is swept
    poses = np.flatnonzero((drive.poses_s >= begin) & (drive.poses_s <= window.s_to))
    stride, units = paced(float(drive.poses_s[1] - drive.poses_s[0])), tuple(range(len(drive.vehicle.units)))
    for pose, bodies in zip(poses, corners(drive, poses), strict=True):
        shown = drive.poses_s[pose] >= window.s_from and (poses[-1] - pose) % stride == 0
        caption = f"{window.label + ':  ' if window.label else ''}s = {drive.poses_s[pose]:z.0f} m" if shown else None
        yield Pose(bodies, units, caption, LAST_MS if pose == poses[-1] else _FRAME_MS)


def _palette(ground: Image.Image, fills: tuple[Colour, ...], bodies: int) -> Image.Image:
    """Return an image whose palette holds what a film on this ``ground`` needs: its own colours, the bodies' and those of swept areas."""
    sample = ground.reduce(_OVERSAMPLED)
    draw = ImageDraw.Draw(sample)
    for body in range(bodies):
        draw.rectangle((0, 20 * body, 60, 20 * body + 19), fill=body_colour(body))
    for number, fill in enumerate(fills):
        draw.rectangle((60, 20 * number, 200, 20 * number + 19), fill=fill)
    found = sample.quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    colours = np.array(found.getpalette()).reshape(-1, 3)
    colours[np.min(colours, axis=1) >= np.max(np.min(colours, axis=1)) - _NEAR_WHITE] = 255  # white comes out as averages
    found.putpalette(colours.ravel().tolist())
    return found


def _sweep(mask: Image.Image, old: Pixels, new: Pixels) -> None:
    draw = ImageDraw.Draw(mask)
    draw.polygon(new, fill=255)
    for (a, b), (c, d) in zip(pairwise([*old, old[0]]), pairwise([*new, new[0]]), strict=True):  # what an edge passes over
        draw.polygon([a, b, d, c], fill=255)


def _repaint(shown: Image.Image, masks: list[Image.Image], ground: Ground, bodies: list[Pixels], inside: Box) -> None:
    x, y = zip(*(point for body in bodies for point in body), strict=True)
    box = (
        max(inside[0], int(min(x)) - 1),
        max(inside[1], int(min(y)) - 1),
        min(inside[2], int(max(x)) + 2),
        min(inside[3], int(max(y)) + 2),
    )
    if box[0] >= box[2] or box[1] >= box[3]:
        return
    part = Image.new("RGB", (box[2] - box[0], box[3] - box[1]), "white")
    for mask, fill in reversed(list(zip(masks, ground.fills, strict=True))):  # the first on top, as on the maps
        part.paste(fill, mask=mask.crop(box))
    fixed = ground.overlay.crop(box)
    part.paste(fixed, mask=fixed)
    shown.paste(part, box)


def _map(result: Result, window: Window) -> Ground:
    drive, verdict = result.drive, verdict_of(result)
    points, room = centre_of(result, window), reach_within(result, window)

    def draw(axes: Axes) -> None:
        draw_features(axes, (feature for feature in drawn_features(result) if feature.layer in _GROUND), around(points, room))
        frame(axes, points, room)
        draw_direction(axes, drive.road.path, window.s_from, window.s_to, count=3)
        finish_map(axes, north=drive.road.to_lonlat is not None)

    swept = [swept_label(body_name(drive.vehicle, unit), unit) for unit in range(len(drive.vehicle.units))]
    head = (verdict_title(result, verdict), answer_colour(fits=verdict.holds), drive.road.notice)
    return ground_of(draw, swept, head, bodies=len(swept))


def ground_of(draw: Callable[[Axes], None], swept: Sequence[str], head: tuple[str, str, str | None], *, bodies: int) -> Ground:
    """Return what ``draw`` draws, under a head of title, its colour and a notice; ``swept`` are what swept areas are called."""
    fills = [body_fill(number) for number in range(len(swept))]
    with styled():
        figure = Figure(figsize=_SIZE_IN, dpi=_DPI * _OVERSAMPLED, layout="constrained", facecolor="none")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot(facecolor="none")
        draw(axes)
        title, colour, notice = head
        write_head(figure, title, colour, notice=notice)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend([*(Patch(color=fill) for fill in fills), *handles], [*swept, *labels], loc="outside lower right", ncols=2)
        canvas.draw()  # type: ignore[no-untyped-call] # Matplotlib's back ends are not typed
    overlay = Image.fromarray(np.array(canvas.buffer_rgba()))  # type: ignore[no-untyped-call] # as above
    return Ground(overlay, axes, tuple((round(255 * red), round(255 * green), round(255 * blue)) for red, green, blue in fills), bodies)


def _pixels(axes: Axes, outline: FloatArray) -> Pixels:
    places = axes.transData.transform(outline)
    height = axes.figure.bbox.height
    return [(float(x), float(height - y)) for x, y in places]


def _frame(ground: Image.Image, bodies: list[Pixels], caption: str) -> Image.Image:
    image = ground.copy()
    draw = ImageDraw.Draw(image)
    for unit, body in enumerate(bodies):
        draw.polygon(body, fill="white", outline=body_colour(unit), width=2 * _OVERSAMPLED)
    left, right, right_back, left_back = np.array(bodies[0])
    head = (left + HEAD * (left_back - left), 0.5 * (left + right), right + HEAD * (right_back - right))  # the way the lead unit looks
    draw.line([(float(x), float(y)) for x, y in head], fill=body_colour(0), width=_OVERSAMPLED)
    draw.text((image.width - 12 * _OVERSAMPLED, 8 * _OVERSAMPLED), caption, fill="black", anchor="ra", font_size=14 * _OVERSAMPLED)
    return image.reduce(_OVERSAMPLED)
