"""Draw the pictures of docs/report.md: the page of the demo part in Chromium, light and dark.

python docs/make_report_pictures.py
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import bgars
import imageio.v3 as iio
from PIL import Image
from playwright.sync_api import sync_playwright

PICTURES = Path(__file__).parent / "images" / "report"
OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
VIEWS = {"verdict": ("light", "body", 0), "part_and_balls": ("dark", "#part", 1), "surface": ("light", "#view3d", 2)}
SIZE = (1024, 800)
VIEW_3D = 2


def main() -> None:
    """Simulate, inspect, open, photograph."""
    setup = bgars.read_scene("defects-5x5")
    capture, _ = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera, seed=setup.seed)
    result = bgars.inspect(capture, bgars.sample_part_recipe(), surface=True)
    path = os.environ.get("BGARS_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        bgars.write_report(result, Path(folder) / "report.html", capture=capture)
        browser = driver.chromium.launch(executable_path=path, args=OPTIONS)
        for name, (scheme, place, chosen) in VIEWS.items():
            page = browser.new_page(viewport={"width": 1280, "height": 1000}, color_scheme=scheme)
            page.goto((Path(folder) / "report.html").as_uri())
            page.wait_for_selector("html[data-settled]", state="attached")
            if chosen == VIEW_3D:
                page.click("#open-scene")
                page.wait_for_selector("html[data-drawn]", state="attached")
            elif chosen:
                page.locator(".mark", has_text="B4").locator("circle").click()
            page.locator(place).evaluate("node => node.scrollIntoView()")
            page.mouse.move(1270, 500)
            page.wait_for_timeout(300)
            page.screenshot(path=Path(folder) / "shot.png")
            shot = Image.fromarray(iio.imread(Path(folder) / "shot.png")[..., :3]).resize(
                SIZE, Image.Resampling.LANCZOS
            )
            shot.quantize(256, Image.Quantize.MAXCOVERAGE).save(PICTURES / f"{name}.png", optimize=True)
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
