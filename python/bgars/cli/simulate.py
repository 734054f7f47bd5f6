"""The command ``bgars simulate``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

import bgars
from bgars.cli.console import print_json, say, stage_progress
from bgars.pipelines.scene_recipes import named_recipes, write_simulation_of

__all__ = ["register"]

MEANINGS = {
    "capture.toml": "how to read the images: bgars info, reconstruct, evaluate",
    "gt.npz": "true normals, heights, labels and lit masks, for bgars evaluate",
    "balls.csv": "the true ball table",
    "truth.json": "the same as JSON, with both coplanarities",
    "scene.json": "the recipe that makes the same images again",
    "albedo_map.npy": "albedo of the board",
    "response.csv": "response of the camera",
}


def register(app: typer.Typer) -> None:
    """Add the command; its help lists the recipes that ship with bgars."""
    recipes = "\n\n".join(f"{name}: {description}" for name, description in named_recipes().items())
    app.command(
        "simulate",
        help=(
            "Render a simulated part with known truth: a capture folder that every other command reads.\n\n"
            "One reflection, no light from ball to ball; attached and cast shadows are exact. "
            "A recipe file (.toml; docs/simulator.md) describes part, lights and camera; "
            "these recipes come with bgars:\n\n"
            f"{recipes}"
        ),
    )(simulate)


def simulate(
    recipe: Annotated[
        str,
        typer.Argument(
            metavar="RECIPE", help="A name from the list, a .toml file, or a scene.json.", show_default=False
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT",
            help="Folder of the capture; created if missing. It must not hold a capture already.",
            show_default=False,
        ),
    ],
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of noise and ball-to-ball material, instead of the recipe's.", show_default=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Run a recipe and write its capture."""
    setup = bgars.read_scene(recipe)
    threads = os.environ.get("RAYON_NUM_THREADS", "")
    with stage_progress() as report:

        def run() -> tuple[bgars.Capture, bgars.SimulatedTruth]:
            return bgars.simulate(
                setup.scene,
                setup.rig,
                setup.material,
                setup.camera,
                seed=setup.seed if seed is None else seed,
                threads=int(threads) if threads.isdecimal() and int(threads) > 0 else None,
                progress=lambda fraction: report("simulate", fraction),
            )

        files, truth = write_simulation_of(run, output)
    summary = _summary(recipe, truth, files)
    if as_json:
        print_json(summary)
        return
    rows, cols = summary["shape"]
    say(f"{recipe}: {len(truth.setup.rig)} images of {cols} x {rows} pixels, {_parts(summary)}.")
    if truth.seating_coplanarity_um is not None and truth.regression_coplanarity_um is not None:
        say(
            f"Coplanarity: {truth.seating_coplanarity_um:.2f} um (seating plane), "
            f"{truth.regression_coplanarity_um:.2f} um (regression plane)."
        )
    images = [name for name in files if name.startswith("light_")]
    width = max(len(str(output / name)) for name in files)
    say(f"  {output / images[0]!s:<{width}}  ... {images[-1]}: one image per light")
    for name, meaning in MEANINGS.items():
        if name in files:
            say(f"  {output / name!s:<{width}}  {meaning}")
    say()
    say(f"Next: bgars evaluate {output}")


def _summary(recipe: str, truth: bgars.SimulatedTruth, files: list[str]) -> dict[str, Any]:
    return {
        "bgars": bgars.__version__,
        "recipe": recipe,
        "lights": len(truth.setup.rig),
        "shape": list(truth.normals.shape[:2]),
        "pixel_pitch_um": truth.setup.camera.pixel_pitch_um,
        "seed": truth.setup.seed,
        **truth.summary(),
        "files": files,
    }


def _parts(summary: dict[str, Any]) -> str:
    if not summary["balls"]:
        return "no balls"
    defects = ", ".join(f"{name} {defect}" for name, defect in summary["defects"].items())
    return f"{summary['present']} of {summary['balls']} balls" + (f" ({defects})" if defects else "")
