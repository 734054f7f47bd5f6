"""What report.html costs: its size, the processor time to write it, and when a browser has which part on the screen.

    python benches/report_page.py

A part of 100 and one of 1,024 balls, made from records, over a photograph of their own, with a surface integrated from
the simulator's normals; no image is measured. The browser is Chromium without a graphics card: 3-D is drawn by the
processor there. Charts are drawn when the reader comes near them, so how long they take is told in three ways: the page
opened at its first chart, one chart jumped to, and all of them scrolled through; each from a page opened anew. "On the
screen" is a frame after it was made; "idle" is the end of the last task of more than 50 ms before a second without one.
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
from bgars.inspection.judge import judge_part
from bgars.pipelines.inspect import BOARD_STEP
from bgars.pipelines.part_surface import part_surface
from bgars.records.ball_layout import BallLayout
from bgars.records.part_recipe import PartRecipe
from bgars.report.html.page import plotly_script
from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "unit"))
from report_parts import LIMITS, RIG
from synthetic_parts import measured_part

STAGES = (
    ("fcp", "verdict on the screen"),
    ("usable", "tables on the screen, sorting and filtering"),
    ("idle", "first screen whole, page idle"),
    ("idle_cost", "processor time of the page's own thread until then"),
    ("at_chart", "opened at its first chart: chart on the screen"),
    ("jumped", "a chart on the screen, after a jump to it"),
    ("all", "every chart drawn, after the first scroll, one screen after the other"),
    ("all_cost", "processor time of the page's own thread for that"),
    ("opened", "3-D view drawn, after the click that asks for it"),
    ("opening", "processor time of the page's own thread for that"),
    ("longest", "longest time for which that thread answers nothing meanwhile"),
)
OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WATCH = """(() => {
    const bench = window.bench = { busy: 0, longest: 0 };
    new PerformanceObserver(list => list.getEntries().forEach(task => {
        bench.busy = task.startTime + task.duration;
        bench.longest = Math.max(bench.longest, task.duration);
    })).observe({ entryTypes: ["longtask"] });
    // A frame later: what was there before is on the screen.
    bench.shown = test => new Promise(next => {
        const soon = () => requestAnimationFrame(() => setTimeout(() => next(performance.now()), 0));
        const look = () => test() ? soon() : requestAnimationFrame(look);
        look();
    });
    const stage = name => () => document.documentElement && name in document.documentElement.dataset;
    bench.usable = bench.shown(stage("usable"));
    bench.settled = bench.shown(stage("settled"));
    bench.idle = async () => {
        const settled = await bench.settled, last = () => Math.max(settled, bench.busy);
        while (performance.now() - last() < 1000) await new Promise(next => setTimeout(next, 100));
        return last();
    };
    bench.chart = name => bench.shown(() => document.querySelector(`[data-figure=${name}] .main-svg`));
})()"""
OPENED = """async () => ({ idle: await bench.idle(), usable: await bench.usable,
    fcp: performance.getEntriesByName("first-contentful-paint")[0].startTime })"""
JUMP = """async () => { const start = performance.now();
    document.getElementById("offsets").scrollIntoView();
    return await bench.chart("offsets") - start; }"""
SCROLL = """async () => { const start = performance.now();
    for (const node of document.querySelectorAll("[data-figure]:not([data-figure=scene])")) {
        node.scrollIntoView({ block: "center" });
        await bench.chart(node.dataset.figure);
    }
    await bench.shown(() => "charted" in document.documentElement.dataset);
    return performance.now() - start; }"""
CLICK = """() => { bench.longest = 0; const button = document.getElementById("open-scene");
    button.addEventListener("click", () => { bench.clicked = performance.now(); }, true); }"""
DRAWN = """() => new Promise(next => setTimeout(() => next(
    [performance.getEntriesByName("drawn")[0].startTime - bench.clicked, bench.longest]), 300))"""
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
    one, two = (bgars.NormalField(normals, mask=mask, is_measured=mask, **levels, **counts) for mask in (ball, board))
    return one, two


class Visit:
    """The page opened in a browser that knows nothing of it; `cost_ms` is processor time of the page's own thread."""

    def __init__(self, browser: Browser, path: Path, part: str = "") -> None:
        self.page = browser.new_page(viewport={"width": 1280, "height": 900})
        self.page.set_default_timeout(120_000)
        self.page.add_init_script(WATCH)
        self.page.goto(path.parent.as_uri())
        self.metrics = self.page.context.new_cdp_session(self.page)
        self.metrics.send("Performance.enable", {"timeDomain": "threadTicks"})
        self.before = self.worked_s()
        self.page.goto(path.as_uri() + part, wait_until="commit")

    def __enter__(self) -> Visit:
        return self

    def __exit__(self, *_: object) -> None:
        self.page.close()

    def worked_s(self) -> float:
        """Time that the thread of the page has worked, whatever else the machine does."""
        values = self.metrics.send("Performance.getMetrics")["metrics"]
        return next(entry["value"] for entry in values if entry["name"] == "TaskDuration")

    def cost_ms(self) -> float:
        """Processor time since this was last asked for."""
        before, self.before = self.before, self.worked_s()
        return 1000.0 * (self.before - before)


def library_ms(browser: Browser, folder: Path) -> float:
    """Processor time of a page that runs plotly.js and nothing else."""
    path = folder / "library.html"
    path.write_text(f"<!doctype html><meta charset=utf-8><script>{plotly_script()}</script>", encoding="utf-8")
    with Visit(browser, path) as visit:
        visit.page.wait_for_load_state()
        return visit.cost_ms()


def timed(browser: Browser, path: Path) -> dict[str, float]:
    """Every time of one run, ms."""
    with Visit(browser, path, "#coplanarity") as visit:
        times = {"at_chart": visit.page.evaluate("bench.chart('coplanarity')")}
    with Visit(browser, path) as visit:
        times |= {**visit.page.evaluate(OPENED), "idle_cost": visit.cost_ms()}
        times |= {"all": visit.page.evaluate(SCROLL), "all_cost": visit.cost_ms()}
    with Visit(browser, path) as visit:
        visit.page.evaluate(OPENED)
        times["jumped"] = visit.page.evaluate(JUMP)
        visit.page.wait_for_timeout(1000)  # neighbours of the chart are drawn
        visit.page.evaluate(CLICK)
        visit.cost_ms()
        visit.page.click("#open-scene")
        visit.page.wait_for_selector("html[data-drawn]", state="attached")
        times["opening"] = visit.cost_ms()
        times["opened"], times["longest"] = visit.page.evaluate(DRAWN)
    return times


def main() -> None:
    """Write, open, print."""
    browser_path = os.environ.get("BGARS_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path, args=OPTIONS)
        print(f"plotly.js alone: {middle([library_ms(browser, Path(folder)) for _ in range(RUNS)])} of processor time")
        for side in SIDES:
            path = write_page(side, Path(folder))
            runs = [timed(browser, path) for _ in range(RUNS)]
            for key, words in STAGES:
                print(f"  {words}: {middle([run[key] for run in runs])}")
        browser.close()
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


def middle(times_ms: list[float]) -> str:
    """Median and range in words."""
    seconds = sorted(time_ms / 1000.0 for time_ms in times_ms)
    return f"median {seconds[len(seconds) // 2]:.1f} s of {len(seconds)}, {seconds[0]:.1f} to {seconds[-1]:.1f}"


if __name__ == "__main__":
    main()
