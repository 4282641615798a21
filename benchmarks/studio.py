"""How long the studio takes from a click to the picture: `python benchmarks/studio.py [MODEL:SPLITS...]`.

A split makes four triangles of each. The page is in a headless Chromium. After a search each cone is moved by hand to a
neighbour and back; the seconds are from the request until the new layout is drawn. Those of the flattening are part of
it, and what the process that does it has in memory at the end is told, too.
"""

from __future__ import annotations

import os
import shutil
import statistics
import sys
import tempfile
import threading
from pathlib import Path

from common import model

from coneflat.apps.studio.serve import listening
from coneflat.apps.studio.server import StudioServer
from coneflat.apps.studio.session import Session

SIZE = {"width": 1366, "height": 768}
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
MOVES = 8
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


def moves(page: object, session: Session) -> tuple[list[float], list[float]]:
    """Return the seconds of each move until it was drawn, and those of its flattening."""
    took, flattened = [], []
    for k in range(MOVES):
        before = page.evaluate("studio.layout")  # type: ignore[attr-defined]
        page.evaluate(MOVE % k)  # type: ignore[attr-defined]
        page.wait_for_function(SETTLED.format(before), timeout=PATIENCE)  # type: ignore[attr-defined]
        took.append(page.evaluate("studio.took") / 1000)  # type: ignore[attr-defined]
        flattened.append(session.state()["seconds"])
    return took, flattened


def memory(process: int | None) -> float:
    """Return the megabytes that a process has, where the system tells."""
    status = Path(f"/proc/{process}/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), float("nan"))


def measure(browser: object, name: str, splits: int, folder: Path) -> str:
    """Return a row of the table."""
    vertices, faces = model(name, splits)
    path = folder / f"{name}{splits}.off"
    with path.open("w") as stream:
        stream.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
        stream.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        stream.writelines(f"3 {a} {b} {c}\n" for a, b, c in faces.tolist())
    session = Session(folder)
    with listening(0) as listener:
        port = listener.getsockname()[1]
        server = StudioServer(session, "token", port)
        thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
        thread.start()
        session.open(path)
        page = browser.new_page(viewport=SIZE, bypass_csp=True)  # type: ignore[attr-defined]
        page.goto(f"http://127.0.0.1:{port}/?token=token")
        page.wait_for_selector("html[data-ready]", timeout=PATIENCE)
        page.wait_for_function(SETTLED.format(0), timeout=PATIENCE)
        took, flattened = moves(page, session)
        size = memory(session.worker_process)
        page.close()
        server.should_exit = True
        thread.join()
    seconds = f"{statistics.median(took):.2f} | {max(took):.2f} | {statistics.median(flattened):.2f}"
    return f"| {name} | {len(faces):,} | {seconds} | {size:.0f} |"


def main(words: list[str]) -> None:
    from playwright.sync_api import sync_playwright

    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    print("| model | triangles | click to picture, s | longest, s | of it flattening, s | memory, MB |")
    print("| --- | --- | --- | --- | --- | --- |")
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(
            executable_path=path, args=["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        )
        for word in words or ["fandisk:0", "horse:0", "horse:1"]:
            name, _, splits = word.partition(":")
            print(measure(browser, name, int(splits or 0), Path(folder)), flush=True)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
