"""Time of the studio from a click to the layout: `python benchmarks/studio.py [MODEL:SPLITS[:MOVES]...]`.

A split makes four triangles of each. The page is in a headless Chromium. After a search each cone is moved by hand to a
neighbour and back. The seconds, medians, are from the request until the preview, if there is one, and until the
layout is drawn; until the metric is computed; and CPU seconds of the worker process. Its memory is measured after the
first layout and after all moves.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from common import chromium, model

from coneflat.apps.studio.serve import open_listener
from coneflat.apps.studio.server import StudioServer
from coneflat.apps.studio.session import Session
from coneflat.apps.studio.worker import COMMAND

SIZE = {"width": 1366, "height": 768}
MOVES = 8
FLATTENED = ("check", "cones", "metric")  # Stages until the metric is computed.
PATIENCE = 300_000  # milliseconds
SETTLED = "!studio.isBusy() && studio.layout === studio.news.layout && studio.layout > {} && !studio.asked"
MOVE = """
(() => {
  const row = studio.coneRows()[%d %% studio.coneRows().length], [vertex] = studio.verticesOf([row.vertex]);
  const graph = studio.graph();
  const to = graph.ends[graph.start[vertex]];
  studio.act({do: "move", vertex: row.vertex, to: studio.numberOf(to)});
})()
"""


@dataclass
class Seconds:
    """Seconds of moves: until the preview, until the layout is drawn, until the metric, and CPU seconds."""

    sight: list[float] = field(default_factory=list)
    took: list[float] = field(default_factory=list)
    metric: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)


def worker_process() -> int:
    """Return the id of the worker process."""
    (worker,) = (child for child in psutil.Process().children() if COMMAND[-1] in child.cmdline())
    return worker.pid


def moves(page: object, session: Session, count: int) -> Seconds:
    """Return the times of moves."""
    seconds = Seconds()
    for k in range(count):
        started = processor(worker_process())
        before = page.evaluate("studio.layout")  # type: ignore[attr-defined]
        page.evaluate(MOVE % k)  # type: ignore[attr-defined]
        page.wait_for_function(SETTLED.format(before), timeout=PATIENCE)  # type: ignore[attr-defined]
        seconds.sight.append(page.evaluate("studio.sight") / 1000)  # type: ignore[attr-defined]
        seconds.took.append(page.evaluate("studio.took") / 1000)  # type: ignore[attr-defined]
        seconds.metric.append(sum(session.stages.get(stage, 0.0) for stage in FLATTENED))
        seconds.processor.append(processor(worker_process()) - started)
    return seconds


def processor(process: int | None) -> float:
    """Return the CPU seconds of a process, if known."""
    path = Path(f"/proc/{process}/stat")
    if not path.exists():
        return float("nan")
    spent = path.read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, spent)) / os.sysconf("SC_CLK_TCK")


def memory(process: int | None) -> float:
    """Return the memory of a process in MB, if known."""
    status = Path(f"/proc/{process}/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), float("nan"))


def measure(browser: object, name: str, splits: int, count: int, folder: Path) -> str:
    """Return a row of the table."""
    vertices, faces = model(name, splits)
    path = folder / f"{name}{splits}.off"
    with path.open("w") as stream:
        stream.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
        stream.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        stream.writelines(f"3 {a} {b} {c}\n" for a, b, c in faces.tolist())
    session = Session(folder)
    with open_listener(0) as listener:
        port = listener.getsockname()[1]
        server = StudioServer(session, "token", port)
        thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
        thread.start()
        session.open(path)
        page = browser.new_page(viewport=SIZE, bypass_csp=True)  # type: ignore[attr-defined]
        page.goto(f"http://127.0.0.1:{port}/?token=token")
        page.wait_for_selector("html[data-ready]", timeout=PATIENCE)
        page.wait_for_function(SETTLED.format(0), timeout=PATIENCE)
        first = memory(worker_process())
        seconds = moves(page, session, count)
        last = memory(worker_process())
        page.close()
        server.should_exit = True
        thread.join()
    medians = map(statistics.median, (seconds.metric, seconds.sight, seconds.took))
    numbers = " | ".join(
        f"{seconds_of_step:.2f}"
        for seconds_of_step in (*medians, max(seconds.took), statistics.median(seconds.processor))
    )
    return f"| {name} | {len(faces):,} | {count} | {numbers} | {first:.0f} | {last:.0f} |"


def main(words: list[str]) -> None:
    from playwright.sync_api import sync_playwright

    columns = (
        "model",
        "triangles",
        "moves",
        "metric, s",
        "preview, s",
        "picture, s",
        "longest, s",
        "processor, s",
    )
    print("| " + " | ".join((*columns, "memory before, MB", "after, MB")) + " |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=chromium.browser_path(), args=chromium.ARGUMENTS)
        for word in words or ["fandisk:0", "horse:0", "horse:1"]:
            name, splits, count, *_ = [*word.split(":"), "", ""]
            print(measure(browser, name, int(splits or 0), int(count or MOVES), Path(folder)), flush=True)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
