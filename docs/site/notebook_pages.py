"""Notebooks as pages: each file of examples/notebooks is run, its cells and their outputs become Markdown."""

from __future__ import annotations

import base64
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

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
    files["notebooks/index.md"] = "\n".join(
        [INTRODUCTION, "| notebook | what it shows | file |", "| --- | --- | --- |", *rows]
    )
    return files


INTRODUCTION = """# Notebooks

Each runs in seconds and needs no data of yours. The pages show what came out when this site was built. To run one
yourself: `pip install '.[report]' jupyterlab jupytext`, then open a file of `examples/notebooks` as a notebook, or take
an .ipynb file from here.
"""


def _title(notebook: nbformat.NotebookNode) -> tuple[str, str]:
    """Heading and first paragraph of the first cell."""
    heading, _, rest = notebook.cells[0].source.partition("\n\n")
    return heading.removeprefix("# "), rest.split("\n\n")[0].replace("\n", " ")


def _markdown(notebook: nbformat.NotebookNode, name: str) -> tuple[str, dict[str, bytes]]:
    """Code in fences, outputs in boxes; pictures apart, by their file names."""
    text: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            text.append(cell.source)
            continue
        text.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            picture = f"{name}_{len(pictures) + 1}.png"
            shown, content = _shown(output, picture)
            text.append(f'<div class="output" markdown>\n\n{shown}\n\n</div>')
            if content is not None:
                pictures[picture] = content
    return "\n\n".join(text), pictures


def _shown(output: nbformat.NotebookNode, picture: str) -> tuple[str, bytes | None]:
    """Of several forms of one output the best for a page: a picture, HTML, or text."""
    data = output.get("data", {})
    if "image/png" in data:
        return f"![output of the cell above]({picture})", base64.b64decode(data["image/png"])
    if "text/html" in data:
        return data["text/html"].replace("\n", " "), None
    return f"```text\n{output.get('text', data.get('text/plain', '')).rstrip()}\n```", None
