"""Templates and vehicles as data: those that ship, users' own, and what is refused."""

import numpy as np
import pytest

from hdvplan.errors import OptionError
from hdvplan.turning.manoeuvre import GuidePoint
from hdvplan.turning.turn import load_template, parse_template, template_names
from hdvplan.vehicle.load import load_vehicle

NAMES = {"aashto-180", "aashto-90", "be-1968", "eu-circle", "eu-kingpin", "map21", "pbs-90", "se-25m", "swing-out"}


def test_every_shipped_template_names_its_source() -> None:
    assert set(template_names()) == NAMES
    for name in template_names():
        template = load_template(name)
        assert template.name == name
        assert template.source


def test_the_european_circle_is_the_directive_s() -> None:
    template = load_template("eu-circle")
    assert (template.radius, template.given.angle, template.given.point) == (12.5, None, GuidePoint.FRONT_CORNER)
    assert {limit.name: limit.value for limit in template.limits} == {"outside_radius": 12.5, "inside_radius": 5.3}


def test_feet_become_metres_once_and_exactly() -> None:
    template = load_template("map21")
    assert template.radius == 41.0 * 0.3048
    assert (template.given.lead_in, template.given.lead_out) == (60.0 * 0.3048, 105.0 * 0.3048)


def test_the_vehicle_s_own_radius_is_the_standard_s() -> None:
    for name, feet in (("P", 21.0), ("WB-62", 41.0), ("CITY-BUS", 37.8)):
        manoeuvre = load_template("aashto-180").manoeuvre(load_vehicle(name))
        assert manoeuvre.radius == pytest.approx(feet * 0.3048, abs=1e-12)  # there and back through a curvature


def test_a_template_of_one_s_own_needs_a_radius_and_an_angle_alone() -> None:
    template = parse_template("[manoeuvre]\nradius = 15\nangle = 120\n[limits]\nswept_width = 6.5\n", default_name="mine")
    assert (template.name, template.radius, template.given.point) == ("mine", 15.0, GuidePoint.FRONT_AXLE)
    assert template.given.angle == pytest.approx(2.0 * np.pi / 3.0)
    assert template.limits[0].value == 6.5


def test_nothing_in_a_template_s_words_steers_a_terminal() -> None:
    words = r'name = "red\u001b[31m"' + "\n" + r'source = "a\nb"' + "\n[manoeuvre]\nradius = 15\nangle = 90\n"
    template = parse_template(words, default_name="mine")
    assert (template.name, template.source) == (r"red\x1b[31m", "a b")


def test_an_unknown_template_suggests_the_nearest() -> None:
    with pytest.raises(OptionError) as caught:
        load_template("eu-circel")
    assert caught.value.hint == "did you mean 'eu-circle'?"
    with pytest.raises(OptionError, match="cannot be read"):
        load_template("none.toml")
