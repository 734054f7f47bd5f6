"""The command ``python -m experiments``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import bgars
import typer
from bgars.cli.console import print_json, say, stage_progress
from bgars.cli.run import run

from experiments import EXPERIMENTS, write_experiments
from experiments.write import DEFAULT_RADIUS_PX

app = typer.Typer(name="python -m experiments", pretty_exceptions_enable=False)
LINES = "\n\n".join(f"{name}: {experiment.summary}" for name, experiment in EXPERIMENTS.items())


@app.command(
    help=(
        "Reproduce the paper's figures on simulated captures: pictures, a CSV table, and a page that says what "
        "agrees and what does not.\n\n"
        "The base scene is a hemisphere of 90 pixels radius under 8 lights; every method that bgars has is judged. "
        f"'all' runs every experiment; one by one there are:\n\n{LINES}"
    )
)
def experiment(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A name from the list, or all.", show_default=False)],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Folder for the results; made if missing.", show_default=False
        ),
    ],
    page: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the page here, not into OUT; it links the pictures there.", show_default=False
        ),
    ] = None,
    radius_px: Annotated[int, typer.Option(help="Radius of the hemisphere, 10 to 500.")] = DEFAULT_RADIUS_PX,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object for machines instead of text.")
    ] = False,
) -> None:
    """Run an experiment and write its results."""
    with stage_progress() as report:
        summary = write_experiments(name, output, radius_px=radius_px, page=page, progress=report)
    if as_json:
        print_json({"bgars": bgars.__version__, **summary})
        return
    for result in summary["experiments"].values():
        say(result["title"])
        for sentence in result["agrees"]:
            say(f"  agrees: {sentence}")
        for sentence in result["differs"]:
            say(f"  does not: {sentence}")
    say()
    say(f"{len(summary['files'])} files in {output}; read {summary['page']}")


if __name__ == "__main__":
    run(app)
