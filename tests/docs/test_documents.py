"""The documents are true: their code runs, their links lead somewhere, their files of other kinds are well-formed."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from urllib.parse import unquote

import pytest

import hdvplan
from hdvplan.report.summary import summary_of
from hdvplan.road.scenarios import shipped
from hdvplan.vehicle.load import preset_names
from tests.docs.blocks import FENCE, Block, Reader, blocks_of, runnable
from tests.nightly import nightly

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
RUN = [README, *sorted((ROOT / "docs").glob("*.md"))]
OTHERS = ("CHANGELOG", "CONTRIBUTING", "RELEASING", "benchmarks/README", "results/README", "results/widths/changed", "roads/README")
LINKED = [*RUN, *sorted((ROOT / "docs" / "site").glob("*.md")), *(ROOT / f"{name}.md" for name in OTHERS)]
_LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)\s]+)\)")
_KNOWN = {"no-run", "slow", "output", "house"}


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _prose(text: str) -> str:
    """Return a document without its code."""
    return re.sub(r"`[^`\n]*`", "", FENCE.sub("", text))


def _has(words: tuple[str, ...], path: Path) -> bool:
    return any(word in block.words for block in blocks_of(path.read_text(encoding="utf-8")) for word in words)


def _run(path: Path, *, slow: bool) -> int:
    reader, count = Reader(), 0
    skipping = False  # the output of a block that was not run
    for block in blocks_of(path.read_text(encoding="utf-8")):
        if "output" not in block.words:
            skipping = "slow" in block.words and not slow
        if runnable(block) and not skipping:
            reader.run(block)
            count += 1
    return count


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")


_SLOW = [path for path in RUN if _has(("slow",), path)]
_LONGEST = "turning-heads"  # as long as all the others together


@pytest.mark.parametrize("path", [README, *(path for path in RUN if path not in _SLOW)], ids=_name)
def test_every_block_runs_in_its_order(path: Path) -> None:
    _run(path, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("path", [nightly(path) if path.stem == _LONGEST else path for path in _SLOW], ids=_name)
def test_pages_with_slow_blocks_run_as_a_whole(path: Path) -> None:
    assert _run(path, slow=True)


@pytest.mark.parametrize("path", RUN, ids=_name)
def test_every_block_says_what_it_is_and_is_well_formed(path: Path) -> None:
    for block in blocks_of(path.read_text(encoding="utf-8")):
        assert block.language, f"line {block.line}: a fence without a language"
        unknown = [word for word in block.words if word not in _KNOWN and not word.startswith("file=")]
        assert not unknown, f"line {block.line}: nobody knows what {unknown} means"
        if block.language == "toml":
            tomllib.loads(block.body)
        elif block.language == "yaml":
            assert pytest.importorskip("yaml").safe_load(block.body)


@pytest.mark.parametrize("path", LINKED, ids=_name)
def test_every_link_leads_to_a_file_and_a_heading_that_exist(path: Path) -> None:
    for match in _LINK.finditer(_prose(path.read_text(encoding="utf-8"))):
        target = unquote(match["target"])
        if re.match(r"[a-z]+:", target):
            continue  # the network is not asked
        file, _, heading = target.partition("#")
        found = (path.parent / file).resolve() if file else path
        assert found.exists(), f"{target} does not exist"
        if heading:
            headings = re.findall(r"^#+ (.+)$", found.read_text(encoding="utf-8"), flags=re.MULTILINE)
            anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in headings}
            assert heading in anchors, f"{target}: no such heading"


PAGES = [page for page in (ROOT / "docs").rglob("*.md") if page.name != "paper.md"]  # a journal sets the length of that one


def test_the_citation_names_this_version_and_the_papers() -> None:
    cited = pytest.importorskip("yaml").safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == hdvplan.__version__
    sources = (ROOT / "docs" / "paper.bib").read_text(encoding="utf-8")
    for accented, letter in ((r"{\aa}", "å"), (r"{\c{c}}", "ç")):
        sources = sources.replace(accented, letter)
    (own,) = (source for source in sources.split("\n\n") if source.startswith("@software"))
    for words in (cited["title"], cited["authors"][0]["name"], cited["version"], cited["license"]):
        assert f"{{{words}}}" in own
    for paper in cited["references"]:
        (entry,) = (source for source in sources.split("\n\n") if paper["title"] in source)
        names = (f"{author['given-names']} {author['family-names']}" for author in paper["authors"])
        for words in (" and ".join(names), paper["conference"]["name"], str(paper["year"])):
            assert words in entry.replace("{Collares Pereira}", "Collares Pereira")


def test_the_paper_cites_what_its_bibliography_has() -> None:
    """The Journal of Open Source Software asks for 750 to 1,750 words."""
    told = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    keys = re.findall(r"^@\w+\{(\w+),$", (ROOT / "docs" / "paper.bib").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert set(re.findall(r"@(\w+)", told)) == set(keys)
    assert 750 <= len(told.split()) <= 1750


def test_the_metadata_are_those_of_the_package() -> None:
    told = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    own = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for theirs, ours in (("name", "name"), ("version", "version"), ("description", "description"), ("keywords", "keywords")):
        assert told[theirs] == own[ours]
    assert {name.rpartition("/")[2] for name in told["license"]} == set(own["license"].split(" AND "))
    assert own["requires-python"].removeprefix(">=") in told["runtimePlatform"]


@pytest.mark.parametrize(("pages", "most"), [([README], 900), (PAGES, 24_000)], ids=["README", "docs"])
def test_the_documents_are_short(pages: Iterable[Path], most: int) -> None:
    """They have the words that CONTRIBUTING allows."""
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in pages) <= most


MODULE = r"(?:hdvplan|benchmarks|tests)/[\w/]+\.(?:py|toml|csv|c|h)"


def test_every_message_that_is_explained_is_one_that_the_program_has() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in [ROOT / "hatch_build.py", *(ROOT / "hdvplan").rglob("*.py")])
    rows = re.findall(r"^\| (`[^|]+) \|", (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert rows
    for message in (message for row in rows for message in re.findall(r"`([^`]+)`", row)):
        for part in filter(None, message.removeprefix("error: ").strip(". ").split("...")):
            assert part.strip() in source, f"nothing says {message!r}"


def test_ci_runs_the_tests_as_the_readme_does() -> None:
    (options,) = re.findall(r"\.venv/bin/pytest (.+)$", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert f'/pytest" {options} ' in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert f"\npytest {options} " in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_every_document_is_in_the_index() -> None:
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    for path in (ROOT / "docs").glob("*.md"):
        assert path.name == "README.md" or f"({path.name})" in index, f"docs/README.md does not name {path.name}"


def test_every_module_that_the_documents_point_at_exists() -> None:
    for path in RUN:
        for module in re.findall(rf"`({MODULE})`", path.read_text(encoding="utf-8")):
            assert (ROOT / module).is_file(), f"{_name(path)} points at {module}"


def _needed(file: Path) -> set[str]:
    """Return the packages of hdvplan from which a module imports."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "hdvplan":
            found |= {alias.name for alias in node.names}
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", None) or ""]
        found |= {name.split(".")[1] for name in names if name.startswith("hdvplan.")}
    return found


@pytest.mark.slow
def test_the_house_in_the_design_is_the_one_that_is_built() -> None:
    """Its floors are those of the contract that CI checks, and every import leads to a lower one."""
    (drawn,) = (block.body for block in blocks_of((ROOT / "docs" / "design.md").read_text(encoding="utf-8")) if "house" in block.words)
    floors = [re.split(r" {2,}", line)[0] for line in drawn.splitlines()]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert floors == project["tool"]["importlinter"]["contracts"][0]["layers"]
    depth = {name: number for number, floor in enumerate(floors) for name in floor.split(" | ")}
    for file in (ROOT / "hdvplan").rglob("*.py"):
        own = file.relative_to(ROOT / "hdvplan").with_suffix("").parts[0]
        for needed in _needed(file) & depth.keys() - {own} if own in depth else ():
            assert depth[needed] > depth[own], f"{_name(file)} needs {needed}, which is not below it"


def test_what_the_documents_find_in_a_module_is_there() -> None:
    found = [
        (path, name, module)
        for path in RUN
        for name, module in re.findall(rf"`(\w+)`\s(?:in\s|\()`({MODULE})`", path.read_text(encoding="utf-8"))
    ]
    assert found
    for path, name, module in found:
        assert re.search(rf"\b{name}\b", (ROOT / module).read_text(encoding="utf-8")), f"{_name(path)} finds {name} in {module}"


MODULES = [block for block in blocks_of((ROOT / "docs" / "extending.md").read_text(encoding="utf-8")) if block.body.startswith('"""')]


def test_modules_to_copy_pass_the_project_s_rules() -> None:
    assert len(MODULES) == 2
    file = str(ROOT / "hdvplan" / "solvers" / "mine.py")  # as if it stood there
    for block, command in product(MODULES, (("check",), ("format", "--check"))):
        arguments = [sys.executable, "-m", "ruff", *command, "--config", str(ROOT / "pyproject.toml"), "--no-cache"]
        ran = subprocess.run([*arguments, "--stdin-filename", file, "-"], input=block.body, capture_output=True, text=True, check=False)  # noqa: S603
        assert ran.returncode == 0, f"line {block.line}: {ran.stdout}"


def test_a_block_in_a_list_is_a_block_like_others() -> None:
    listed = "- first:\n\n  ```sh\n  hdvplan solvers\n  ```\n\n- second\n\n```text output\nriccati\n```\n"
    assert [(block.language, block.body, block.line) for block in blocks_of(listed)] == [
        ("sh", "hdvplan solvers\n", 3),
        ("text", "riccati\n", 9),
    ]


def test_the_documents_count_what_ships() -> None:
    vehicles, roads = len(preset_names()), len(shipped())
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    verdicts = (ROOT / "results" / "widths" / "widths.csv").read_text(encoding="utf-8").count("\n") - 1  # less the header
    for words in (f"{vehicles} presets", f"{roads} real roads ship", f"{verdicts} verdicts**: {roads} roads"):
        assert words in readme
    assert f"shows {vehicles} vehicles" in (ROOT / "docs" / "route-engineers.md").read_text(encoding="utf-8")


def test_a_block_that_does_not_do_what_it_says_is_noticed() -> None:
    reader = Reader()
    reader.run(Block("sh", (), "hdvplan solvers --json > list.json\n", 1))
    assert Path("list.json").read_text(encoding="utf-8").startswith("[")
    reader.run(Block("sh", (), "hdvplan --version\n", 1))
    reader.run(Block("text", ("output",), "hdvplan   0...\n", 1))
    with pytest.raises(AssertionError, match="no printed line reads"):
        reader.run(Block("text", ("output",), "hdvplan 99\n", 1))
    with pytest.raises(AssertionError, match="exits with 2"):
        reader.run(Block("sh", (), "hdvplan vehicles show rocket\n", 1))
    reader.run(Block("sh", (), "hdvplan vehicles show rocket  # exit code 1 or 2\n", 1))
    with pytest.raises(AssertionError, match="no command of ours"):
        reader.run(Block("sh", (), "pip install hdvplan\n", 1))
    with pytest.raises(ZeroDivisionError):
        reader.run(Block("python", (), "1 / 0\n", 1))


def test_the_summary_s_fields_are_those_that_the_documents_explain() -> None:
    settings = hdvplan.PlannerSettings(horizon=50.0)
    summary = summary_of(hdvplan.plan(hdvplan.Case(hdvplan.load_road("sturn"), hdvplan.load_vehicle("bus"), settings=settings)))
    explained = (ROOT / "docs" / "tables.md").read_text(encoding="utf-8")
    missing = [name for name in summary if f"`{name}`" not in explained]
    assert not missing, f"docs/tables.md does not explain {missing}"
