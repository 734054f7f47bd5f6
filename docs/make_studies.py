"""Gauge studies of a simulated rig; rewrite table and picture of docs/studies.md: ``make studies`` (15 minutes).

Parts, placements and repeats are those of a real study; noise is drawn anew for each image. Nothing else changes
between repeats, and a placement only shifts and turns the part: the figures are what noise and pixels leave, not what
a machine with a fixture, a lens and a temperature reaches.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import bgars
import numpy as np
from bgars.records.ball_layout import BallLayout
from bgars.report.figure_file import write_png
from bgars.report.figures.style import figure_style, new_figure
from bgars.studies.gauge import GaugeFigures
from bgars.studies.study_folder import Run
from bgars.studies.svg import PLACEMENT_COLORS

DOCS = Path(__file__).parent
PAGE, PICTURE = DOCS / "studies.md", DOCS / "images" / "studies" / "repeatability.png"
START, END = "<!-- table: docs/make_studies.py -->", "<!-- end of the table -->"
PITCHES_UM, BITS, NOISES = (5.0, 10.0, 20.0), (8, 12), (1.0, 2.0, 4.0)
PARTS, PLACEMENTS, REPEATS = 3, 3, 2
ROWS, COLS = 3, 4
PEDESTAL = 16.0
LIMITS = bgars.Limits(
    true_position_um=50.0, diameter_um=(560.0, 640.0), height_um=(460.0, 540.0), seating_coplanarity_um=80.0
)
RECIPE = bgars.PartRecipe("simulated 3 x 4", BallLayout(ROWS, COLS, 1000.0), limits=LIMITS)
SHOWN = ("diameter_um", "top_um", "true_position_um", "seating_coplanarity_um")
HEADING = (
    "| pixel (µm) | bits | noise (of 255) | diameter | height of the top | true position | seating coplanarity "
    "| stated u of the height | GRR of the height, of 80 µm |"
)


class Setting(NamedTuple):
    """A camera."""

    pitch_um: float
    bits: int
    noise: float


def capture(setting: Setting, part: int, placement: int, repeat: int) -> bgars.Capture:
    """Return one run: the part's balls, its place under the camera, and noise of its own."""
    random = np.random.default_rng([part, placement])
    x_um, y_um = random.uniform(-2.0, 2.0, 2) * setting.pitch_um
    scene = bgars.Scene.ball_array(
        ROWS,
        COLS,
        centre_um=(float(x_um), float(y_um)),
        rotation_deg=float(random.uniform(-0.5, 0.5)),
        jitter=bgars.Jitter(height_um=8.0, radius_um=3.0, position_um=5.0),
        seed=1 + part,
        board=bgars.Board(bgars.Material.matte(0.3), texture=bgars.Texture(0.2)),
    )
    level = 1.0 if setting.bits == BITS[0] else 65535.0 / 255.0
    camera = bgars.Camera(
        pixel_pitch_um=setting.pitch_um,
        bit_depth=setting.bits,  # type: ignore[arg-type]
        black_level=PEDESTAL * level,
        read_noise_levels=setting.noise * level,
        supersample=2,
    )
    material = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)
    seed = 1 + part + 10 * placement + 100 * repeat
    return bgars.simulate(scene, bgars.LightRig.ring(8), material, camera, seed=seed)[0]


def study(setting: Setting) -> tuple[dict[str, GaugeFigures], float]:
    """Return the figures of a study, and the median of the stated standard uncertainties of the heights."""
    runs, stated = [], []
    for part in range(PARTS):
        for placement in range(PLACEMENTS):
            for repeat in range(REPEATS):
                result = bgars.inspect(capture(setting, part, placement, repeat), RECIPE)
                names = (str(part), str(placement), str(repeat))
                runs.append(Run(*names, Path(*names), result))
                stated += [ball.u_top_um for ball in result.balls]
    parts, placements = (tuple(str(at) for at in range(count)) for count in (PARTS, PLACEMENTS))
    found = bgars.gauge_rr(bgars.Study(Path(), parts, placements, REPEATS, tuple(runs), ()))
    if found.left_out:
        sys.exit(f"{setting}: {found.left_out[0]}")
    return {each.characteristic: each for each in found.figures}, float(np.median(stated))


def line(setting: Setting, figures: dict[str, GaugeFigures], stated_um: float) -> str:
    """One line of the table."""
    cells = [f"{setting.pitch_um:g}", str(setting.bits), f"{setting.noise:g}"]
    cells += [f"{figures[name].spread('EV').sigma:.3f} / {figures[name].spread('GRR').sigma:.3f}" for name in SHOWN]
    cells += [f"{stated_um:.3f}", f"{figures['top_um'].spread('GRR').percent_tolerance:.1f} %"]
    return f"| {' | '.join(cells)} |"


def words(lines: list[str]) -> str:
    """Say what the table says, from its own cells."""
    rows = [[cell.strip() for cell in each.strip("|").split("|")] for each in lines]
    grr = {(float(row[0]), int(row[1]), float(row[2])): float(row[4].split("/")[1]) for row in rows}
    ev = {key: float(row[4].split("/")[0]) for key, row in zip(grr, rows, strict=True)}
    told = []
    for pitch_um in PITCHES_UM:
        own = [value for key, value in grr.items() if key[0] == pitch_um]
        told.append(f"{min(own):.2f} to {max(own):.2f} µm at {pitch_um:g} µm per pixel")
    calm, loud = ([ev[pitch_um, bits, noise] for pitch_um in PITCHES_UM for bits in BITS] for noise in NOISES[::2])
    deeper = [
        grr[pitch_um, BITS[1], noise] / grr[pitch_um, BITS[0], noise] for pitch_um in PITCHES_UM for noise in NOISES
    ]
    factors = [b / a for a, b in zip(calm, loud, strict=True)]
    placing = sum(ev[key] < grr[key] / 2.0 for key in grr)
    stated = [float(row[7]) / value for value, row in zip(grr.values(), rows, strict=True)]
    return (
        f"GRR of the height is {', '.join(told)}. Four times the noise makes its repeatability {min(factors):.1f} to "
        f"{max(factors):.1f} times as large; {BITS[1]} bits instead of {BITS[0]} multiply its GRR by "
        f"{min(deeper):.2f} to {max(deeper):.2f}. In {placing} of {len(grr)} lines its EV is under half of its GRR: "
        "there, most comes from placing (another place on the pixels, another turn), not from noise. The standard "
        f"uncertainty that the inspection states is {min(stated):.1f} to {max(stated):.1f} times GRR."
    )


def draw(all_figures: dict[Setting, dict[str, GaugeFigures]]) -> None:
    """Draw the repeatability of the height, with its interval, over the noise."""
    with figure_style():
        figure = new_figure(8.0, 4.2, "constrained")
        axes = figure.add_subplot()
        for colour, pitch_um in zip(PLACEMENT_COLORS, PITCHES_UM, strict=False):
            for bits, mark, dash in zip(BITS, "os", ("-", "--"), strict=True):
                top = [all_figures[Setting(pitch_um, bits, noise)]["top_um"] for noise in NOISES]
                ev = np.array([each.spread("EV").sigma for each in top])
                reach = np.abs(np.array([(each.ev_low, each.ev_high) for each in top]).T - ev)
                x = np.array(NOISES) * (0.98 if bits == BITS[0] else 1.02)
                label = f"{pitch_um:g} µm per pixel, {bits} bit"
                axes.errorbar(x, ev, reach, fmt=mark + dash, color=colour, capsize=3, markersize=5, label=label)
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.set_xticks(NOISES, [f"{noise:g}" for noise in NOISES])
        ticks = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_xlabel("noise of an image (standard deviation, grey levels of 255)")
        axes.set_ylabel("repeatability of a ball's height (1 sigma, µm)")
        axes.grid(visible=True, color="0.9")
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside right upper")
        PICTURE.parent.mkdir(parents=True, exist_ok=True)
        write_png(figure, PICTURE)


def main() -> None:
    """Rewrite the page between the marks, and the picture."""
    lines = [HEADING, "| ---: |" + " ---: |" * 8]
    found: dict[Setting, dict[str, GaugeFigures]] = {}
    for setting in (Setting(pitch, bits, noise) for pitch in PITCHES_UM for bits in BITS for noise in NOISES):
        figures, stated_um = study(setting)
        found[setting] = figures
        lines.append(line(setting, figures, stated_um))
        sys.stderr.write(lines[-1] + "\n")
    draw(found)
    lines += ["", words(lines[2:])]
    head, rest = PAGE.read_text(encoding="utf-8").split(START)
    PAGE.write_text(f"{head}{START}\n\n" + "\n".join(lines) + f"\n\n{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
