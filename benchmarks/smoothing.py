"""Time the smoothing of the ten real roads of suite.toml, and of the one whose bounds bind.

python benchmarks/smoothing.py [--rounds 3]

Prints the processor time of each road in each round [s], as ``hdvplan bench --command`` reads it: so two revisions take turns by

    hdvplan bench --against REV --command "python $PWD/benchmarks/smoothing.py"
"""

from __future__ import annotations

import argparse
import gc
import json
import tomllib
from pathlib import Path
from time import process_time

from hdvplan.machine import use_one_thread

use_one_thread()  # before NumPy is loaded

from hdvplan.road.load import find_road  # noqa: E402

SUITE = Path(__file__).with_name("suite.toml")
BINDING = "liechtenstein_triesenberg"  # a hairpin of the least radius: Clarabel solves all its programs but the first


def main() -> None:
    """Time every road once to load what is loaded once, then in rounds, and print the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    rounds: int = parser.parse_args().rounds
    roads = {name: find_road(name) for name in (*tomllib.loads(SUITE.read_text(encoding="utf-8"))["roads"], BINDING)}
    times: dict[str, list[list[float]]] = {name: [] for name in roads}
    gc.disable()
    for _ in range(1 + rounds):
        for name, found in roads.items():
            began = process_time()
            found()
            times[name].append([process_time() - began])
    print(json.dumps({"cells": {name: {"steps_s": taken[1:]} for name, taken in times.items()}}))


if __name__ == "__main__":
    main()
