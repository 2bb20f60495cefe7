from __future__ import annotations

import matplotlib as mpl
from matplotlib.figure import Figure

from hdvplan.report.style import figure_bytes, styled


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
