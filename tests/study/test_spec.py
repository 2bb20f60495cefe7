"""What a study's file may say, and what is told of one that says something else."""

from __future__ import annotations

from pathlib import Path

import pytest

from hdvplan.errors import HdvplanError, OptionError
from hdvplan.planning.settings import Scheme
from hdvplan.study.cells import cells_of
from hdvplan.study.spec import Width, read_study, study_of

BASE: dict[str, object] = {"roads": ["uturn"], "vehicles": ["bus"]}
OBJECTIVE = "from hdvplan.planning.objectives import objective_named\n\n\ndef mine():\n    return objective_named('geometric')\n"


def test_a_study_is_every_combination_of_what_it_names(folder: Path, tiny: dict[str, object]) -> None:
    study = study_of(tiny | {"schemes": ["rti", "sqp"], "objectives": ["geometric", "lead-axle"]}, folder)
    cells = list(cells_of(study))
    assert len(study) == len(cells) == 2 * 2 * 2 * 2 * 2
    told = {(c.road.label, c.variant.vehicle.name, c.width, c.objective, c.setup.settings.scheme) for c in cells}
    assert len(told) == len(cells)
    assert ("lane", "bus", Width(3.5, 3.5), "lead-axle", Scheme.SQP) in told


def test_the_shortest_study_plans_as_plan_does_without_options() -> None:
    (cell,) = cells_of(study_of(BASE))
    assert (cell.width, cell.objective, cell.solver, cell.prove, cell.need) == (None, "geometric", "riccati", False, False)
    assert cell.reading.max_curvature == 1.25 * cell.variant.vehicle.max_curvature


@pytest.mark.parametrize("name", ["half_width", "half_widths", "objective"])
def test_an_entry_of_the_study_among_its_settings_is_sent_to_the_top_of_the_file(name: str) -> None:
    with pytest.raises(OptionError, match=rf"settings: unknown entry '{name}'") as raised:
        study_of(BASE | {"settings": {name: 3.0}})
    assert raised.value.hint == f"write {name.removesuffix('s')}s at the top of the file, before all [tables]"


def test_roads_are_files_globs_folders_shipped_names_and_lines_of_files(folder: Path) -> None:
    (folder / "lines").mkdir()
    for name in ("b", "a"):
        (folder / "lines" / f"{name}.geojson").write_text((folder / "lane.geojson").read_text(encoding="utf-8"), encoding="utf-8")
    entries = ["*.csv", "lines", "monaco_fairmont_hairpin", "uturn", {"road": "lane.geojson", "name": "lane"}]
    study = study_of(BASE | {"roads": entries}, folder)
    assert [road.label for road in study.roads] == ["bend", "a", "b", "monaco_fairmont_hairpin", "uturn", "lane:lane"]
    assert study.roads[1].digest == study.roads[2].digest != study.roads[0].digest


def test_a_road_may_be_in_a_unit_of_its_own(folder: Path) -> None:
    roads = ["bend.csv", {"road": "uturn", "unit": "ft"}]
    study = study_of(BASE | {"roads": roads, "settings": {"unit": "cm"}}, folder)
    assert [cell.reading.unit for cell in cells_of(study)] == ["cm", "ft"]
    with pytest.raises(OptionError, match="unit must be mm, cm, m, ft or in, not 'mile'"):
        study_of(BASE | {"roads": [{"road": "uturn", "unit": "mile"}]}, folder)


def test_roads_of_one_name_are_told_apart_by_their_files(folder: Path) -> None:
    (folder / "north").mkdir()
    (folder / "north" / "bend.csv").write_text("s,kappa\n0,0\n80,0\n", encoding="utf-8")
    study = study_of(BASE | {"roads": ["bend.csv", "north/bend.csv"]}, folder)
    assert [road.label for road in study.roads] == [str(folder / "bend.csv"), str(folder / "north" / "bend.csv")]


@pytest.mark.parametrize(
    ("given", "values"),
    [([3.4, 3.6], [3.4, 3.6]), ("3.4..3.8 in 3", [3.4, 3.6, 3.8]), ("3.4..3.8", [3.4, 3.5, 3.6, 3.7, 3.8]), (3.5, [3.5])],
)
def test_a_vehicle_s_parameter_takes_the_values_of_a_list_or_a_range(given: object, values: list[float]) -> None:
    study = study_of({"roads": ["uturn"], "vehicles": ["bus", "tractor-trailer"], "vary": {"tractor-trailer.wheelbase": given}})
    assert study.varied == ("tractor-trailer.wheelbase",)
    swept = [variant for variant in study.vehicles if variant.varied]
    assert [variant.vehicle.units[0].wheelbase for variant in swept] == values
    assert [dict(variant.varied)["tractor-trailer.wheelbase"] for variant in swept] == values
    assert len(study.vehicles) == 1 + len(values)


def test_parameters_of_trailers_and_of_the_steering_vary_too_with_or_without_quotes() -> None:
    vary = {"tractor-trailer": {"2": {"wheelbase": [8.0, 9.0]}}, "tractor-trailer.max_curvature": [0.1, 0.12]}
    study = study_of({"roads": ["uturn"], "vehicles": ["tractor-trailer"], "vary": vary})
    got = [(variant.vehicle.units[1].wheelbase, variant.vehicle.max_curvature) for variant in study.vehicles]
    assert got == [(8.0, 0.1), (8.0, 0.12), (9.0, 0.1), (9.0, 0.12)]


def test_settings_that_are_lists_are_combined(folder: Path) -> None:
    settings = {"clearance": [0.0, 0.2], "reverse": [False, True], "offset": -1.75, "bias": "centre", "pass": "left"}
    settings |= {"smooth": 2, "proof": True}
    study = study_of(BASE | {"settings": settings, "half_widths": [3.5]}, folder)
    assert [(m.settings.clearance, m.reverse) for m in study.setups] == [(0.0, False), (0.0, True), (0.2, False), (0.2, True)]
    assert {(m.offset, m.bias, m.side) for m in study.setups} == {(-1.75, "centre", "left")}
    assert (study.reading.smooth, study.prove) == (2.0, True)


def test_a_clearance_is_metres_or_the_largest_that_can_be_kept(folder: Path) -> None:
    study = study_of(BASE | {"settings": {"clearance": [0.0, "max"]}}, folder)
    assert [(setup.settings.clearance, setup.clearest) for setup in study.setups] == [(0.0, False), (0.0, True)]
    assert len({cell.key for cell in cells_of(study)}) == len(study)
    with pytest.raises(OptionError, match="clearance must be a number of metres or 'max'"):
        study_of(BASE | {"settings": {"clearance": "most"}}, folder)
    with pytest.raises(OptionError, match="need = true finds the least room with a clearance that is given"):
        study_of(BASE | {"settings": {"clearance": ["max"]}, "need": True}, folder)


def test_left_and_right_are_pairs() -> None:
    assert study_of(BASE | {"left": [3.0, 3.5], "right": [2.5, 2.5]}).widths == (Width(3.0, 2.5), Width(3.5, 2.5))
    assert study_of(BASE | {"left": [2.0, 2.5], "right": [3.0, 3.5]}).widths == (Width(2.0, 3.0), Width(2.5, 3.5))


def test_roads_biases_and_code_lie_beside_the_study_that_names_them(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "elsewhere").mkdir()
    (folder / "study.toml").write_text('roads = ["bend.csv"]\nvehicles = ["bus"]\n', encoding="utf-8")
    (folder / "bias.csv").write_text("s,bias\n0,0.1\n60,0.2\n", encoding="utf-8")
    (folder / "mine.py").write_text(OBJECTIVE, encoding="utf-8")
    monkeypatch.chdir(folder / "elsewhere")
    study = study_of(BASE | {"objectives": ["mine.py:mine"], "settings": {"bias": "bias.csv"}}, folder)
    assert study.setups[0].bias == str(folder / "bias.csv")
    assert study.objectives == (f"{folder / 'mine.py'}:mine",)
    assert read_study(folder / "study.toml").roads[0].source == str(folder / "bend.csv")


@pytest.mark.slow
def test_a_study_of_too_many_cells_is_refused() -> None:
    widths = [1.0 + 1e-5 * number for number in range(100_000)]
    with pytest.raises(HdvplanError, match="100100000 cells; 100000000 are the most"):
        study_of(BASE | {"half_widths": widths, "settings": {"smoothness": list(range(1, 1002))}})


def test_a_file_that_cannot_be_read_as_a_study_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HdvplanError, match="cannot be read"):
        read_study(tmp_path / "none.toml")
    (tmp_path / "study.toml").write_text("vary.bus.wheelbase = 3.4..3.8\n", encoding="utf-8")
    with pytest.raises(HdvplanError, match="is not valid TOML"):
        read_study(tmp_path / "study.toml")


def test_two_vehicles_of_one_name_are_refused(folder: Path) -> None:
    from hdvplan.vehicle.load import preset_text  # noqa: PLC0415 - this test alone copies one

    (folder / "copy.toml").write_text(preset_text("bus"), encoding="utf-8")
    with pytest.raises(HdvplanError, match="two vehicles of the study are called 'bus'"):
        study_of(BASE | {"vehicles": ["bus", "copy.toml"]}, folder)
