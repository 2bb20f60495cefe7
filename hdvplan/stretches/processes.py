"""Processes of this machine that plan the stretches of one long road side by side."""

from __future__ import annotations

import multiprocessing as mp
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from hdvplan.errors import HdvplanError
from hdvplan.machine import use_one_thread
from hdvplan.road.windows import Each
from hdvplan.serving import serve_parent
from hdvplan.stretches.planning import side_by_side

_AHEAD = 2  # for every process: one that it works on, and one that is ready


@contextmanager
def processes(count: int) -> Iterator[Each]:
    """Yield what smooths and plans in ``count`` processes, or in this one where that is 1; what they find is the same.

    Whatever ends the block: what no process has begun is not done. An exception does not wait for what is under way either.

    Raises:
        HdvplanError: a process ended, such as by lack of memory.

    """
    if count == 1:
        yield map
        return
    use_one_thread()  # the processes inherit it
    before = set(mp.active_children())
    spawned = mp.get_context("spawn")  # a forked process would share threads and locks with libraries that are loaded here
    with ProcessPoolExecutor(count, mp_context=spawned, initializer=serve_parent) as executor:
        try:
            yield side_by_side(executor, _AHEAD * count)
        except BrokenProcessPool as error:
            msg = "a process that planned a stretch ended before it was done"
            raise HdvplanError(msg, hint="it may have been killed for lack of memory: take fewer with --workers") from error
        except BaseException:  # Ctrl-C, too: the processes leave it to this one, and a stretch takes seconds
            executor.shutdown(wait=False, cancel_futures=True)
            for process in set(mp.active_children()) - before:
                process.kill()
                process.join()
            raise
        executor.shutdown(wait=False, cancel_futures=True)
