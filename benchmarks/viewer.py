"""Size and speed of the page of the viewer: `python benchmarks/viewer.py [MODEL:SPLITS...]`.

A split makes four triangles of each. The page is opened in a headless Chromium: the seconds are from the request of the
file until the arrays are unpacked and both views are drawn once, and between frames while the model rotates. Without a
graphics card the CPU draws, so the time between frames is not representative.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

from common import chromium, model

import coneflat

SIZE = {"width": 1366, "height": 768}
# Rotates the model by a small angle in each frame, and returns the milliseconds of each frame.
TURN = """
new Promise((done) => {
  const times = [];
  const step = (time) => {
    times.push(time);
    if (times.length > 12) return done(times.slice(1).map((time, i) => time - times[i]));
    coneflat.panes[0].camera.rotate(0.05, 0.01);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})
"""


def write_page(result: coneflat.Flattening, path: Path) -> float:
    """Write a page, and return the seconds that it took."""
    start = time.perf_counter()
    result.view(path, most_triangles=10**7)
    return time.perf_counter() - start


def load(browser: object, path: Path) -> tuple[float, float]:
    """Return the seconds until a page is drawn, and the milliseconds per frame while the model rotates."""
    page = browser.new_page(viewport=SIZE)  # type: ignore[attr-defined]
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready]", timeout=300_000)
    seconds = int(page.get_attribute("html", "data-ready")) / 1000
    frames = page.evaluate(TURN)
    page.close()
    return seconds, statistics.median(frames)


def main(words: list[str]) -> None:
    from playwright.sync_api import sync_playwright

    print("| model | triangles | page, MB | written, s | loaded, s | frame, ms |")
    print("| --- | --- | --- | --- | --- | --- |")
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=chromium.browser_path(), args=chromium.ARGUMENTS)
        for word in words or ["fandisk:0", "horse:0", "horse:1"]:
            name, _, splits = word.partition(":")
            result = coneflat.flatten(*model(name, int(splits or 0)), charts="atlas")
            page = Path(folder) / f"{name}.html"
            wrote = min(write_page(result, page) for _ in range(3))
            loaded, frame = map(min, zip(*(load(browser, page) for _ in range(3)), strict=True))
            size = page.stat().st_size / 1e6
            print(
                f"| {name} | {len(result.faces):,} | {size:.2f} | {wrote:.2f} | {loaded:.2f} | {frame:.0f} |",
                flush=True,
            )
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
