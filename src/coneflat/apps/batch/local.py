"""A batch in processes on this machine."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from .jobs import Job
from .process import Child, failed


def rows_of_processes(
    jobs: Sequence[Job], processes: int, limit: float | None
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield jobs with their rows as they are done; a thread waits for each process."""
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    for job in jobs:
        waiting.put(job)
    finished: queue.SimpleQueue[tuple[Job, dict[str, Any]]] = queue.SimpleQueue()
    stopped = threading.Event()
    children = [Child() for _ in range(processes)]

    def work(child: Child) -> None:
        with suppress(queue.Empty):
            while not stopped.is_set():
                job = waiting.get_nowait()
                try:
                    row = child.flatten(job, limit)
                except Exception as error:  # Else its row would be waited for in vain.
                    child.end()
                    row = failed(job, f"internal error: {type(error).__name__}: {error}")
                finished.put((job, row))
        child.end()

    threads = [threading.Thread(target=work, args=(child,), daemon=True) for child in children]
    for thread in threads:
        thread.start()
    try:
        for _ in jobs:
            yield finished.get()
    finally:
        # Also when the one who asks has had enough, or was interrupted.
        stopped.set()
        while any(thread.is_alive() for thread in threads):
            for child in children:
                child.kill()
            threads[0].join(0.05)
