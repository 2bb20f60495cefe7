"""A comparison for other programs: JSON, JUnit XML, annotations of GitHub Actions, and what github-action-benchmark and Bencher take."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from hdvplan.bench.comparing.compare import Comparison, Entry
from hdvplan.bench.comparing.counters import Change
from hdvplan.bench.comparing.decision import FEWEST_PAIRS, GateVerdict, Rule
from hdvplan.bench.comparing.words import change_words, comparison_markdown, place_words, quantity_words, verdict_line, word_of
from hdvplan.bench.suite import KEY, cell_words
from hdvplan.fileio import json_bytes, write_atomically

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_reports(comparison: Comparison, rule: Rule, again: str | None, folder: Path) -> None:
    """Write a comparison in all its forms.

    Raises:
        OSError: ``folder`` cannot be written.

    """
    folder.mkdir(parents=True, exist_ok=True)
    benchmark, bencher = _measured(comparison)
    write_atomically(folder / "comparison.json", json_bytes(comparison_json(comparison, rule, again)))
    write_atomically(folder / "junit.xml", junit_xml(comparison, rule))
    write_atomically(folder / "benchmark.json", json_bytes(benchmark))
    write_atomically(folder / "bencher.json", json_bytes(bencher))
    write_atomically(folder / "summary.md", comparison_markdown(comparison, rule, again).encode())


def comparison_json(comparison: Comparison, rule: Rule, again: str | None = None) -> dict[str, object]:
    """Return the comparison for other programs; null where a number is not known."""
    failure = comparison.failure
    return {
        "verdict": str(comparison.verdict),
        "summary": verdict_line(comparison, rule),
        "compared": comparison.about or None,
        "factor": rule.factor,
        "load_average": None if np.isnan(comparison.load) else comparison.load,
        "floor_ms": 1e3 * rule.floor,
        "again": again,
        "failure": None if failure is None else {"side": failure.side, "message": failure.message, "tail": failure.tail},
        "changes": [_changes(change) for change in comparison.changes],
        "within": [_changes(change) for change in comparison.within],
        "times": [dict(zip(KEY, entry.cell, strict=True)) | _judged(entry) for entry in comparison.times],
        "statistics": [
            {"statistic": quantity_words(one), "cell": place_words(one), "meaning": one.quantity.meaning, "unit": one.quantity.unit}
            | _judged(one)
            for one in comparison.found
        ],
    }


def junit_xml(comparison: Comparison, rule: Rule) -> bytes:
    """Return the comparison as a test suite: a case for every cell and statistic, and one for the programs themselves.

    Worse is a failure; what could not be measured is skipped; a program that does not run is an error.
    """
    cases: list[tuple[str, str, str | None, str]] = []  # group, name, kind of the outcome, message
    failure = comparison.failure
    kind = None if failure is None else "error" if comparison.verdict is GateVerdict.REGRESSED else "skipped"
    cases.append(("programs", "both run", kind, "" if failure is None else f"{failure.message}\n{failure.tail}"))
    is_red = partial(Change.is_red, expected=comparison.expected)
    cases += [
        ("counters", cell_words(cell), "failure" if any(map(is_red, changes)) else None, "; ".join(map(change_words, changes)))
        for cell, changes in _changed(comparison).items()
    ]
    cases += [("mean planning step", cell_words(entry.cell), _KINDS[entry.verdict], _words(entry)) for entry in comparison.times]
    for one in comparison.found:
        kind = "skipped" if one.decision.unseen else _KINDS[one.verdict]
        words = f"{word_of(one)}: {_words(one)}" if one.decision.unseen else _words(one)
        what = quantity_words(one)
        cases.append((*((what, place_words(one)) if one.is_of_cell else ("whole processes", what)), kind, words))
    suite = Element("testsuite", name="hdvplan timing gate", tests=str(len(cases)))
    for name in ("failure", "error", "skipped"):
        suite.set({"failure": "failures", "error": "errors"}.get(name, name), str(sum(case[2] == name for case in cases)))
    for group, name, outcome, message in cases:
        case = SubElement(suite, "testcase", classname=group, name=_NOT_XML.sub("?", name))
        if outcome is not None:
            SubElement(case, outcome, message=_NOT_XML.sub("?", message.partition("\n")[0])).text = _NOT_XML.sub("?", message)
    SubElement(suite, "system-out").text = _NOT_XML.sub("?", verdict_line(comparison, rule))
    indent(suite)
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + tostring(suite, encoding="unicode").encode()


def github_annotation(comparison: Comparison, rule: Rule) -> str:
    """Return the workflow command that makes GitHub Actions show the verdict; the step's summary has the rest."""
    kind = {GateVerdict.FINE: "notice", GateVerdict.REGRESSED: "error", GateVerdict.UNMEASURABLE: "warning"}[comparison.verdict]
    tail = comparison.failure.tail if comparison.failure else ""
    return _command(kind, verdict_line(comparison, rule) + (f"\n{tail}" if tail else ""))


def refusal_annotation(message: str, hint: str | None) -> str:
    """Return the workflow command that takes a comparison's place where it could not begin."""
    return _command("error", message + (f"\nhint: {hint}" if hint else ""))


_KINDS = {GateVerdict.FINE: None, GateVerdict.REGRESSED: "failure", GateVerdict.UNMEASURABLE: "skipped"}


def _changed(comparison: Comparison) -> dict[tuple[str, ...], list[Change]]:
    found: dict[tuple[str, ...], list[Change]] = {}
    for change in comparison.changes:
        found.setdefault(change.cell, []).append(change)
    return found


def _changes(change: Change) -> dict[str, str]:
    named = dict(zip(KEY, change.cell, strict=True)) | {"counter": change.counter, "base": change.base, "new": change.new}
    return named | ({"why": change.why} if change.why else {})


def _words(entry: Entry) -> str:
    found = entry.decision
    if not found.pairs:
        return "the steps differ"
    return f"{found.base:.5g} {entry.quantity.unit} before, {found.new:.5g} now: {found.ratio:.3f} times"


def _judged(entry: Entry) -> dict[str, object]:
    """Return the decision on a cell, in ms, or on a quantity of whole processes, in its unit."""
    found, unit = entry.decision, "_ms" if entry.decision.needed else ""
    numbers = {
        f"base{unit}": found.base, f"new{unit}": found.new, "ratio": found.ratio, "low": found.low, "high": found.high,
        "noise": found.noise, "chance": found.chance, "detectable": found.detectable, "counts_from": found.counting,
    }  # fmt: skip
    return {"verdict": word_of(entry) if found.unseen else str(found.verdict), "by_cpu": entry.by_cpu, "pairs": found.pairs} | _known(
        numbers
    )


def _measured(comparison: Comparison) -> tuple[list[dict[str, object]], dict[str, object]]:
    """Return the new side's numbers as github-action-benchmark (``customSmallerIsBetter``) and as Bencher (metric format) take them.

    They are medians of its processes by themselves: dashboards draw series, and the pair with the middle ratio may be of a busy moment.
    """
    benchmark: list[dict[str, object]] = []
    bencher: dict[str, object] = {}
    for entry in (*comparison.times, *comparison.found):
        unit, (low, value, high) = entry.quantity.unit, entry.decision.alone
        if not np.isfinite(value):
            continue
        what, known = quantity_words(entry), entry.decision.pairs >= FEWEST_PAIRS
        name = f"{place_words(entry)}: {what}"
        spread = {"range": f"{low:.4g} to {high:.4g}"} if known else {}
        benchmark.append({"name": name, "unit": unit, "value": value} | spread)
        bounds = {"lower_value": low, "upper_value": high} if known else {}
        bencher[name] = {f"{what} [{unit}]": {"value": value} | bounds}
    return benchmark, bencher


def _known(numbers: Mapping[str, float]) -> dict[str, object]:
    return {name: value if np.isfinite(value) else None for name, value in numbers.items()}


def _command(kind: str, message: str) -> str:
    escaped = message.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    return f"::{kind} title=planning time::{escaped}"
