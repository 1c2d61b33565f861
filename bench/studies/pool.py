"""Worker processes of a study: Ctrl-C is for the command that has them, and ends them at once."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker

FORKSERVER = "forkserver"


@contextmanager
def worker_pool(workers: int, preload: Sequence[str] = ()) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes begun anew, or from one that has imported the modules of `preload`.

    All of them begin with the interrupt blocked, so that none tells of it. They end when the block
    is left, whatever they are at if it is left by an exception.
    """
    context = multiprocessing.get_context(FORKSERVER if preload else "spawn")
    if preload:
        context.set_forkserver_preload(list(preload))
    # What is blocked here stays so in all that is begun, unless the library's own tracker, begun
    # now, lets it through again.
    resource_tracker.ensure_running()
    pool = ProcessPoolExecutor(workers, mp_context=context)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        pool.submit(int)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        yield pool
    except BaseException:
        for process in multiprocessing.active_children():
            process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
