"""What is fuzzed where only reading is watched: the files of ``targets``, studies and suites, each with the function that reads it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType

from hdvplan.bench.comparing.sides import read_side
from hdvplan.bench.suite import read_suite, suite_of
from hdvplan.errors import HdvplanError
from hdvplan.planning.bias import bias_named
from hdvplan.report.planfiles import read_plan
from hdvplan.road.line import RoadOptions
from hdvplan.road.load import find_road
from hdvplan.study.spec import read_study
from hdvplan.vehicle.load import load_vehicle
from tests.fuzz import seeds
from tests.fuzz.targets import Target, make_targets, warnings_raised

_WATCHED = (
    "hdvplan.road.",
    "hdvplan.vehicle.",
    "hdvplan.planning.bias",
    "hdvplan.report.planfiles",
    "hdvplan.bench.comparing.sides",
    "hdvplan.bench.suite",
    "hdvplan.study.spec",
    "hdvplan.study.inputs",
)
_READ: dict[str, Callable[[Path], object]] = {
    "truck.toml": load_vehicle,
    "bias.csv": lambda path: bias_named(str(path), None),
    "suite.toml": lambda path: suite_of(read_suite(path)),
    "study.toml": read_study,
    "lane.xodr": lambda path: find_road(path, RoadOptions(road_ids="2", lane=0)),  # as ``seeds.road_options`` says
}
_FOLDERS: dict[str, Callable[[Path], object]] = {"plan": read_plan, "run": read_side}


@dataclass(frozen=True)
class Reading:
    """A file and what reads it; ``command`` is the target that is tried with what was found, None where there is none."""

    path: Path
    read: Callable[[Path], object]
    command: Target | None

    def fault(self, content: bytes) -> str:
        """Read the file with other content, and return what is wrong with how that ends; "" where nothing is."""
        before = self.path.read_bytes()
        self.path.write_bytes(content)
        try:
            with warnings_raised():
                self.read(self.path)
        except HdvplanError as error:
            return "" if str(error).strip() else f"{type(error).__name__} that says nothing"
        except OSError as error:
            return "" if error.strerror else f"OSError: {error}"
        except Exception as error:  # noqa: BLE001 - whatever else a reader raises would be exit 70
            return f"{type(error).__name__}: {error}"
        finally:
            self.path.write_bytes(before)
        return ""


def make_readings(folder: Path) -> list[Reading]:
    """Write all files into a folder, and return what reads them."""
    targets = make_targets(folder)
    readings = [Reading(target.path, _reader(target.path), target) for target in targets]
    (folder / "study.toml").write_text(seeds.STUDY, encoding="utf-8")
    return readings + [Reading(folder / name, _READ[name], None) for name in ("study.toml", "suite.toml")]


def watched() -> Iterator[FunctionType]:
    """Yield the readers' functions: in plain Python, and written in these modules."""
    for name, module in list(sys.modules.items()):
        if name.startswith(_WATCHED):
            members = [(owner, member) for owner in (module, *_classes(module)) for member in vars(owner).values()]
            yield from (one for _, one in members if isinstance(one, FunctionType) and one.__code__.co_filename == module.__file__)


def _classes(module: object) -> list[type]:
    return [member for member in vars(module).values() if isinstance(member, type) and member.__module__ == getattr(module, "__name__", "")]


def _reader(path: Path) -> Callable[[Path], object]:
    if path.parent.name in _FOLDERS:
        read = _FOLDERS[path.parent.name]
        return lambda file: read(file.parent)
    return _READ.get(path.name, find_road)
