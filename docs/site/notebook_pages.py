"""Notebooks as pages: each file of examples/notebooks is run, its cells and their outputs become Markdown."""

from __future__ import annotations

import posixpath
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbconvert import MarkdownExporter
from traitlets.config import Config

FOLDER = Path(__file__).parents[2] / "examples" / "notebooks"
ORDER = ("first_capture", "inspect_part", "compare_methods", "own_setup")
SECONDS = 600


def notebook_pages(work_folder: Path) -> dict[str, str | bytes]:
    """Pages, pictures and .ipynb files by their paths in the site; `work_folder` is where the notebooks run."""
    found = {path.stem for path in FOLDER.glob("*.py")}
    if found != set(ORDER):
        msg = f"docs/site/notebook_pages.py: ORDER names {ORDER}, {FOLDER} holds {sorted(found)}"
        raise ValueError(msg)
    files: dict[str, str | bytes] = {}
    rows = []
    for name in ORDER:
        notebook = jupytext.read(FOLDER / f"{name}.py")
        notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
        quiet = ["--log-level=ERROR"]  # else each kernel warns that it talks over TCP on this machine
        resources = {"metadata": {"path": str(work_folder)}}
        NotebookClient(notebook, timeout=SECONDS, extra_arguments=quiet, resources=resources).execute()
        body, pictures = _markdown(notebook, name)
        files[f"notebooks/{name}.md"] = body
        files[f"notebooks/{name}.ipynb"] = nbformat.writes(notebook)
        files |= {f"notebooks/{picture}": content for picture, content in pictures.items()}
        title, purpose = _title(notebook)
        rows.append(f"| [{title}]({name}.md) | {purpose} | [ipynb]({name}.ipynb) |")
    files["notebooks/index.md"] = "\n".join([INTRODUCTION, "| notebook | what it shows | file |", "| --- | --- | --- |", *rows])
    return files


INTRODUCTION = """# Notebooks

Each runs in seconds to a minute and needs no data of yours. The pages show what building this site has put out. To run one yourself:
`pip install '.[report]' jupyterlab jupytext`, then open a file of `examples/notebooks` as a notebook, or take an .ipynb file from here.
"""


def _title(notebook: nbformat.NotebookNode) -> tuple[str, str]:
    """Heading and first paragraph of the first cell."""
    heading, _, rest = notebook.cells[0].source.partition("\n\n")
    return heading.removeprefix("# "), rest.split("\n\n")[0].replace("\n", " ")


def _markdown(notebook: nbformat.NotebookNode, name: str) -> tuple[str, dict[str, bytes]]:
    """Code in fences, outputs in boxes; pictures apart, by their file names."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            # Of several forms of one output the best for a page: a picture, then HTML, then text.
            data = output.get("data", {})
            if "image/png" in data:
                data.pop("text/plain", None)
    settings = Config()
    settings.NbConvertBase.display_data_priority = ["image/png", "text/html", "text/markdown", "text/plain"]
    settings.ExtractOutputPreprocessor.output_filename_template = name + "_{cell_index}_{index}{extension}"
    body, resources = MarkdownExporter(config=settings).from_notebook_node(notebook)
    pictures = {posixpath.basename(picture): content for picture, content in resources.get("outputs", {}).items()}
    return body, pictures
