"""Worker processes that run cases one after the other, with limits of time and memory."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import faulthandler
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path

from .outcome import Outcome

Case = tuple[str, int]
#: CPU seconds, and seconds of waiting, that a case may take. Both depend less on other work on the machine than wall
#: time does.
WORK, WALL = 20.0, 90.0
#: MB that a case may add to the resident memory, and bytes of addresses that a worker may add to those at its start.
MEMORY, ADDRESSES = 1500.0, 6 << 30
#: Number of cases after which a worker is replaced.
CASES = 500


def run_all(
    cases: Iterable[Case], jobs: int, say: Callable[[Outcome, int], None], most_work: float = WORK
) -> None:
    """Run cases on a number of workers, and report the outcome of each and the number completed.

    most_work: seconds of a process's own work that a case may take.
    """
    waiting = list(cases)[::-1]
    tried_again: set[Case] = set()
    home = Path(tempfile.mkdtemp(prefix="hostile"))
    workers: list[Worker] = []
    done = 0
    try:
        while waiting or workers:
            while waiting and len(workers) < jobs:
                workers.append(Worker(home, most_work))
            for worker in workers:
                if worker.case is None and worker.is_ready and waiting:
                    worker.start(waiting.pop())
            wait([worker.pipe for worker in workers], timeout=0.5)
            for worker in list(workers):
                for outcome in worker.ended():
                    case = (outcome.kind, outcome.seed)
                    if _ran_out_of_time(outcome) and case not in tried_again:
                        # The first use of a loop compiles it, which is not the case's fault.
                        tried_again.add(case)
                        waiting.append(case)
                        continue
                    done += 1
                    say(outcome, done)
                if worker.is_done or (worker.case is None and worker.is_ready and not waiting):
                    worker.close()
                    workers.remove(worker)
    finally:
        for worker in workers:
            worker.close()
        shutil.rmtree(home, ignore_errors=True)


def _ran_out_of_time(outcome: Outcome) -> bool:
    return any(cause.startswith("out of time") for cause, _ in outcome.breaches)


class Worker:
    """A process, its current case, and its limits.

    Attributes:
        case: what it runs, None if nothing.
        is_ready: whether it has warmed up.
        is_done: whether it is to be replaced.
    """

    def __init__(self, home: Path, most_work: float = WORK) -> None:
        self.most_work = most_work
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.log = Path(tempfile.mkstemp(dir=home, suffix=".log")[1])
        self.process = context.Process(target=serve, args=(theirs, home, self.log, sys.path), daemon=False)
        self.process.start()
        theirs.close()
        self.case: Case | None = None
        self.is_ready = self.is_done = False
        self.count = 0
        self.began, self.work = time.perf_counter(), 0.0

    def start(self, case: Case) -> None:
        self.case, self.began, self.work = case, time.perf_counter(), _work_of(self.process.pid)
        with contextlib.suppress(ConnectionError):  # that it is gone is seen when it does not answer
            self.pipe.send(case)

    def ended(self) -> Iterator[Outcome]:
        """Yield the outcome of the case, if it has ended or must be ended."""
        try:
            if self.pipe.poll():
                told = self.pipe.recv()
                if told is None:
                    self.is_ready = True
                    return
                self.case, self.count = None, self.count + 1
                self.is_done = self.count >= CASES or bool(told.breaches and told.memory > MEMORY)
                yield told
                return
        except (EOFError, ConnectionError):
            self.process.join(10)
            self.is_done = True
            if self.case is None:
                raise RuntimeError(f"a worker did not start: {self._trace()}") from None
            yield self._failed(f"crash, exit code {self.process.exitcode}, {self._place()}", self._trace())
            return
        if self.case is None:
            return
        wall, work = time.perf_counter() - self.began, _work_of(self.process.pid) - self.work
        if wall > max(WALL, self.most_work * WALL / WORK) or work > self.most_work:
            if hasattr(signal, "SIGUSR1") and self.process.pid:
                os.kill(self.process.pid, signal.SIGUSR1)  # writes where it is
                time.sleep(0.5)
            self.is_done = True
            yield self._failed(
                f"out of time in {self._place()}", f"{work:.0f} s of work, {wall:.0f} s; {self._trace()}"
            )

    def _failed(self, cause: str, details: str) -> Outcome:
        assert self.case is not None
        outcome = Outcome(*self.case, recipe=recipe_of(*self.case), seconds=time.perf_counter() - self.began)
        outcome.breach(cause, details)
        return outcome

    def _trace(self) -> str:
        return self.log.read_text(errors="replace")[-3000:]

    def _place(self) -> str:
        """Return the innermost function of the package in the last trace written by the process."""
        last = self.log.read_text(errors="replace").rpartition("most recent call first")[2]
        match = re.search(r'File ".*?/coneflat/([^"]*)", line \d+ in (\w+)', last)
        return "an unknown place" if match is None else f"{match[1]} {match[2]}"

    def close(self) -> None:
        if self.process.is_alive() and self.case is None and self.is_ready:
            self.pipe.close()
            self.process.join(5)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def recipe_of(kind: str, seed: int) -> str:
    """Return the description of a case that did not end."""
    if kind in ("grid", "few"):
        return f"python benchmarks/grids.py --kind {kind} --case {seed}"
    if kind != "mesh":
        return "python benchmarks/hostile.py --case tells"
    import zlib

    import numpy as np

    from .choices import in_short, make_options
    from .meshes import make_mesh

    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    vertices, faces, made = make_mesh(rng)
    return f"{made}; {in_short(make_options(rng, vertices, faces))}"


def serve(pipe: Connection, home: Path, log: Path, path: list[str]) -> None:
    """Run cases from a pipe until it is closed, and send their outcomes."""
    sys.path[:] = path
    stream = log.open("w")
    atexit.register(stream.close)
    faulthandler.enable(stream)
    if hasattr(signal, "SIGUSR1"):
        faulthandler.register(signal.SIGUSR1, stream)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["MPLBACKEND"] = "Agg"
    tempfile.tempdir = tempfile.mkdtemp(dir=home)
    os.chdir(tempfile.tempdir)
    from .cases import run_case, warm_up

    warm_up()
    _limit_memory()
    printed = _standard_output(log.with_suffix(".out"))
    pipe.send(None)
    while True:
        try:
            case = pipe.recv()
        except EOFError:
            return
        outcome = run_case(*case)
        text = printed()
        if text.strip():
            outcome.breach(f"prints: {text[:80]}", text)
        if outcome.memory > MEMORY:
            outcome.breach("out of memory", f"{outcome.memory:.0f} MB")
        try:
            pipe.send(outcome)
        except ConnectionError:
            return


def _standard_output(path: Path) -> Callable[[], str]:
    """Redirect standard output, also that of compiled code, to a file; return a function that reads new output."""
    file = path.open("w+", errors="replace")
    os.dup2(file.fileno(), 1)

    def printed() -> str:
        sys.stdout.flush()
        with contextlib.suppress(TypeError, OSError):  # where libraries are not found without a name
            ctypes.CDLL(None).fflush(None)
        text = path.read_text(errors="replace")
        os.ftruncate(1, 0)
        os.lseek(1, 0, os.SEEK_SET)
        return text

    return printed


def _limit_memory() -> None:
    """Limit the growth of the address space of the process, if the system supports it."""
    try:
        import resource

        match = re.search(r"VmSize:\s+(\d+) kB", Path("/proc/self/status").read_text())
    except (ImportError, OSError):
        return
    if match:
        limit = int(match[1]) * 1024 + ADDRESSES
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _work_of(pid: int | None) -> float:
    """Return the CPU seconds of a process; wall time if unknown."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return time.perf_counter()
