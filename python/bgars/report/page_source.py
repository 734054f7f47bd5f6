"""What the page is made from: the content of result.json, and what lies beside it."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import FileFormatError
from bgars.part_result import BallResult, PartCheck, PartResult, SeatingResult
from bgars.report.page_photograph import SIDE_FILE, Lamp, Photograph, lamps_of, photograph_of, read_side_files
from bgars.report.page_words import VERDICT_MARKS

if TYPE_CHECKING:
    from bgars.records import Capture

__all__ = ["RESULT_FILE", "PageSource", "read_page_source", "source_of"]

RESULT_FILE = "result.json"
LARGEST = 1e12
"""No length in um, no angle and no count is larger; beyond, a file is damaged."""
NULLABLE_NUMBERS = ("float", "float | None")
TEXTS = ("str", "BallKind", "Verdict")
ROWS = {"balls": BallResult, "checks": PartCheck, "seatings": SeatingResult}


@dataclass(frozen=True, eq=False)
class PageSource:
    """Everything on the page.

    Attributes
    ----------
    result : dict
        As :meth:`bgars.PartResult.to_dict` returns it; None = not measured.
    photograph : Photograph or None
        The part as the camera saw it.
    method : str or None
        Estimator of the normals.
    lamps : tuple of Lamp
        The lights as the rig gives them; empty when unknown.
    """

    result: dict[str, Any]
    photograph: Photograph | None = None
    method: str | None = None
    lamps: tuple[Lamp, ...] = ()


def source_of(result: PartResult, capture: Capture | None, method: str | None) -> PageSource:
    """Gather the page of an inspection that was just made."""
    if capture is None:
        return PageSource(result.to_dict(), method=method)
    return PageSource(result.to_dict(), photograph_of(capture), method, lamps_of(capture))


def read_page_source(path: Path) -> PageSource:
    """Read result.json (or the folder that holds it), and the photograph that lies beside it.

    Raises
    ------
    FileFormatError
        There is no result, or it is not one.
    """
    file = path / RESULT_FILE if path.is_dir() else path
    try:
        result = json.loads(file.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except OSError as error:
        hint = f"; `bgars inspect` writes {RESULT_FILE} into its output folder" if not file.exists() else ""
        msg = f"{file}: cannot be read ({error.strerror}){hint}"
        raise FileFormatError(msg) from error
    except (ValueError, RecursionError) as error:
        msg = f"{file}: is not the JSON that `bgars inspect` writes ({error})"
        raise FileFormatError(msg) from error
    _check(result, PartResult, str(file))
    for name, kind in ROWS.items():
        for index, row in enumerate(result[name]):
            _check(row, kind, f"{file}: {name}[{index}]")
    _check_rest(result, file)
    photograph, method, lamps = read_side_files(file.with_name(SIDE_FILE))
    return PageSource(result, photograph, method, lamps)


def _no_constant(word: str) -> None:
    msg = f"{word} is no number; None is written as null"
    raise ValueError(msg)


def _check(values: Any, kind: type, where: str) -> None:  # noqa: ANN401 - whatever a file holds
    """Refuse what has not the fields of a record, naming the first that is wrong."""
    if not isinstance(values, dict):
        msg = f"{where}: must be an object with the fields of {kind.__name__}, got {_shown(values)}"
        raise FileFormatError(msg)
    for entry in fields(kind):
        if entry.name not in values:
            msg = f"{where}: {entry.name} is missing; is this a result of `bgars inspect`?"
            raise FileFormatError(msg)
        rule = _broken_rule(values[entry.name], str(entry.type))
        if rule:
            msg = f"{where}: {entry.name}: must be {rule}, got {_shown(values[entry.name])}"
            raise FileFormatError(msg)


def _broken_rule(value: Any, kind: str) -> str:  # noqa: ANN401, PLR0911 - one return a kind
    """What a value of a field must be, where it is not."""
    if kind in NULLABLE_NUMBERS:
        return "" if _is_number_or_none(value) else "a number"
    if kind == "Verdict | None":
        return "" if value is None or isinstance(value, str) else "a text"
    if kind in TEXTS:
        return "" if isinstance(value, str) else "a text"
    if kind == "bool":
        return "" if isinstance(value, bool) else "true or false"
    if kind in {"int", "int | None"}:
        return "" if _is_number_or_none(value) and not isinstance(value, float) else "a whole number"
    if kind == "tuple[str, ...]":
        return "" if _is_list_of(value, str) else "a list of texts"
    if kind.startswith(("tuple", "NDArray")):
        return "" if isinstance(value, list) else "a list"
    return ""


def _check_rest(result: dict[str, Any], file: Path) -> None:
    """Lists whose entries are no records."""
    rules = {
        "bridges": all(_is_list_of(pair, str) and len(pair) == len(("one", "other")) for pair in result["bridges"]),
        "files": all(
            isinstance(entry, dict) and all(isinstance(entry.get(key), str) for key in ("name", "sha256"))
            for entry in result["files"]
        ),
        "light_directions": all(_are_numbers(row, len("xyz")) for row in result["light_directions"]),
        "light_change_deg": _are_numbers(result["light_change_deg"]),
        "board_coefficients_um": _are_numbers(result["board_coefficients_um"], len(("1", "x", "y", "xx", "xy", "yy"))),
        "recipe": _is_recipe(result["recipe"]),
        "verdict": all(row["verdict"] in VERDICT_MARKS for row in (result, *result["balls"]))
        and all(check["verdict"] in {None, *VERDICT_MARKS} for check in result["checks"]),
    }
    for name, holds in rules.items():
        if not holds:
            msg = f"{file}: {name}: is not what `bgars inspect` writes there"
            raise FileFormatError(msg)


def _is_list_of(value: Any, *kinds: type) -> bool:  # noqa: ANN401 - whatever a file holds
    return isinstance(value, list) and all(isinstance(entry, kinds) for entry in value)


def _is_number_or_none(value: Any) -> bool:  # noqa: ANN401 - whatever a file holds
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST)


def _are_numbers(value: Any, count: int | None = None) -> bool:  # noqa: ANN401 - whatever a file holds
    """A list of numbers or None, of a length if one is given."""
    return isinstance(value, list) and all(map(_is_number_or_none, value)) and count in {None, len(value)}


def _is_recipe(value: Any) -> bool:  # noqa: ANN401 - whatever a file holds
    """None, or what is read of a recipe is as it is written."""
    if value is None:
        return True
    limits = value.get("limits") if isinstance(value, dict) else 0
    if not isinstance(limits, dict | None) or not _is_number_or_none(value.get("diameter_um")):
        return False
    pairs = (isinstance(limit, list) and _are_numbers(limit, 2) for limit in (limits or {}).values())
    return all(map(any, zip(pairs, map(_is_number_or_none, (limits or {}).values()), strict=True)))


def _shown(value: Any) -> str:  # noqa: ANN401 - whatever a file holds
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= len("x" * 60) else text[:57] + "..."
