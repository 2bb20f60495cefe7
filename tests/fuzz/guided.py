"""Fuzz with atheris (``pip install atheris``): ``python -m tests.fuzz.guided --minutes 60 [--seed N] [--keep DIR]``.

As ``python -m tests.fuzz``, but inputs that take a branch of the readers for the first time are kept and damaged further. The first byte
of an input says which file it stands for. The process ends with the exit code of libFuzzer; what failed is told as it comes.
"""

from __future__ import annotations

import argparse
import atexit
import random
import sys
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

atheris: Any = import_module("atheris")  # an optional library without types
_WATCHED = ("hdvplan.road", "hdvplan.vehicle.load", "hdvplan.planning.bias", "hdvplan.report.planfiles", "hdvplan.bench.directory")
_LONGEST = 65536

with atheris.instrument_imports(include=list(_WATCHED)):
    for module in ("hdvplan.road.load", "hdvplan.road.load_opendrive", "hdvplan.vehicle.load", "hdvplan.report.planfiles"):
        import_module(module)
    from tests.fuzz.mutation import mutated
    from tests.fuzz.tally import Tally, say
    from tests.fuzz.targets import make_targets, tried


def main() -> None:
    """Let atheris choose what to damage until the time is over."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    chosen = parser.parse_args()
    tally = Tally(chosen.keep and chosen.keep.resolve())
    atexit.register(lambda: say(tally.told()))
    with TemporaryDirectory() as name:
        corpus = Path(name) / "corpus"
        corpus.mkdir()
        targets = make_targets(Path(name))
        for number, target in enumerate(targets):
            (corpus / f"{number:02d}").write_bytes(bytes([number]) + target.path.read_bytes())

        def one(data: bytes) -> None:
            if not data:
                return
            target = targets[data[0] % len(targets)]
            tally.note(target, data[1:], tried(target, data[1:]))
            if tally.total % 100 == 0:
                say(tally.told())

        def changed(data: bytes, most: int, chance: int) -> bytes:
            if chance % 4 == 0:
                return bytes(atheris.Mutate(data, most))
            return (data[:1] + mutated(data[1:], random.Random(chance)))[:most]  # noqa: S311 - no secret

        limits = (f"-max_total_time={60.0 * chosen.minutes:.0f}", f"-max_len={_LONGEST}", "-timeout=600", "-rss_limit_mb=8000")
        atheris.Setup([sys.argv[0], str(corpus), f"-seed={chosen.seed}", *limits], one, custom_mutator=changed)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
