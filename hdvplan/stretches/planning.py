"""Plan a long road in stretches, and write the files of its plan as the stretches are finished."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.fileio import json_bytes
from hdvplan.record import NAME, record_of
from hdvplan.report.files import FILES
from hdvplan.road.windows import Each, Made, Thing
from hdvplan.stretches.cutting import Stretch
from hdvplan.stretches.joining import digest_of, joined_summary
from hdvplan.stretches.judging import TABLES, Kept, judged
from hdvplan.texts import encoded

Json = dict[str, Any]

_SWEPT, _REGIONS, _SUMMARY = "swept.geojson", "regions.json", "summary.json"


def plan_in_stretches(
    stretches: Iterable[Stretch], directory: Path, *, each: Each = map, on_progress: Callable[[float], None] | None = None
) -> Json:
    """Plan the stretches of a road, write the files of ``hdvplan plan`` for the whole of it, and return what ``summary.json`` says.

    ``each`` maps the planning over the stretches: ``map`` plans one after the other, ``side_by_side`` in the processes of an executor. What
    is kept does not grow with the road but for its places and times. ``summary.json`` gains ``stretches``: their ``count``, the number of
    ``processes`` that planned them, beside each other if there are several, and ``apart_m``, the most by which a corner of a body lay off
    itself where one stretch goes over into the next. No picture is drawn. ``on_progress`` receives the length that is planned [m].

    Raises:
        OptionError: the folder holds files of others.
        OSError: the folder or a file cannot be written.
        HdvplanError: what ``hdvplan.plan`` raises.

    """
    cases: list[Case] = []
    kept: list[Kept] = []
    summary: Json = {}

    def noted() -> Iterator[Stretch]:
        for stretch in stretches:
            if not cases:
                cases.append(stretch.case)
            yield stretch

    def fill(aside: Path) -> None:
        done = 0.0
        with ExitStack() as stack:
            tables = {name: stack.enter_context((aside / name).open("wb")) for name in TABLES}
            swept = stack.enter_context((aside / _SWEPT).open("wb"))
            swept.write(b'{"type": "FeatureCollection", "features": [')
            for one in each(judged, noted()):
                for name, file in tables.items():
                    file.write((b"" if kept else one.headers[name]) + one.rows[name])
                features = ",\n".join(json.dumps(feature, ensure_ascii=False, allow_nan=False) for feature in one.features)
                swept.write(encoded((",\n" if kept else "") + features))
                kept.append(one.kept)
                done += one.kept.summary["length_m"]
                if on_progress is not None:
                    on_progress(done)
            swept.write(b"]}\n")
        regions = {outline: region for one in kept for outline, region in one.regions.items()}
        (aside / _REGIONS).write_bytes(json_bytes(list(regions.values()), indent=None))
        record = record_of(cases) | {"stretches": {"count": len(kept), "digest": digest_of(kept)}}
        (aside / NAME).write_bytes(json_bytes(record))
        summary.update(joined_summary(kept))
        (aside / _SUMMARY).write_bytes(json_bytes(summary))

    FILES.fill(directory, (*TABLES, _SWEPT, _REGIONS, NAME, _SUMMARY), fill)
    return summary


def side_by_side(executor: Executor, most: int) -> Each:
    """Return a ``map`` over the processes or threads of an executor; at most ``most`` things are in memory.

    As with ``map``, an error in the making of the things comes after the results of those before it.
    """

    def each(work: Callable[[Thing], Made], things: Iterable[Thing]) -> Iterator[Made]:
        coming, failure = iter(things), list[HdvplanError]()
        ahead = deque[Future[Made]]()

        def take(count: int) -> None:
            try:
                ahead.extend(executor.submit(work, thing) for thing in islice(coming, count))
            except HdvplanError as error:
                failure.append(error)

        take(most)
        while ahead:
            done = ahead.popleft().result()
            take(1)
            yield done
        if failure:
            raise failure[0]

    return each
