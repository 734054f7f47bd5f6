"""Results that are put together must come from the same measurement: recipe, pixel pitch, estimator."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.records.part_result import PartResult

__all__ = ["check_alike"]

OWN_FILES = {"file", "material_file"}


def check_alike(results: Sequence[tuple[str, PartResult]]) -> tuple[str, ...]:
    """Refuse results that do not belong together; return what to warn of.

    Parameters
    ----------
    results : sequence of (str, PartResult)
        Each with the name of its file or folder.

    Raises
    ------
    InputError
        Another recipe, pixel pitch, number of lights or estimator than that of the first, or the same input files as
        another; both are named.
    """
    first_name, first = results[0]
    for name, result in results[1:]:
        for what, one, other in (
            ("recipe", _recipe_name(first), _recipe_name(result)),
            ("recipe (another layout or other limits)", _recipe(first), _recipe(result)),
            ("pixel_pitch_um", first.pixel_pitch_um, result.pixel_pitch_um),
            ("number of lights", len(first.light_directions), len(result.light_directions)),
            ("method", first.method, result.method),
        ):
            if one != other:
                is_shown = not isinstance(one, dict) and not isinstance(other, dict)
                told = f": {other or 'none'}, not {one or 'none'}" if is_shown else ""
                msg = f"{name}: must have the same {what} as {first_name}{told}"
                raise InputError(msg)
    _check_copies(results)
    warnings = []
    counts = Counter(result.verdict for _, result in results)
    if counts["fail"] or (counts["undecided"] and counts["pass"]):
        told = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ("pass", "fail", "undecided") if counts[verdict])
        warnings.append(f"verdicts of the single inspections: {told}")
    versions = sorted({result.version for _, result in results})
    if len(versions) > 1:
        warnings.append(f"results of different versions of bgars are combined: {', '.join(versions)}")
    return tuple(warnings)


def _check_copies(results: Sequence[tuple[str, PartResult]]) -> None:
    """Refuse the same images twice: they would repeat without any spread."""
    seen: dict[frozenset[str], str] = {}
    for name, result in results:
        digests = frozenset(digest for _, digest in result.files)
        if digests and digests in seen:
            msg = f"{name}: comes from the same files as {seen[digests]}; every run must have images of its own"
            raise InputError(msg)
        seen[digests] = name


def _recipe_name(result: PartResult) -> str | None:
    return None if result.recipe is None else result.recipe.name


def _recipe(result: PartResult) -> dict[str, Any] | None:
    if result.recipe is None:
        return None
    return {key: value for key, value in result.recipe.to_dict().items() if key not in OWN_FILES}
