"""What ``bgars evaluate`` and its neighbours say of a method's result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from bgars.pipelines.evaluate import Evaluation

__all__ = ["choice_in_words", "evaluation_table"]

ALL_MEASURED, HALF = 0.9995, 0.5


def choice_in_words(normals: dict[str, Any]) -> str:
    """Whether a field's normals can be trusted and why, then what was used."""
    share, on_balls = normals["measured_share"], normals["measured_share_on_balls"]
    if share >= HALF and on_balls is not None and on_balls < HALF:
        trust = (
            f"Trust the surface beside the balls: the images determine {100 * share:.1f} % of the normals, but only "
            f"{100 * on_balls:.1f} % of those on balls; the others are filled in, and marked."
        )
    elif share >= ALL_MEASURED:
        trust = "Trust: the images determine every normal."
    elif share >= HALF:
        trust = f"Trust: the images determine {100 * share:.1f} % of the normals; the others are filled in, and marked."
    else:
        trust = f"Do not trust the surface as a whole: the images determine only {100 * share:.1f} % of its normals."
    return f"{trust}\nMethod: {normals['method_reason']}."


def evaluation_table(results: Sequence[Evaluation], lights: int) -> Iterator[str]:
    """The errors of some methods on one capture, a line each, then what each method chose to do."""
    first = results[0]
    yield f"{first.name}, {lights} lights, {first.region}: {first.normals.pixels} pixels; errors in deg"
    rows = [[text for text, _ in COLUMNS]]
    rows += [[_cell(of, result) for _, of in COLUMNS] for result in results]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for name, *values in rows:
        cells = [f"{value:>{width}}" for value, width in zip(values, widths[1:], strict=True)]
        yield "  ".join([f"{name:<{widths[0]}}", *cells])
    for result in results:
        if result.method_reason != f"{result.method}, as asked":
            yield f"{result.method} used: {result.method_reason}"


def _cell(of: Callable[[Evaluation], str | None], result: Evaluation) -> str:
    return of(result) or "-"


def _measured_share(result: Evaluation) -> str | None:
    return None if result.measured is None else f"{100.0 * result.measured.pixels / result.normals.pixels:.1f}"


COLUMNS: tuple[tuple[str, Callable[[Evaluation], str | None]], ...] = (
    ("method", lambda result: result.method),
    ("mean", lambda result: f"{result.normals.mean_deg:.3f}"),
    ("median", lambda result: f"{result.normals.median_deg:.3f}"),
    ("95th pct", lambda result: f"{result.normals.p95_deg:.3f}"),
    ("no solution", lambda result: str(result.normals.invalid)),
    ("measured (%)", _measured_share),
    ("their mean", lambda result: None if result.measured is None else f"{result.measured.mean_deg:.3f}"),
    ("within 1 s.e. (%)", lambda result: None if result.coverage is None else f"{100.0 * result.coverage:.1f}"),
    ("board mean", lambda result: None if result.board is None else f"{result.board.mean_deg:.3f}"),
    (
        "ball height RMSE (um)",
        lambda result: None if result.ball_height_rmse_um is None else f"{result.ball_height_rmse_um:.2f}",
    ),
)
"""Heading and cell of each column; a cell without a value is a dash."""
