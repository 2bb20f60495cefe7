"""Compile the C core: hatchling runs this for wheels and editable installs, ``python hatch_build.py [LIBRARY ...]`` after a change of C.

The compiler is ``$CC``, else ``cc``, else the one in the wheel ziglang. ``HDVPLAN_WHEEL`` names the platform of a wheel for other machines.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NoReturn

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

ROOT = Path(__file__).parent
SOURCES = ROOT / "hdvplan" / "core"
FLAGS = (
    *("-std=c99", "-Wall", "-Wextra", "-pedantic"),
    *("-O3", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"),  # NaN and infinity keep their meaning
    *("-g0", "-shared", "-fvisibility=hidden"),
)
LIBRARIES = {  # what each is compiled with besides; core.py takes the fastest that the processor can run
    "baseline": (),
    "avx2": ("-mavx2", "-mfma"),
    "sanitized": ("-O1", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),  # for .ci/sanitize
}
TARGETS = {  # of ziglang, by the platform of the wheel
    "manylinux_2_17_x86_64": "x86_64-linux-gnu.2.17",
    "manylinux_2_17_aarch64": "aarch64-linux-gnu.2.17",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
    "win_amd64": "x86_64-windows-gnu",
}
ZIG = "ziglang>=0.17,<0.18"  # a C compiler as a wheel


class CoreHook(BuildHookInterface[Any]):
    """Put the core's libraries into a wheel, or in place for an editable install."""

    folder = ""  # of the libraries that a wheel takes

    def dependencies(self) -> list[str]:
        """Ask for a compiler where there is none."""
        return [] if _wheel() is None and _own_compiler() else [ZIG]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files are collected. One wheel a platform serves every Python."""
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{_wheel() or next(tag for tag in platform_tags() if 'linux' not in tag or tag.startswith('linux'))}"
        if version == "editable":
            build(ROOT / "hdvplan", strict=True)
            return
        self.folder = tempfile.mkdtemp()
        for library in build(Path(self.folder), strict=_wheel() is not None):  # a user's newer compiler may warn of more
            build_data["force_include"][str(library)] = f"hdvplan/{library.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002 - hatchling's signature
        """Remove what is in the wheel now."""
        if self.folder:
            shutil.rmtree(self.folder)


def build(folder: Path, names: tuple[str, ...] = (), *, strict: bool) -> list[Path]:
    """Compile libraries into a folder, all at once, and return them; by default those for this platform, or for the wheel's.

    ``strict``: warnings are errors. A library in use is replaced, not written over.
    """
    target = _wheel() or f"{sys.platform}_{platform.machine().lower()}"
    suffix = ".dll" if target.startswith("win") else ".dylib" if target.startswith(("macosx", "darwin")) else ".so"
    names = names or (("baseline", "avx2") if target.endswith(("x86_64", "amd64")) else ("baseline",))
    compiler = _compiler()
    sources = [str(source) for source in sorted(SOURCES.glob("*.c"))]
    with tempfile.TemporaryDirectory(dir=folder, prefix="_core_") as made:
        Path(made, "layout.h").write_text(layout(), encoding="ascii")
        flags = [*FLAGS, *(["-Werror"] if strict else []), *([] if suffix == ".dll" else ["-fPIC"]), f"-I{SOURCES}", f"-I{made}"]
        caches = {} if _wheel() else {"ZIG_GLOBAL_CACHE_DIR": made, "ZIG_LOCAL_CACHE_DIR": made}  # nothing stays at a user's
        commands = [[*compiler, *flags, *LIBRARIES[name], *sources, "-o", f"{made}/_core_{name}{suffix}", "-lm"] for name in names]
        try:
            running = [
                subprocess.Popen(command, env=os.environ | caches, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
                for command in commands
            ]
        except OSError as error:
            _refuse(compiler, [str(error)])
        printed = [process.communicate()[0] for process in running]
        for process, lines in zip(running, printed, strict=True):
            if process.returncode != 0:
                _refuse(compiler, lines.splitlines())
        libraries = [folder / f"_core_{name}{suffix}" for name in names]
        for library in libraries:
            Path(made, library.name).replace(library)
    return libraries


def digest() -> str:
    """Return the digest of the core's sources; core.py computes the same to see whether a library is theirs."""
    return hashlib.sha256(b"".join(source.read_bytes() for source in sorted(SOURCES.glob("*.[ch]")))).hexdigest()


def layout() -> str:
    """Return the header of layout.c: where the headers' records have their fields, what their constants are, and the sources' digest."""
    headers = {header.name: header.read_text(encoding="ascii") for header in sorted(SOURCES.glob("*.h"))}
    headers = {name: text for name, text in headers.items() if "\nstruct hdv_" in text}
    text = re.sub(r"/\*.*?\*/", "", "".join(headers.values()), flags=re.DOTALL)
    rows = []
    for record, body in re.findall(r"^struct (hdv_\w+) \{(.*?)^\};", text, re.DOTALL | re.MULTILINE):
        rows.append(f'{{"{record}", "", "", 0, sizeof(struct {record}), 0.0}},')
        for field in re.findall(r"(\w+)(?:\[\w+\])*[,;]", body):
            own = f"((struct {record} *)0)->{field}"
            kind = f'(__extension__ _Generic({own}, double: "f", int64_t: "i", default: "p"))'
            rows.append(f'{{"{record}", "{field}", {kind}, offsetof(struct {record}, {field}), sizeof({own}), 0.0}},')
    enumerated = re.findall(r"\bHDV_[A-Z_]+", "".join(re.findall(r"^enum \w*\s*\{.*?\}", text, re.DOTALL | re.MULTILINE)))
    constants = [*enumerated, *re.findall(r"^#define (HDV_\w+) [\d.]", text, re.MULTILINE)]
    rows += [f'{{"", "{name}", "c", 0, 0, {name}}},' for name in sorted({*constants})]
    lines = ["#include <stddef.h>", *(f'#include "{name}"' for name in headers), f'#define HDV_SOURCES "{digest()}"']
    lines += ["#define HDV_LAYOUT " + " \\\n".join(rows)]
    return "\n".join(lines) + "\n"


def _wheel() -> str | None:
    name = os.environ.get("HDVPLAN_WHEEL")
    if name is not None and name not in TARGETS:
        sys.exit(f"error: HDVPLAN_WHEEL is {name!r}, a platform that no wheel is made for; hint: take one of {', '.join(TARGETS)}")
    return name


def _compiler() -> list[str]:
    zig = [sys.executable, "-m", "ziglang", "cc"]
    if (wheel := _wheel()) is not None:
        return [*zig, "-target", TARGETS[wheel]]
    return _own_compiler() or [*zig, "-mcpu=baseline"]


def _own_compiler() -> list[str]:
    """Return the compiler that this machine has; empty where it has none that finds the C library and links."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    found = shutil.which("cc")
    if found is None:
        return []
    with tempfile.TemporaryDirectory() as folder:
        tried = [found, "-std=c99", "-shared", "-fPIC", "-xc", "-", "-o", f"{folder}/tried", "-lm"]
        ended = subprocess.run(tried, input=b"#include <math.h>\n#include <stdint.h>\n", capture_output=True, check=False)
    return [found] if ended.returncode == 0 else []


def _refuse(compiler: list[str], lines: list[str]) -> NoReturn:
    """End with what the compiler says first that is an error."""
    said = next((line.strip() for line in lines if "error" in line.lower()), (lines or ["it says nothing"])[-1].strip())
    hint = "install a C compiler, or pip install ziglang and set CC='python -m ziglang cc -mcpu=baseline'"
    sys.exit(f"error: the C core could not be compiled by {shlex.join(compiler)}: {said}; hint: {hint}")


if __name__ == "__main__":
    build(ROOT / "hdvplan", tuple(sys.argv[1:]), strict=True)
