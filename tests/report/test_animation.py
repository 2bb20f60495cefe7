from __future__ import annotations

from io import BytesIO

import numpy as np
from PIL import Image

from hdvplan.jit import FloatArray
from hdvplan.report.animation import film_bytes
from hdvplan.report.result import Result


def close_to(image: FloatArray, colour: tuple[int, int, int]) -> int:
    """Return the number of pixels of a colour; the film's palette is coarse."""
    return int(np.sum(np.max(np.abs(image - np.array(colour)), axis=-1) < 30.0))


def test_the_film_shows_the_bodies_driving_and_what_they_sweep(trailer: Result) -> None:
    film = Image.open(BytesIO(film_bytes(trailer)))
    frames = int(getattr(film, "n_frames", 1))
    assert film.format == "GIF"
    assert abs(frames - trailer.drive.road.path.length / 0.75) < 3.0  # a frame every 0.75 m
    seen = []
    for number in (0, frames // 2, frames - 1):
        film.seek(number)
        seen.append(np.asarray(film.convert("RGB"), dtype=float))
    swept = [close_to(image, (153, 199, 224)) for image in seen]
    assert swept[0] < swept[1] < swept[2]  # it grows
    for image in seen:
        assert close_to(image, (0, 114, 178)) > 20  # the tractor's outline
        assert close_to(image, (230, 159, 0)) > 20  # the trailer's


def test_a_long_road_s_film_shows_its_tightest_places_only(long: Result) -> None:
    film = Image.open(BytesIO(film_bytes(long)))
    frames = int(getattr(film, "n_frames", 1))
    assert abs(frames - 2 * 50.0 / 0.75) < 4.0  # two stretches of 50 m
