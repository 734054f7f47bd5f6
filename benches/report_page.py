"""What report.html costs: its size, the processor time to write it, and when a browser has which part on screen.

    python benches/report_page.py

A part of 100 and one of 1,024 balls, made from records, over a photograph of their own, with a surface integrated from
the simulator's normals; no image is measured. The browser is Chromium without a graphics card: 3-D is drawn by the
processor there.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
from bgars.ball_records import BallLayout
from bgars.inspection.judge import judge_part
from bgars.inspection_pipeline import BOARD_STEP
from bgars.part_recipe import PartRecipe
from bgars.part_surface import part_surface
from bgars.report.page import plotly_script
from playwright.sync_api import Browser, CDPSession, sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "unit"))
from report_parts import LIMITS, RIG
from synthetic_parts import measured_part

STAGES = (
    ("fcp", "verdict on screen"),
    ("usable", "tables answer"),
    ("charted", "charts drawn"),
    ("cost", "processor time of the page's own thread until then"),
    ("opened", "3-D view drawn, after the click that asks for it"),
    ("opening", "processor time of the page's own thread for that"),
    ("longest", "longest time for which that thread answers nothing meanwhile"),
)
OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
TIMES = """() => Object.fromEntries(performance.getEntriesByType("mark").map(m => [m.name, m.startTime])
    .concat([["fcp", performance.getEntriesByName("first-contentful-paint")[0].startTime]]))"""
WATCH = """() => { window.longest = 0; window.clicked = 0;
    const seen = list => list.getEntries().forEach(e => { window.longest = Math.max(window.longest, e.duration); });
    new PerformanceObserver(seen).observe({ entryTypes: ["longtask"] });
    const button = document.getElementById("open-scene");
    button.addEventListener("click", () => { window.clicked = performance.now(); }, true); }"""
TOLD = """() => new Promise(next => setTimeout(() => next(
    [performance.getEntriesByName("drawn")[0].startTime - window.clicked, window.longest]), 300))"""
RUNS = 3
SIDES = (10, 32)


def write_page(side: int, folder: Path) -> Path:
    """Inspect a part of side x side balls on paper and write its page."""
    scene = bgars.Scene.ball_array(side, side, jitter=bgars.Jitter(8.0, 4.0, 5.0), seed=3)
    capture, truth = bgars.simulate(scene, RIG, bgars.Material(), bgars.Camera(pixel_pitch_um=12.0))
    recipe = PartRecipe("bench", BallLayout(side, side, 1000.0), limits=LIMITS)
    result = judge_part(*measured_part(truth), recipe, pixel_pitch_um=12.0)
    result = replace(result, surface=part_surface(result, *true_fields(truth), BOARD_STEP))
    path = folder / f"{side * side}.html"
    start = time.process_time()
    bgars.write_report(result, path, capture=capture)
    cost = time.process_time() - start
    print(f"{side * side} balls: {path.stat().st_size / 1e6:.1f} MB, written in {cost:.2f} s of processor time")
    return path


def true_fields(truth: bgars.SimulatedTruth) -> tuple[bgars.NormalField, bgars.NormalField]:
    """The simulator's normals of balls and of the board, as an inspection would have found them."""
    shape = truth.mask.shape
    levels = {"albedo": np.ones(shape, np.float32), "confidence": np.ones(shape, np.float32)}
    counts = {"lights_kept": np.full(shape, 8, np.uint16), "method": "truth", "pixel_pitch_um": 12.0}
    ball, board = ((truth.ball_ids > 0), (truth.ball_ids == 0))
    normals = np.ascontiguousarray(truth.normals, np.float32)
    one, two = (bgars.NormalField(normals, mask=mask, measured=mask, **levels, **counts) for mask in (ball, board))
    return one, two


def processor_s(metrics: CDPSession) -> float:
    """Time that the thread of the page has worked, whatever else the machine does."""
    values = metrics.send("Performance.getMetrics")["metrics"]
    return next(entry["value"] for entry in values if entry["name"] == "TaskDuration")


def library_s(browser: Browser, folder: Path) -> float:
    """Processor time of a page that holds plotly.js and nothing else."""
    path = folder / "library.html"
    path.write_text(f"<!doctype html><meta charset=utf-8><script>{plotly_script()}</script>", encoding="utf-8")
    page = browser.new_page()
    metrics = page.context.new_cdp_session(page)
    metrics.send("Performance.enable", {"timeDomain": "threadTicks"})
    before = processor_s(metrics)
    page.goto(path.as_uri())
    cost = processor_s(metrics) - before
    page.close()
    return cost


def main() -> None:
    """Write, open, print."""
    browser_path = os.environ.get("BGARS_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path, args=OPTIONS)
        alone = sorted(library_s(browser, Path(folder)) for _ in range(RUNS))
        print(f"plotly.js alone: median {alone[RUNS // 2]:.1f} s of processor time, {alone[0]:.1f} to {alone[-1]:.1f}")
        for side in SIDES:
            path = write_page(side, Path(folder))
            runs = []
            for _ in range(RUNS):
                page = browser.new_page(viewport={"width": 1280, "height": 900})
                page.goto(path.parent.as_uri())
                metrics = page.context.new_cdp_session(page)
                metrics.send("Performance.enable", {"timeDomain": "threadTicks"})
                before = processor_s(metrics)
                page.goto(path.as_uri(), wait_until="commit")
                page.wait_for_selector("html[data-charted]", state="attached", timeout=120_000)
                cost = processor_s(metrics) - before
                times = page.evaluate(TIMES)
                page.evaluate(WATCH)
                before = processor_s(metrics)
                page.click("#open-scene")
                page.wait_for_selector("html[data-drawn]", state="attached", timeout=120_000)
                opening = processor_s(metrics) - before
                took, longest = page.evaluate(TOLD)
                runs.append(
                    {**times, "cost": 1000.0 * cost, "opened": took, "opening": 1000.0 * opening, "longest": longest}
                )
                page.close()
            for key, words in STAGES:
                seconds = sorted(run[key] / 1000.0 for run in runs)
                middle = f"median {seconds[len(seconds) // 2]:.1f} s of {RUNS}"
                print(f"  {words}: {middle}, {seconds[0]:.1f} to {seconds[-1]:.1f}")
        browser.close()
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
