"""Check what is in wheel and sdist: all that belongs there, and nothing else. ``python .ci/contents.py DIR``."""

from __future__ import annotations

import email
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
LICENCES = {"LICENSE", "roads/opendrive/LICENSE", "roads/osm/ODbL-1.0.txt"}
SHIPPED = ("hdvplan/", "roads/", "tests/", "benchmarks/", "docs/", ".ci/")  # folders of the sdist; of files above them:
ABOVE = {
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "Dockerfile",
    "LICENSE",
    "README.md",
    "RELEASING.md",
    "pyproject.toml",
    ".dockerignore",
    ".gitignore",
}


def tracked() -> set[str]:
    """Return the repository's files."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True)  # noqa: S607 - git is where it is
    return set(listed.stdout.splitlines())


def wheel_faults(wheel: Path) -> set[str]:
    """Return what a wheel lacks, marked -, has too much, marked +, or says wrongly."""
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
        (about,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = email.message_from_bytes(archive.read(about))
        licences = {name.partition("/licenses/")[2] for name in archive.namelist() if "/licenses/" in name}
    wanted = {name for name in tracked() if name.startswith("hdvplan/")}
    wanted |= {f"hdvplan/_{name}" for name in tracked() if name.startswith("roads/")}
    faults = (
        _differences(inside, wanted) | _differences(licences, LICENCES) | _differences(set(metadata.get_all("License-File", [])), LICENCES)
    )
    return faults | ({"License-Expression"} if metadata["License-Expression"] != "MIT AND ODbL-1.0" else set())


def sdist_faults(sdist: Path) -> set[str]:
    """Return what an sdist lacks or has too much."""
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames() if not archive.getmember(name).isdir()}
    wanted = {name for name in tracked() if name.startswith(SHIPPED) or name in ABOVE}
    return _differences(inside, wanted | {"PKG-INFO"})


def _differences(found: set[str], wanted: set[str]) -> set[str]:
    return {f"- {name}" for name in wanted - found} | {f"+ {name}" for name in found - wanted}


def main() -> int:
    """Print every fault of the one wheel and the one sdist in a folder; return 1 if there is one."""
    folder = Path(sys.argv[1])
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    faults = {wheel.name: wheel_faults(wheel), sdist.name: sdist_faults(sdist)}
    for name, found in faults.items():
        print(f"{name}: {'as it should be' if not found else ', '.join(sorted(found))}")  # noqa: T201 - a script
    return 1 if any(faults.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
