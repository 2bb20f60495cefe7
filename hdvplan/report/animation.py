"""The drive as a film: bodies moving over the map, what they have swept growing behind them.

A long road's film shows its tightest places one after the other. Matplotlib draws each map once; the bodies are painted
on it as pixels, which takes milliseconds a frame.
"""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from hdvplan.jit import FloatArray
from hdvplan.report.bodies import corners
from hdvplan.report.colours import MUTED
from hdvplan.report.maps import draw_surroundings, frame, reach_within
from hdvplan.report.result import Result
from hdvplan.report.style import body_colour, body_fill, styled
from hdvplan.report.windows import LONG_ROAD_M, Window, tightest_windows

_SIZE_IN = (8.0, 6.0)
_DPI = 100
_OVERSAMPLED = 2  # Pillow draws without anti-aliasing
_PACE_M = 0.75  # of road between two frames
_FRAME_MS = 50
_LAST_MS = 1500  # the last frame stays
_COLOURS = 48  # in the film's palette

Pixels = list[tuple[float, float]]


def film_bytes(result: Result) -> bytes:
    """Return the drive as an animated GIF: the whole of a short road, else its tightest places in order of s."""
    length = result.drive.road.path.length
    windows = tightest_windows(result) if length > LONG_ROAD_M else (Window(0.0, length),)
    frames, times = [], []
    for window in sorted(windows, key=lambda window: window.s_from):
        part = _film(result, window)
        frames += part
        times += [_FRAME_MS] * (len(part) - 1) + [_LAST_MS]
    palette = frames[-1].quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in frames]
    buffer = BytesIO()
    images[0].save(buffer, format="GIF", save_all=True, append_images=images[1:], duration=times, loop=0, optimize=False)
    return buffer.getvalue()


def _film(result: Result, window: Window) -> list[Image.Image]:
    """Return the frames of one stretch; every simulated pose sweeps, one in ``_PACE_M`` is shown."""
    drive = result.drive
    overlay, axes = _map(result, window)
    left, right, low, high = (round(edge) for edge in (axes.bbox.x0, axes.bbox.x1, axes.bbox.y0, axes.bbox.y1))
    corner = left, overlay.height - high
    swept = [Image.new("L", (right - left, high - low), 0) for _ in drive.vehicle.units]
    poses = np.flatnonzero((drive.poses_s >= window.s_from) & (drive.poses_s <= window.s_to))
    stride = max(1, round(_PACE_M / float(drive.poses_s[1] - drive.poses_s[0])))
    frames = []
    for number, pose in enumerate(poses):
        bodies = [_pixels(axes, outline) for outline in corners(drive, int(pose))]
        for mask, body in zip(swept, bodies, strict=True):
            ImageDraw.Draw(mask).polygon([(x - corner[0], y - corner[1]) for x, y in body], fill=255)
        if number % stride == 0 or number == len(poses) - 1:
            caption = f"{window.label + ':  ' if window.label else ''}s = {drive.poses_s[pose]:.0f} m"
            frames.append(_frame(overlay, swept, corner, bodies, caption))
    return frames


def _map(result: Result, window: Window) -> tuple[Image.Image, Axes]:
    """Return what stays the same in all frames, transparent elsewhere, and the axes that place points on it."""
    drive, s = result.drive, result.envelope.s
    with styled():
        figure = Figure(figsize=_SIZE_IN, dpi=_DPI * _OVERSAMPLED, layout="constrained", facecolor="none")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot(facecolor="none")
        draw_surroundings(axes, drive.road, window)
        shown = (s >= window.s_from) & (s <= window.s_to)
        frame(axes, np.column_stack(drive.road.path.to_plane(s[shown], 0.0)), reach_within(result, shown))
        axes.set_title(f"{drive.vehicle.name} on {drive.road.name}", loc="left", fontsize="medium", fontweight="bold")
        if drive.road.notice is not None:
            figure.supxlabel(drive.road.notice, fontsize="x-small", color=MUTED, x=0.01, ha="left")
        canvas.draw()  # type: ignore[no-untyped-call] # Matplotlib's back ends are not typed
    return Image.fromarray(np.array(canvas.buffer_rgba())), axes  # type: ignore[no-untyped-call] # as above


def _pixels(axes: Axes, outline: FloatArray) -> Pixels:
    """Return a body's corners, shape (4, 2) [m], as pixels of the map."""
    places = axes.transData.transform(outline)
    height = axes.figure.bbox.height
    return [(float(x), float(height - y)) for x, y in places]


def _frame(overlay: Image.Image, swept: list[Image.Image], corner: tuple[int, int], bodies: list[Pixels], caption: str) -> Image.Image:
    """Return one picture: what was swept so far, placed at the map's upper left ``corner``, the road, and the bodies."""
    image = Image.new("RGB", overlay.size, "white")
    for unit in reversed(range(len(swept))):  # the lead unit on top, as on the maps
        image.paste(tuple(round(255 * part) for part in body_fill(unit)), corner, swept[unit])
    image.paste(overlay, mask=overlay)
    draw = ImageDraw.Draw(image)
    for unit, body in enumerate(bodies):
        draw.polygon(body, fill="white", outline=body_colour(unit), width=2 * _OVERSAMPLED)
    draw.text((overlay.width - 12 * _OVERSAMPLED, 8 * _OVERSAMPLED), caption, fill="black", anchor="ra", font_size=14 * _OVERSAMPLED)
    return image.reduce(_OVERSAMPLED)
