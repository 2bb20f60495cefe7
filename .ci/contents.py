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
    "hatch_build.py",
    ".clang-format",
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
    wanted |= {f"hdvplan/_{name}" for name in tracked() if name.startswith("roads/")} | libraries(wheel.stem)
    faults = (
        _differences(inside, wanted) | _differences(licences, LICENCES) | _differences(set(metadata.get_all("License-File", [])), LICENCES)
    )
    return faults | ({"License-Expression"} if metadata["License-Expression"] != "MIT AND ODbL-1.0" else set())


def libraries(wheel: str) -> set[str]:
    """Return the compiled core that the wheel of a platform has."""
    suffix = ".dll" if "-win" in wheel else ".dylib" if "-macosx" in wheel else ".so"
    kinds = ("baseline", "avx2") if wheel.endswith(("x86_64", "amd64")) else ("baseline",)
    return {f"hdvplan/_core_{kind}{suffix}" for kind in kinds}


def sdist_faults(sdist: Path) -> set[str]:
    """Return what an sdist lacks or has too much."""
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames() if not archive.getmember(name).isdir()}
    wanted = {name for name in tracked() if name.startswith(SHIPPED) or name in ABOVE}
    return _differences(inside, wanted | {"PKG-INFO"})


def _differences(found: set[str], wanted: set[str]) -> set[str]:
    return {f"- {name}" for name in wanted - found} | {f"+ {name}" for name in found - wanted}


def main() -> int:
    """Print every fault of the wheels and the sdists in a folder; return 1 if there is one."""
    folder = Path(sys.argv[1])
    faults = {wheel.name: wheel_faults(wheel) for wheel in sorted(folder.glob("*.whl"))}
    faults |= {sdist.name: sdist_faults(sdist) for sdist in folder.glob("*.tar.gz")}
    for name, found in faults.items():
        print(f"{name}: {'as it should be' if not found else ', '.join(sorted(found))}")  # noqa: T201 - a script
    return 1 if any(faults.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
