from __future__ import annotations

import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hdvplan.report.drawing import vehicle_figure
from hdvplan.vehicle.load import load_vehicle, preset_names


def written(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts if text.get_text()]


@pytest.mark.parametrize("name", preset_names())
def test_every_dimension_of_a_vehicle_stands_in_its_drawing(name: str) -> None:
    vehicle = load_vehicle(name)
    texts = written(vehicle_figure(vehicle))
    assert f"{vehicle.reach_ahead + vehicle.reach_behind:.2f} m" in texts
    for unit in vehicle.units:
        for length in (unit.wheelbase, unit.rear_overhang, unit.front_overhang):
            assert length == 0.0 or f"{length:.2f}" in texts
        assert unit.hitch_offset == 0.0 or f"hitch {unit.hitch_offset:.2f}" in texts


def test_bodies_are_drawn_to_scale_one_behind_the_other() -> None:
    vehicle = load_vehicle("truck-dolly-semitrailer")
    figure = vehicle_figure(vehicle)
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    bodies = [patch for patch in axes.patches if isinstance(patch, Rectangle) and patch.get_height() > 2.0]
    ends = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in bodies]
    assert ends[0] == pytest.approx((-3.40, 6.70))
    assert ends[2][0] == pytest.approx(-vehicle.reach_behind)
    assert ends[2][1] - ends[2][0] == pytest.approx(13.59)
    low, high = sorted(axes.get_xlim())
    assert low < -vehicle.reach_behind
    assert high > vehicle.reach_ahead


def test_what_steers_is_said_in_words() -> None:
    figure = vehicle_figure(load_vehicle("semitrailer-steered"))
    legend = " ".join(text.get_text() for text in figure.texts)
    assert "steered by 0.50 of the articulation angle, to 20°" in legend
    assert "Directive 96/53/EC" in legend
    active = " ".join(text.get_text() for text in vehicle_figure(load_vehicle("semitrailer-active")).texts)
    assert "axle steered by the plan, aiming at 0.60 of the articulation angle, to 20°" in active
