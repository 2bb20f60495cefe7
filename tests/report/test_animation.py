from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from hdvplan.arrays import FloatArray
from hdvplan.judging.result import Result
from hdvplan.report.animation import _map, _poses, film_bytes, frames_of
from hdvplan.report.rooms import Window


def close_to(image: FloatArray, colour: tuple[int, int, int]) -> int:
    """Return the number of pixels of a colour; the film's palette is coarse."""
    return int(np.sum(np.max(np.abs(image - np.array(colour)), axis=-1) < 30.0))


@pytest.mark.slow
def test_the_film_shows_the_bodies_driving_and_what_they_sweep(trailer: Result) -> None:
    window = Window(90.0, 120.0)
    frames = [frame for frame, _ in frames_of(_map(trailer, window), _poses(trailer, window))]
    assert abs(len(frames) - 30.0 / 0.75) < 2.0  # a frame every 0.75 m
    seen = [np.asarray(frames[number].convert("RGB"), dtype=float) for number in (0, 20, -1)]
    swept = [close_to(image, (153, 199, 224)) for image in seen]
    assert swept[0] < swept[1] < swept[2]  # it grows
    for image in seen:
        assert close_to(image, (0, 114, 178)) > 20  # the tractor's outline
        assert close_to(image, (230, 159, 0)) > 20  # the trailer's
        assert tuple(image[2, 2]) == (255.0, 255.0, 255.0)  # the paper is white; where labels are differs with Matplotlib


@pytest.mark.slow
def test_a_long_road_s_film_shows_its_tightest_places_only(long: Result) -> None:
    film = Image.open(BytesIO(film_bytes(long)))
    assert film.format == "GIF"
    assert abs(int(getattr(film, "n_frames", 1)) - 2 * 50.0 / 0.75) < 4.0  # two stretches of 50 m
