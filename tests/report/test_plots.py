"""Pictures and films: what they show of a result, and their style."""

from __future__ import annotations

import itertools
from dataclasses import replace
from io import BytesIO

import matplotlib as mpl
import numpy as np
import pytest
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar  # type: ignore[import-untyped] # Matplotlib types only its core
from PIL import Image

from hdvplan.arrays import FloatArray
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.verdict import verdict_of, verdict_title
from hdvplan.report import BREACH, INK
from hdvplan.report.animation import _map, _poses, film_bytes, frames_of
from hdvplan.report.atlas import draw_atlas
from hdvplan.report.compared import compared_figure
from hdvplan.report.layers import Drawn, Layer
from hdvplan.report.maps import draw_features
from hdvplan.report.plots import plan_figure
from hdvplan.report.rooms import Window
from hdvplan.report.style import SLIDE_IN, figure_bytes, styled, write_beside
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from tests.report.conftest import driven, once

drawn = once(plan_figure)


def labels(figure: Figure) -> set[str]:
    return {axes.get_ylabel().split(" [")[0] for axes in figure.axes}


def maps(figure: Figure) -> list[Axes]:
    """Return what is drawn to scale."""
    return [axes for axes in figure.axes if axes.get_aspect() == 1.0]


def metres_an_inch(axes: Axes) -> float:
    """Return the scale of drawn axes along x."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    return float(np.ptp(axes.get_xlim()) / (axes.get_window_extent().width / figure.dpi))


def test_a_single_body_has_a_map_an_envelope_and_a_curvature(bus: Result) -> None:
    figure = drawn(bus)
    assert labels(figure) == {"", "reach", "curvature"}
    assert figure.axes[0].get_aspect() == 1.0  # to scale
    assert figure.get_suptitle() == verdict_title(bus, verdict_of(bus))
    assert any("RTI" in text.get_text() and "geometric" in text.get_text() for text in figure.texts)


def test_an_articulated_vehicle_shows_its_articulation_and_the_road_its_notice(trailer: Result) -> None:
    figure = drawn(trailer)
    assert labels(figure) == {"", "reach", "curvature", "articulation"}
    assert figure.get_supxlabel() == "© the surveyors"


def test_a_long_road_is_an_overview_with_its_tightest_places_enlarged(long: Result) -> None:
    figure = drawn(long)
    assert len(maps(figure)) == 3
    assert [axes.get_title(loc="left")[:8] for axes in maps(figure)[1:]] == ["A: reach", "B: reach"]


def test_enlargements_beside_a_tall_road_have_titles_no_wider_than_they_are() -> None:
    bend = from_curvature(np.array([0.0, 0.1, 31.0, 31.1, 150.0]), np.array([0.0, 0.05, 0.05, 0.0, 0.0]))
    windows = tuple(
        Window(s, s + 20.0, label, f"clearance 0.61 m at s = 214{label} m") for s, label in zip((0, 40, 80, 120), "ABCD", strict=True)
    )
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    draw_atlas(figure.subfigures(1, 2, width_ratios=[1.35, 1.0], squeeze=False)[0, 0], driven(Road("tall", bend), "bus"), windows)
    figure.draw_without_rendering()
    enlarged = [axes for axes in maps(figure) if axes.get_title(loc="left")]
    assert len(enlarged) == 4
    for axes in enlarged:
        assert axes._left_title.get_window_extent().width < axes.get_window_extent().width  # type: ignore[attr-defined] # Matplotlib's own


def test_enlargements_are_all_to_one_scale_and_have_a_bar_that_says_it(long: Result, kerbed: Result) -> None:
    for result in (long, kerbed):
        figure = drawn(result)
        figure.draw_without_rendering()
        scales = [metres_an_inch(axes) for axes in maps(figure)[1:]]
        assert scales == pytest.approx([scales[0]] * len(scales), rel=1e-6)
        for axes in maps(figure):
            (bar,) = [child for child in axes.get_children() if isinstance(child, AnchoredSizeBar)]
            metres = float(bar.txt_label.get_text().split()[0])
            inches = bar.size_bar.get_children()[0].get_window_extent().width / figure.dpi
            # The stroke's own width is part of the extent: 2.2 points.
            assert inches == pytest.approx(metres / metres_an_inch(axes), abs=2.5 / 72.0)


def test_the_title_is_the_answer_in_its_colour(kerbed: Result, trailer: Result) -> None:
    for result, colour in ((kerbed, BREACH), (trailer, INK)):
        suptitle = drawn(result).texts
        (title,) = [text for text in suptitle if text.get_text() == verdict_title(result, verdict_of(result))]
        assert title.get_color() == colour


def test_a_broken_limit_is_drawn_with_its_depth_on_the_map_and_over_s(kerbed: Result) -> None:
    figure = drawn(kerbed)
    deepest = f"{kerbed.balance.violation:.2f} m"
    road, enlarged = maps(figure)[0], maps(figure)[1:]
    reach = next(axes for axes in figure.axes if axes.get_ylabel().startswith("reach"))
    assert deepest in [text.get_text() for axes in enlarged for text in axes.texts]
    assert f"{deepest} beyond" in [text.get_text() for text in reach.texts]
    names = road.get_legend_handles_labels()[1]
    assert {"beyond a limit", "limits", "limits of overhangs"} <= set(names)


def test_the_legend_says_what_the_bands_of_enlarged_stretches_are(kerbed: Result, long: Result) -> None:
    for result in (kerbed, long):
        names = [axes.get_legend_handles_labels()[1] for axes in drawn(result).axes if axes.get_ylabel().startswith("reach")]
        assert "enlarged on maps" in names[0]


def test_what_is_tight_by_geometry_is_seen_over_enlarged_stretches(kerbed: Result) -> None:
    assert kerbed.fit.findings
    (reach,) = [axes for axes in drawn(kerbed).axes if axes.get_ylabel().startswith("reach")]
    spans = {to_hex(patch.get_facecolor()): patch.get_zorder() for patch in reach.patches}
    assert spans[BREACH.lower()] > max(order for colour, order in spans.items() if colour != BREACH.lower())


def test_limits_far_away_shrink_neither_map_nor_envelope(bus: Result) -> None:
    road = bus.drive.road.with_limits(250.0, 250.0)
    figure = plan_figure(result_of(replace(bus.drive, road=road), solver="riccati", objective="geometric"))
    figure.draw_without_rendering()
    reach = next(axes for axes in figure.axes if axes.get_ylabel().startswith("reach"))
    assert np.ptp(reach.get_ylim()) < 10.0
    assert "of overhangs" not in reach.get_legend_handles_labels()[1]  # they have no limits of their own


@pytest.mark.parametrize(
    ("names", "label"), [(["bus on short"] * 2, "bus on short"), (["kiosk", "tree"], "obstacle"), ([None], "obstacle")]
)
def test_obstacles_of_one_name_have_it_in_the_legend(names: list[str | None], label: str) -> None:
    axes = Figure().add_subplot()
    draw_features(
        axes,
        [Drawn(Layer.OBSTACLES, shapely.box(x, 0.0, x + 0.5, 1.0), {"name": name}) for x, name in enumerate(names)],
        shapely.box(0, 0, 9, 9),
    )
    assert axes.get_legend_handles_labels()[1] == [label]


def test_several_vehicles_are_shown_where_it_is_tight_and_on_the_whole_road(bus: Result, trailer: Result) -> None:
    figure = compared_figure([bus, trailer])
    assert "overview" in [axes.get_title(loc="left") for axes in figure.axes]
    (reaches,) = [axes for axes in figure.axes if axes.get_ylabel().startswith("reach")]
    assert {bus.drive.vehicle.name, trailer.drive.vehicle.name} <= set(reaches.get_legend_handles_labels()[1])


def test_titles_of_maps_beside_each_other_keep_apart_however_long_the_vehicle_s_name(kerbed: Result, bus: Result) -> None:
    long = replace(kerbed.drive, vehicle=replace(kerbed.drive.vehicle, name="truck-with-dolly-and-semitrailer-of-1998"))
    figure = compared_figure([replace(kerbed, drive=long), bus])
    figure.draw_without_rendering()
    titles = [text for text in figure.findobj(Text) if text.get_text().startswith(("A:", "B:", "overview"))]
    assert len(titles) == 3
    pairs = itertools.combinations([title.get_window_extent() for title in titles], 2)
    assert not any(one.overlaps(other) for one, other in pairs)


@pytest.fixture(scope="module")
def crowded() -> Result:
    """A tractor-trailer on a road of 200 m with limits for overhangs, which it breaks, and a lamp post in its way."""
    road = Road("crowded", from_curvature(np.array([0.0, 60.0, 70.0, 100.0, 200.0]), np.array([0.0, 0.0, 0.06, 0.0, 0.0])))
    ends, two = np.array([0.0, 200.0]), np.array([2.0, 2.0])
    plan = driven(replace(road, limits=Limits(ends, two, -two, two + 0.2, -two - 0.2)), "tractor-trailer-24m")
    x, y = (float(of) for of in road.path.to_plane(40.0, 0.3))
    post = Region(Kind.OBSTACLE, shapely.Point(x, y).buffer(0.1), "lamp post")
    drive = replace(plan.drive, road=replace(plan.drive.road, regions=(post,)))
    return result_of(drive, solver="riccati", objective="geometric")


@pytest.mark.slow
def test_every_legend_lies_within_its_picture(crowded: Result, kerbed: Result, trailer: Result) -> None:
    for figure in (drawn(crowded), drawn(kerbed), drawn(trailer), compared_figure([crowded, kerbed])):
        figure.draw_without_rendering()
        for legend in figure.findobj(Legend):
            extent, whole = legend.get_window_extent(), figure.bbox
            assert whole.x0 <= extent.x0 < extent.x1 <= whole.x1
            assert whole.y0 <= extent.y0 < extent.y1 <= whole.y1


def test_what_is_written_into_a_map_lies_within_it() -> None:
    axes = Figure().add_subplot()
    axes.set(xlim=(0.0, 10.0), ylim=(0.0, 10.0))
    for x, y in ((0.1, 5.0), (9.9, 9.9), (5.0, 0.0)):
        write_beside(axes, "2.50 m", np.array([x, y]), np.array([x, y]) - 5.0, [], INK)
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    for text in axes.texts:
        own = Text.get_window_extent(text)
        assert axes.bbox.x0 < own.x0 < own.x1 < axes.bbox.x1
        assert axes.bbox.y0 < own.y0 < own.y1 < axes.bbox.y1


def test_an_obstacle_that_is_hit_is_marked_and_named_however_small(crowded: Result) -> None:
    (near,) = [one for one in crowded.approaches if one.obstacle.label == "lamp post"]
    assert near.distance < 0.0
    main = maps(drawn(crowded))[0]
    assert f"{-near.distance:.2f} m into lamp post" in [text.get_text() for text in main.texts]
    handles = dict(zip(*reversed(main.get_legend_handles_labels()), strict=True))
    assert np.asarray(handles["obstacle hit"].get_xydata()).tolist() == [[near.x, near.y]]


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
