from __future__ import annotations

from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.report.colours import BODY_COLOURS, BREACH, INK
from hdvplan.report.style import body_dark, body_fill, figure_bytes, styled

# Machado, Oliveira and Fernandes, A Physiologically-based Model for Simulation of Color Vision Deficiency (2009), severity 1; linear RGB.
SIGHT = {
    "all colours": np.eye(3),
    "no red": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    "no green": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]),
    "no blue": np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]),
}
TO_XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])  # sRGB, D65
NOTICED = 2.3  # of CIE 1976 colour differences: just noticeable


def lab(rgb: tuple[float, float, float], sight: FloatArray) -> FloatArray:
    """Return CIE L*a*b* of an sRGB colour as somebody sees it."""
    given = np.array(rgb)
    linear = np.where(given <= 0.04045, given / 12.92, ((given + 0.055) / 1.055) ** 2.4)
    x, y, z = (TO_XYZ @ np.clip(sight @ linear, 0.0, 1.0)) / TO_XYZ.sum(axis=1)
    f = [value ** (1.0 / 3.0) if value > 0.008856 else 7.787 * value + 16.0 / 116.0 for value in (x, y, z)]
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_are_told_apart_by_whoever_looks(sight: str) -> None:
    lines, fills = [to_rgb(colour) for colour in (*BODY_COLOURS, BREACH, INK)], [body_fill(unit) for unit in range(3)]
    for colours, times in ((lines, 3.0), (fills, 2.0)):  # fills are large, and three at most in the vehicles that ship
        for one, other in combinations(colours, 2):
            assert np.linalg.norm(lab(one, SIGHT[sight]) - lab(other, SIGHT[sight])) > times * NOTICED
    for unit in range(len(BODY_COLOURS)):  # wheel tracks on what is swept
        assert lab(body_fill(unit), SIGHT[sight])[0] - lab(body_dark(unit), SIGHT[sight])[0] > 20.0  # in grey as well


def test_the_style_stays_inside_its_block() -> None:
    before = dict(mpl.rcParams)
    with styled():
        assert mpl.rcParams["pdf.fonttype"] == 42
    assert dict(mpl.rcParams) == before


def test_names_in_pictures_are_no_tex_though_the_user_s_settings_ask_for_it() -> None:
    with mpl.rc_context({"text.usetex": True}):
        with styled():
            figure = Figure()
            figure.text(0.5, 0.5, r"\input{/etc/passwd}")
        drawn = figure_bytes(figure, "svg")
    assert rb"\input{/etc/passwd}" in drawn
