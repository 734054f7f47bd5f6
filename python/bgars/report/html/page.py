"""One page that shows an inspection, whole in one file."""

from __future__ import annotations

import importlib.util
import json
from base64 import b64encode
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.extras import how_to_install
from bgars.io.atomic import atomic_file
from bgars.records.part_result import PartResult
from bgars.report.html.budget import BUDGET_COLUMNS, budget_table
from bgars.report.html.charts import coplanarity_chart, histogram_charts
from bgars.report.html.chosen import chosen_marks
from bgars.report.html.files import REPORT_FILES
from bgars.report.html.material import material_facts, material_rows
from bgars.report.html.photograph import side_files
from bgars.report.html.picture import part_picture
from bgars.report.html.scene import scene_chart, view_words
from bgars.report.html.source import PageSource, read_page_source, source_of
from bgars.report.html.still import still_of
from bgars.report.html.tables import (
    ball_rows,
    board_words,
    key_readings,
    light_rows,
    raised_together,
    recipe_rows,
    spreads,
    unmeasured,
)
from bgars.report.html.units import with_micro
from bgars.report.html.vectors import VectorChart, vector_chart
from bgars.report.html.words import QUANTITIES, VERDICT_MARKS, VERDICT_MEANINGS, ball_state, listed, number
from bgars.report.identity import identity_facts

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

    from bgars.records.capture import Capture

__all__ = ["REPORT_FILES", "write_page", "write_report"]

TEMPLATES = Path(__file__).parent / "template"
SEATS_TOLD = 3
SHARED_PLOTLY = "plotly.min.js"


def write_report(
    result: PartResult | str | PathLike[str],
    path: str | PathLike[str],
    *,
    capture: Capture | None = None,
) -> dict[str, str]:
    """Write the page of an inspection: one HTML file that loads nothing and works without a network.

    Heights on the page are those of the result. Its 3-D view shows the integrated surface that the result brings
    (``bgars.inspect(..., surface=True)``), else spheroids as the shadows gave them; everything below the equator is
    drawn and grey.

    Parameters
    ----------
    result : PartResult or path
        From :func:`bgars.inspect`; or a folder that ``bgars inspect`` wrote, or a result.json.
    path : path
        The page, ``.html``. With a capture, photograph.jpg, report.json and, where there is a surface, surface.npz are
        left beside it: from these and result.json the page can be written again.
    capture : Capture, optional
        That the result was made from: without one the part is drawn without a photograph. Not with a path.

    Returns
    -------
    dict of str
        Names of the files written and what they are.

    Raises
    ------
    InputError
        A capture with a path; a capture without a pixel pitch or of another number of lights.
    FileFormatError
        No result at the path, or a file that cannot be written.

    Examples
    --------
    >>> import bgars, tempfile
    >>> from pathlib import Path
    >>> capture = bgars.read_capture(bgars.sample_capture())
    >>> result = bgars.inspect(capture)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = bgars.write_report(result, Path(folder) / "report.html", capture=capture)
    >>> sorted(files)
    ['photograph.jpg', 'report.html', 'report.json']
    """
    path = Path(path)
    _check_suffix(path)
    if isinstance(result, PartResult):
        source = _made_source(result, capture)
    elif capture is not None:
        msg = "capture: must not be given with the path of a result, whose folder keeps the photograph"
        raise InputError(msg)
    else:
        source = read_page_source(Path(result))
    written = {path.name: REPORT_FILES["report.html"]}
    if capture is None or source.photograph is None:
        write_page(source, path)
        return written
    with ThreadPoolExecutor(1) as beside:
        # To compress the surface leaves the interpreter to the page.
        others = beside.submit(side_files, source.photograph, source.lamps, source.surface)
        write_page(source, path)
    for name, content in others.result().items():
        with atomic_file(path.with_name(name)) as temporary:
            temporary.write_bytes(content)
        written[name] = REPORT_FILES[name]
    return written


def write_page(source: PageSource, path: Path, *, shared_plotly: bool = False) -> None:
    """Write the page of a source, whole or not at all.

    With `shared_plotly`, plotly.js lies beside the page, once for all pages of the folder, and not in each.
    """
    _check_suffix(path)
    text = page_text(source, plotly_file=SHARED_PLOTLY if shared_plotly else "")
    if shared_plotly:
        _write_plotly(path.with_name(SHARED_PLOTLY))
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _check_suffix(path: Path) -> None:
    if path.suffix.lower() not in {".html", ".htm"}:
        msg = f"{path}: must end in .html"
        raise InputError(msg)


def _made_source(result: PartResult, capture: Capture | None) -> PageSource:
    if capture is not None:
        if capture.pixel_pitch_um is None:
            msg = "capture.pixel_pitch_um: needed for a report in um, got none"
            raise InputError(msg)
        if len(result.light_directions) != len(capture.images):
            msg = (
                f"capture: must have the {len(result.light_directions)} lights of the result, got {len(capture.images)}"
            )
            raise InputError(msg)
    return source_of(result, capture)


def _write_plotly(path: Path) -> None:
    text = str(plotly_script())
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page_text(source: PageSource, *, plotly_file: str = "") -> str:
    """Return the page: the same source, the same text; with `plotly_file`, it takes plotly.js from there."""
    plain = source.result
    plain_json = _json(plain)
    source = replace(source, result=with_micro(source.result))
    result = source.result
    figures, vectors = _figures(source)
    still = still_of(figures["scene"]) if "scene" in figures else None  # None, too, for a damaged result
    places = chosen_marks(result, figures)
    # Apart from the others: it is only read when the view is opened.
    scene = figures.pop("scene", None)
    plotly, js = _markup("") if plotly_file else plotly_script(), _script(_file("report.js"))
    allowed = [f"'sha256-{_hash(text)}'" for text in ((js,) if plotly_file else (plotly, js))]
    seats = [listed(seat["balls"], 8) for seat in result["seatings"][:SEATS_TOLD]]
    residual = result["shadow_residual_rms"]
    return _template().render(
        result=result,
        mark=VERDICT_MARKS[result["verdict"]],
        meaning=VERDICT_MEANINGS[result["verdict"]],
        counts=_counts(result),
        readings=key_readings(result),
        spreads=spreads(result),
        has_limits=any(value is not None for value in ((result["recipe"] or {}).get("limits") or {}).values()),
        picture=part_picture(source),
        photograph=source.photograph,
        rows=ball_rows(result),
        columns=_columns(),
        figures=figures,
        histograms=[(q.name, q.title) for q in QUANTITIES if q.name in figures],
        magnification=None if vectors is None else f"{vectors.magnification:g}",
        zones="" if vectors is None else vectors.zones,
        raised=raised_together(source),
        grid_angle=number(result["grid_angle_deg"], 3),
        seats=seats,
        no_plane="; ".join(row["why"] for row in unmeasured(result) if "coplanarity" in row["what"]),
        residual="not measured"
        if residual is None
        else f"{100 * residual:.1f} % of the contrast of lit to shadowed board",
        board=board_words(result),
        budget=budget_table(result),
        budget_columns=BUDGET_COLUMNS,
        lights=light_rows(source),
        material=material_rows(result),
        material_facts=material_facts(result),
        unmeasured=unmeasured(result),
        pixel_pitch=number(result["pixel_pitch_um"], 4),
        recipe=recipe_rows(result["recipe"]),
        css=_script(_file("report.css")),
        plotly=plotly,
        js=js,
        script_hashes=_markup(" ".join([*allowed, *(["'self'", "file:"] if plotly_file else [])])),
        plotly_file=plotly_file,
        identity=identity_facts(plain),
        result_json=plain_json,
        page_json=_json({"figures": figures, "places": places}),
        scene_json=None if scene is None else _json(scene),
        still=still,
        view=view_words(source),
    )


def _figures(source: PageSource) -> tuple[dict[str, dict[str, Any]], VectorChart | None]:
    """Every chart that can be drawn, and that of the offsets with its words."""
    result = source.result
    vectors = vector_chart(result)
    charts = {
        "coplanarity": coplanarity_chart(result),
        "offsets": None if vectors is None else vectors.figure,
        **histogram_charts(result),
        "scene": scene_chart(result, source.surface),
    }
    figures = {name: chart for name, chart in charts.items() if chart is not None}
    return figures, vectors


def _counts(result: dict[str, Any]) -> list[tuple[str, int]]:
    """Every ball once: those that are there by their verdict, places without one apart."""
    count = Counter(ball["verdict"] if ball["present"] else ball_state(ball) for ball in result["balls"])
    return [(name, count[name]) for name in (*VERDICT_MARKS, "missing", "unclear") if count[name]]


def _columns() -> list[dict[str, Any]]:
    """Heads of the table of balls."""
    columns = [
        ("index", "ball", "in reading order", False, ""),
        ("verdict", "verdict", "by verdict, fail first", False, ""),
        ("x_um", "x", "by x: centre, right is positive", True, "µm"),
        ("y_um", "y", "by y: centre, up is positive", True, "µm"),
        *((q.name, q.title, f"by {q.title}: {q.meaning}", True, q.unit) for q in QUANTITIES),
        ("lights_used", "lights", "by the number of usable shadows", True, ""),
        ("reasons", "reasons", "by reason", False, ""),
    ]
    names = ("key", "title", "meaning", "num", "unit")
    return [dict(zip(names, (key, title, f"sort {how}", *rest), strict=True)) for key, title, how, *rest in columns]


@cache
def _template() -> Template:
    # Imported here: whoever writes no page does not wait for it.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # noqa: PLC0415

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template("report.html.j2")


@cache
def plotly_script() -> Markup:
    """plotly.js as the package plotly brings it, read without importing that package."""
    found = importlib.util.find_spec("plotly")
    if found is None or not found.submodule_search_locations:
        msg = f"report.html {how_to_install('plotly')}"
        raise InputError(msg)
    path = Path(found.submodule_search_locations[0]) / "package_data" / "plotly.min.js"
    return _script(path.read_bytes().decode("utf-8"))


def _file(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _script(text: str) -> Markup:
    """Our own or plotly's script or style, marked safe; none may end its own element."""
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    # Not text.lower(): plotly.js has five million letters.
    ends = (part[:6].lower() for part in text.split("</")[1:])
    if "<!--" in text or any(end.startswith(("script", "style")) for end in ends):
        msg = "a script of the report: must not hold the end of its element"
        raise InputError(msg)
    return _markup(text)


def _json(values: dict[str, Any]) -> Markup:
    """JSON that no text in it can end: `<`, `>` and `&` are written as escapes."""
    text = json.dumps(values, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return _markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _markup(text: str) -> Markup:
    """Text that is not escaped: our own, or what was escaped before."""
    from markupsafe import Markup  # noqa: PLC0415 - as above

    return Markup(text)


def _hash(text: str) -> str:
    return b64encode(sha256(str(text).encode("utf-8")).digest()).decode("ascii")
