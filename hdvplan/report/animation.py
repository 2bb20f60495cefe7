"""The drive as a film: bodies moving over the map, what they have swept growing behind them.

The film shows the tightest places one after the other. Matplotlib draws each map once; the bodies are painted
on it as pixels, which takes milliseconds a frame.
"""

from __future__ import annotations

from io import BytesIO
from itertools import pairwise

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
from hdvplan.report.colours import answer_colour, body_colour
from hdvplan.report.layers import Layer, drawn_features
from hdvplan.report.maps import around, draw_direction, draw_features, finish_map, frame, reach_within, stations, swept_label
from hdvplan.report.rooms import Window, half_length, joined, tightest_windows
from hdvplan.report.style import body_fill, styled, write_head

_GROUND = {Layer.ROAD, Layer.OBSTACLES, Layer.SWEEPABLE, Layer.LIMITS}  # what stays as it is
_SIZE_IN = (8.0, 6.0)
_DPI = 100
_OVERSAMPLED = 2  # Pillow draws without anti-aliasing
_PACE_M = 0.75  # of road between two frames
_FRAME_MS = 50
_LAST_MS = 1500  # the last frame stays
_COLOURS = 48  # in the film's palette
_NEAR_WHITE = 12  # of 255

Pixels = list[tuple[float, float]]
Box = tuple[int, int, int, int]  # left, upper, right, lower


def film_bytes(result: Result) -> bytes:
    """Return the drive as an animated GIF: its tightest places in order of s, as large as the vehicle can be looked at."""
    images, times = list[Image.Image](), list[int]()
    for window in _stretches(result):
        part = _film(result, window)
        images += part
        times += [_FRAME_MS] * (len(part) - 1) + [_LAST_MS]
    buffer = BytesIO()
    images[0].save(buffer, format="GIF", save_all=True, append_images=images[1:], duration=times, loop=0, optimize=False)
    return buffer.getvalue()


def _stretches(result: Result) -> list[Window]:
    """Return the stretches around the tightest places, those that overlap as one."""
    length, half = result.drive.road.path.length, half_length(result.drive.vehicle)
    middles = ((0.5 * (window.s_from + window.s_to), window.label) for window in tightest_windows(result))
    return joined(Window(max(0.0, middle - half), min(length, middle + half), label) for middle, label in middles)


def _film(result: Result, window: Window) -> list[Image.Image]:
    """Return the frames of one stretch; every simulated pose sweeps, one in ``_PACE_M`` is shown."""
    drive = result.drive
    overlay, axes = _map(result, window)
    left, right, low, high = (round(edge) for edge in (axes.bbox.x0, axes.bbox.x1, axes.bbox.y0, axes.bbox.y1))
    inside = (left, overlay.height - high, right, overlay.height - low)
    ground = Image.new("RGB", overlay.size, "white")
    ground.paste(overlay, mask=overlay)
    swept = [Image.new("L", overlay.size, 0) for _ in drive.vehicle.units]
    palette = _palette(ground, len(swept))
    begin = window.s_from - drive.vehicle.reach_ahead - drive.vehicle.reach_behind  # from where the stretch is swept
    poses = np.flatnonzero((drive.poses_s >= begin) & (drive.poses_s <= window.s_to))
    stride = max(1, round(_PACE_M / float(drive.poses_s[1] - drive.poses_s[0])))
    frames, before = list[Image.Image](), list[Pixels]()
    for pose in poses:
        bodies = [_pixels(axes, outline) for outline in corners(drive, np.array([pose]))[0]]
        _sweep(ground, swept, overlay, (before or bodies, bodies), inside)
        before = bodies
        if drive.poses_s[pose] >= window.s_from and (poses[-1] - pose) % stride == 0:
            caption = f"{window.label + ':  ' if window.label else ''}s = {drive.poses_s[pose]:.0f} m"
            frames.append(_frame(ground, bodies, caption).quantize(palette=palette, dither=Image.Dither.NONE))
    return frames


def _palette(ground: Image.Image, units: int) -> Image.Image:
    """Return an image whose palette holds what a film on this ``ground`` needs: its own colours and the bodies'."""
    sample = ground.reduce(_OVERSAMPLED)
    draw = ImageDraw.Draw(sample)
    for unit in range(units):
        draw.rectangle((0, 20 * unit, 60, 20 * unit + 19), fill=body_colour(unit))
        draw.rectangle((60, 20 * unit, 200, 20 * unit + 19), fill=_fill(unit))
    found = sample.quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    colours = np.array(found.getpalette()).reshape(-1, 3)
    colours[np.min(colours, axis=1) >= np.max(np.min(colours, axis=1)) - _NEAR_WHITE] = 255  # white comes out as averages
    found.putpalette(colours.ravel().tolist())
    return found


def _sweep(
    ground: Image.Image, swept: list[Image.Image], overlay: Image.Image, moved: tuple[list[Pixels], list[Pixels]], inside: Box
) -> None:
    """Add the way from one pose to the next to what was swept, and repaint ``ground`` around it, inside the axes."""
    for mask, old, new in zip(swept, *moved, strict=True):
        draw = ImageDraw.Draw(mask)
        draw.polygon(new, fill=255)
        for (a, b), (c, d) in zip(pairwise([*old, old[0]]), pairwise([*new, new[0]]), strict=True):  # what an edge passes over
            draw.polygon([a, b, d, c], fill=255)
    x, y = zip(*(point for bodies in moved for body in bodies for point in body), strict=True)
    box = (
        max(inside[0], int(min(x)) - 1),
        max(inside[1], int(min(y)) - 1),
        min(inside[2], int(max(x)) + 2),
        min(inside[3], int(max(y)) + 2),
    )
    if box[0] >= box[2] or box[1] >= box[3]:
        return
    part = Image.new("RGB", (box[2] - box[0], box[3] - box[1]), "white")
    for unit in reversed(range(len(swept))):  # the lead unit on top, as on the maps
        part.paste(_fill(unit), mask=swept[unit].crop(box))
    fixed = overlay.crop(box)
    part.paste(fixed, mask=fixed)
    ground.paste(part, box)


def _fill(unit: int) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in body_fill(unit))
    return red, green, blue


def _map(result: Result, window: Window) -> tuple[Image.Image, Axes]:
    """Return what stays the same in all frames, transparent elsewhere, and the axes that place points on it."""
    drive, verdict = result.drive, verdict_of(result)
    points, room = np.column_stack(drive.road.path.to_plane(stations(window), 0.0)), reach_within(result, window)
    with styled():
        figure = Figure(figsize=_SIZE_IN, dpi=_DPI * _OVERSAMPLED, layout="constrained", facecolor="none")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot(facecolor="none")
        draw_features(axes, (feature for feature in drawn_features(result) if feature.layer in _GROUND), around(points, room))
        frame(axes, points, room)
        draw_direction(axes, drive.road.path, window.s_from, window.s_to, count=3)
        finish_map(axes, north=drive.road.to_lonlat is not None)
        write_head(figure, verdict_title(result, verdict), answer_colour(fits=verdict.fits), notice=drive.road.notice)
        handles, labels = axes.get_legend_handles_labels()
        bodies = [
            Patch(color=body_fill(unit), label=swept_label(body_name(drive.vehicle, unit), unit))
            for unit in range(len(drive.vehicle.units))
        ]
        figure.legend([*bodies, *handles], [*(str(body.get_label()) for body in bodies), *labels], loc="outside lower left", ncols=4)
        canvas.draw()  # type: ignore[no-untyped-call] # Matplotlib's back ends are not typed
    return Image.fromarray(np.array(canvas.buffer_rgba())), axes  # type: ignore[no-untyped-call] # as above


def _pixels(axes: Axes, outline: FloatArray) -> Pixels:
    """Return a body's corners, shape (4, 2) [m], as pixels of the map."""
    places = axes.transData.transform(outline)
    height = axes.figure.bbox.height
    return [(float(x), float(height - y)) for x, y in places]


def _frame(ground: Image.Image, bodies: list[Pixels], caption: str) -> Image.Image:
    image = ground.copy()
    draw = ImageDraw.Draw(image)
    for unit, body in enumerate(bodies):
        draw.polygon(body, fill="white", outline=body_colour(unit), width=2 * _OVERSAMPLED)
    draw.text((image.width - 12 * _OVERSAMPLED, 8 * _OVERSAMPLED), caption, fill="black", anchor="ra", font_size=14 * _OVERSAMPLED)
    return image.reduce(_OVERSAMPLED)
