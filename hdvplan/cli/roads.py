"""``hdvplan roads``: what ships, what a road asks of a vehicle, and parametric scenarios as files."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from math import isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hdvplan.cli import extract
from hdvplan.cli.checks import smoothed
from hdvplan.cli.console import ExitCode, note, print_json, print_tables, writing
from hdvplan.cli.help import OUTPUT, ROAD, VEHICLE, Command
from hdvplan.cli.options import JsonOption, OptionsOf, RoadArgument, Room, with_settings
from hdvplan.errors import OptionError
from hdvplan.road.options import RoadOptions
from hdvplan.settings import Setting, choice

if TYPE_CHECKING:
    from hdvplan.judging.fit import Fit
    from hdvplan.road.scenarios import Profile

_SHAPES = ("uturn", "roundabout", "sturn")  # the parametric scenarios

app = typer.Typer(help="List, examine, make and extract roads.", rich_markup_mode=None)
app.command("extract", cls=Command)(extract.extract)


@app.command("list", cls=Command)
def list_roads(json: JsonOption = False) -> int:
    """List the shipped roads and the scenarios."""
    from hdvplan.report.grid import grid

    listed = _listed()
    if json:
        print_json(listed)
        return ExitCode.OK
    radii = ["-" if road["min_radius_m"] is None else f"{road['min_radius_m']:.1f}" for road in listed]
    lengths = ["-" if road["length_m"] is None else f"{road['length_m']:.0f}" for road in listed]
    rows = [(str(road["name"]), *sizes, str(road["kind"])) for road, *sizes in zip(listed, lengths, radii, strict=True)]
    print_tables(grid("roads", ("name", "length [m]", "radius [m]", "kind"), rows, text=("name", "kind"), one_line=("kind",)))
    return ExitCode.OK


@app.command("info", cls=Command)
@with_settings
def road_info(
    road: RoadArgument,
    room: Annotated[Room, OptionsOf(Room, VEHICLE, only=("half_width",))],
    reading: Annotated[RoadOptions, OptionsOf(RoadOptions, ROAD)],
    csv: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write limits and the width that each vehicle needs over s.", rich_help_panel=OUTPUT),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Examine a road, and what preset vehicles need on it.

    This is a forecast. It takes a circle as tight as the road at each place, and asks whether the vehicle, sweeping it evenly, stays
    between the limits. Whether it can be driven, `hdvplan plan` answers.
    """
    from hdvplan.road.load import find_road

    reaches = room.reaches()
    found = find_road(road, reading, limited=reaches is not None)  # bad files are refused before more is loaded
    from hdvplan.fileio import csv_bytes, write_atomically
    from hdvplan.judging.fit import facts_of, fit_of, fit_table
    from hdvplan.report.summary import corners_of, smoothing_of
    from hdvplan.report.tables import facts_table, findings_table, fits_table
    from hdvplan.road.regions import distances
    from hdvplan.vehicle.load import load_vehicle, preset_names

    track = smoothed(found, road, reaches, quiet=False)
    vehicles = [load_vehicle(preset) for preset in preset_names()]
    facts, fits = facts_of(track), [fit_of(track, vehicle) for vehicle in vehicles]
    if csv is not None:
        with writing(f"{csv}", "choose another file with --csv"):
            write_atomically(csv, csv_bytes(fit_table(track, vehicles)))
    if json:
        print_json(
            {
                "name": facts.name,
                "length_m": facts.length,
                "closed": facts.closed,
                "max_curvature_per_m": facts.max_curvature,
                "max_curvature_s_m": facts.max_curvature_s,
                "point_spacing_m": facts.point_spacing,
                "narrowest_m": facts.narrowest,
                "narrowest_s_m": facts.narrowest_s,
                "regions": [
                    {"region": str(region.kind), "name": region.label, "distance_m": float(apart)}
                    for region, apart in zip(track.regions, distances(track.path, track.regions), strict=True)
                ],
                "smoothing": smoothing_of(track.smoothing),
                "corners": corners_of(track),
                "notice": track.notice,
                "notes": list(track.notes),
                "vehicles": [_fit_json(fit) for fit in fits],
            }
        )
        return ExitCode.OK
    print_tables(facts_table(track, facts), fits_table(fits), *findings_table(fits))
    return ExitCode.OK


@dataclass(frozen=True)
class Turn:
    """A parametric road, as options describe it; what is not given is the published scenario's."""

    radius: Annotated[float | None, Setting("Smallest radius [m]; negative turns right.", "M")] = None
    max_curvature: Annotated[float | None, Setting("Largest curvature [1/m]; negative turns right.", "K")] = None
    sharpness: Annotated[float | None, Setting("Change of curvature per metre [1/m^2].", "C")] = None
    angle: Annotated[float | None, Setting("Angle of each turn [deg].", "DEG")] = None
    lead_in: Annotated[float, Setting("Straight before the first turn [m].", "M")] = 50.0
    lead_out: Annotated[float, Setting("Straight after the last turn [m].", "M")] = 50.0
    half_width: Annotated[float | None, Setting("Also write limits at M to either side [m].", "M")] = None

    def curvature(self) -> float | None:
        """Return the largest curvature [1/m], if any is given; an ``OptionError`` where it is given twice, or is none."""
        if self.radius is not None and self.max_curvature is not None:
            msg = "--radius and --max-curvature say the same thing; give one"
            raise OptionError(msg)
        name, given = ("radius", self.radius) if self.max_curvature is None else ("max-curvature", self.max_curvature)
        if given is not None and (not isfinite(given) or given == 0.0):
            msg = f"--{name} must be a finite number other than 0, not {given:g}"
            raise OptionError(msg)
        return 1.0 / given if given is not None and name == "radius" else given

    def profile(self, shape: str) -> Profile:
        """Return arclengths and curvatures of a scenario; an ``OptionError`` where a number is none that a turn can have."""
        from hdvplan.road.scenarios import sturn_profile, turn_profile, uturn_profile

        curvature = self.curvature()
        for name, value in (("sharpness", self.sharpness), ("angle", self.angle)):
            if value is not None and not (isfinite(value) and value > 0.0):
                msg = f"--{name} must be a positive number, not {value:g}"
                raise OptionError(msg)
        if shape == "sturn":
            k, rate = curvature or 0.06, self.sharpness or 0.01
            constant = 10.0 if self.angle is None else radians(self.angle) / abs(k) - abs(k) / rate
            return sturn_profile(k, rate, constant=constant, lead_in=self.lead_in, lead_out=self.lead_out)
        published, ramp = (0.060, 20.9) if shape == "uturn" else (1.0 / 17.88, 5.5)
        k = curvature or published
        ramp = ramp if self.sharpness is None else abs(k) / self.sharpness
        if shape == "uturn":
            return uturn_profile(k, ramp, angle=radians(self.angle or 180.0), lead_in=self.lead_in, lead_out=self.lead_out)
        constant = 135.0 if self.angle is None else radians(self.angle) / abs(k) - ramp
        return turn_profile(k, ramp, constant, self.lead_in, self.lead_out)


@app.command("make", cls=Command)
@with_settings
def make_road(
    shape: Annotated[str, typer.Argument(metavar="NAME", help="uturn, roundabout or sturn.")],
    *,
    turn: Annotated[Turn, OptionsOf(Turn, "Options")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="The file [default: NAME.csv]; - for stdout.", rich_help_panel=OUTPUT)
    ] = None,
    json: JsonOption = False,
) -> int:
    """Write a parametric road as a file for `hdvplan plan`.

    The file is a curvature profile (CSV: s,kappa). Without options it is the published scenario of that name.
    """
    from hdvplan.fileio import write_atomically
    from hdvplan.road.limits import Limits

    if json and out == Path("-"):
        msg = "--json and --out - both write to stdout"
        raise OptionError(msg)
    profile, half_width = turn.profile(choice("NAME", shape, _SHAPES)), turn.half_width
    if half_width is not None:
        Limits.constant(half_width, half_width, 1.0)  # refuses what cannot be a limit
    s, kappa = profile
    extra, header = ("", "s,kappa") if half_width is None else (f",{half_width!r},{half_width!r}", "s,kappa,left,right")
    text = "".join(f"{line}\n" for line in (header, *(f"{at!r},{k!r}{extra}" for at, k in zip(s, kappa, strict=True))))
    sharpest = max(map(abs, kappa))
    if out == Path("-"):
        sys.stdout.write(text)
        return ExitCode.OK
    path = out or Path(f"{shape}.csv")
    with writing(f"{path}", "choose another file with --out"):
        write_atomically(path, text.encode())
    if json:
        print_json({"file": str(path), "length_m": s[-1], "max_curvature_per_m": sharpest})
    else:
        note(f"wrote {path}: {s[-1]:.1f} m, radius {1 / sharpest:.2f} m")
    return ExitCode.OK


def _listed() -> list[dict[str, object]]:
    """Return what ships, with the numbers that the files carry; smoothing all of them would take long."""
    import json

    from hdvplan.road.scenarios import SCENARIOS, shipped

    def read(file: Path) -> Any:  # noqa: ANN401 - what json.loads returns
        return json.loads(file.read_text(encoding="utf-8"))

    def entry(source: str, name: str, length: object, radius: object, kind: str, place: str | None = None) -> dict[str, object]:
        return {"name": name, "place": place, "source": source, "length_m": length, "min_radius_m": radius, "kind": kind}

    roads = []
    for name, file in shipped().items():
        about = read(file)["properties"]
        roads.append(entry("OpenStreetMap", name, about["length_m"], about["min_radius_6m_m"], about["kind"], about["name"]))
    for name, file in shipped("examples").items():
        about = read(file)["features"][0]["properties"]
        kind = "drive of several legs" if "leg" in about else "made-up place with obstacles"
        roads.append(entry("example", name, about["length_m"], about["min_radius_m"], kind))
    kind = "roundabout, OpenDRIVE: choose the way, such as --road-ids 0,5"
    roads += [entry("OpenDRIVE", name, None, None, kind) for name in shipped("opendrive")]
    for scenario in SCENARIOS.values():
        s, curvature = scenario.profile
        roads.append(entry("scenario", scenario.name, s[-1], 1.0 / max(map(abs, curvature)), "scenario"))
    return roads


def _fit_json(fit: Fit) -> dict[str, object]:
    from hdvplan.judging.fit import finding_json

    return {
        "vehicle": fit.vehicle,
        "half_width_m": fit.half_width,
        "tighter_than_balanced_circle": fit.saturated,
        "long_enough": fit.long_enough,
        "spare_m": fit.spare,
        "spare_s_m": fit.spare_s,
        "fits": fit.fits,
        "findings": [finding_json(finding) for finding in fit.findings],
    }
