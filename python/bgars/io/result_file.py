"""Read a ``result.json`` again: everything is checked, nothing is guessed."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.files.safe_files import read_bounded
from bgars.io.result_schema import Reading, ResultTable
from bgars.io.strict_toml import checked
from bgars.records.ball_layout import BallLayout
from bgars.records.ball_result import BallResult
from bgars.records.part_check import PartCheck
from bgars.records.part_identity import PartIdentity
from bgars.records.part_material import MaterialParameter, PartMaterial
from bgars.records.part_recipe import Limits, PartRecipe
from bgars.records.part_result import FORMAT, FORMAT_VERSION, PartResult
from bgars.records.seating_result import SeatingResult

if TYPE_CHECKING:
    from os import PathLike

    from bgars.io.result_schema import MaterialTable, RecipeTable, Table

__all__ = ["RESULT_NAME", "parse_result", "read_result"]

RESULT_NAME = "result.json"
OLDEST_VERSION = 2
MAX_BYTES = 64_000_000
READABLE_VERSIONS = range(OLDEST_VERSION, FORMAT_VERSION + 1)


def read_result(path: str | PathLike[str]) -> PartResult:
    """Read the result of an inspection.

    Parameters
    ----------
    path : path
        A ``result.json``, or the folder that ``bgars inspect`` wrote.

    Returns
    -------
    PartResult
        As it was, rounded as the file is; :meth:`bgars.PartResult.to_json` gives the same text again.

    Raises
    ------
    FileFormatError
        No such file, not a result of bgars, another version of the format, or a key that is missing, unknown or of
        the wrong kind; file, key, rule and value are named.
    """
    path = Path(path)
    if path.is_dir():
        path /= RESULT_NAME
        if not path.is_file():
            msg = f"{path.parent}: holds no {RESULT_NAME}: not a folder that bgars inspect wrote"
            raise FileFormatError(msg)
    return parse_result(read_bounded(path, MAX_BYTES, "result"), path)


def parse_result(content: bytes, path: Path) -> PartResult:
    """Return the result that the content of a ``result.json`` describes; messages name `path`.

    Raises
    ------
    FileFormatError
        As :func:`read_result`.
    """
    values = _json(content, path)
    _check_format(path, values)
    try:
        table = checked(ResultTable, values, path)
        _check_lights(path, table)
        return _result(table)
    except FileFormatError:
        raise
    except InputError as error:  # from the check, which names the file, or from a layout, which cannot
        text = str(error)
        msg = text if text.startswith(str(path)) else f"{path}: recipe: {text}"
        raise FileFormatError(msg) from None


def _json(content: bytes, path: Path) -> Any:  # noqa: ANN401 - whatever the file holds
    def refuse(word: str) -> float:
        msg = f"holds {word}, which is no JSON; what was not measured is null"
        raise ValueError(msg)

    try:
        return json.loads(content.decode("utf-8"), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        msg = f"{path}: is not valid JSON: cut off, or not a result ({error})"
        raise FileFormatError(msg) from error


def _check_format(path: Path, values: object) -> None:
    if not isinstance(values, dict) or values.get("format") != FORMAT:
        got = f"format is {values.get('format')!r}" if isinstance(values, dict) else f"it is a {type(values).__name__}"
        msg = f'{path}: is not a result of bgars: it must be an object with "format": "{FORMAT}", but {got}'
        if isinstance(values, dict) and "seating_coplanarity_um" in values:
            msg += " (made before results had a format: inspect the capture again)"
        raise FileFormatError(msg)
    version = values.get("format_version")
    if version not in READABLE_VERSIONS or isinstance(version, bool):
        msg = (
            f"{path}: format_version: this bgars reads {OLDEST_VERSION} to {FORMAT_VERSION}, got {version!r} "
            f"(written by bgars {values.get('version')})"
        )
        raise FileFormatError(msg)


def _check_lights(path: Path, table: ResultTable) -> None:
    if len(table.light_change_deg) != len(table.light_directions):
        msg = (
            f"{path}: light_change_deg: must have one number for each of the {len(table.light_directions)} "
            f"light_directions, got {len(table.light_change_deg)}"
        )
        raise FileFormatError(msg)


def _result(table: ResultTable) -> PartResult:
    values = _fields(table, "format", "format_version")
    values |= {
        "balls": tuple(BallResult(**_fields(ball)) for ball in table.balls),
        "seatings": tuple(SeatingResult(**_fields(seating)) for seating in table.seatings),
        "checks": tuple(
            PartCheck(**(_fields(check) | {"lowest_um": check.lowest_um, "highest_um": check.highest_um}))
            for check in table.checks
        ),
        "bridges": tuple((one, two) for one, two in table.bridges),
        "light_directions": np.array(table.light_directions, dtype=np.float64).reshape(-1, 3),
        "light_change_deg": np.array(table.light_change_deg, dtype=np.float64),
        "board_coefficients_um": np.array(table.board_coefficients_um, dtype=np.float64),
        "recipe": None if table.recipe is None else _recipe(table.recipe),
        "material": None if table.material is None else _material(table.material),
        "identity": PartIdentity(**_fields(table.identity)),
        "files": tuple((file.name, file.sha256) for file in table.files),
    }
    return PartResult(**values)


def _material(table: MaterialTable) -> PartMaterial:
    rows = tuple(MaterialParameter(**_fields(row)) for row in table.parameters)
    return PartMaterial(**(_fields(table) | {"parameters": rows}))


def _recipe(table: RecipeTable) -> PartRecipe:
    limits: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in table.limits}
    return PartRecipe(
        name=table.name,
        layout=BallLayout(
            table.layout.rows,
            table.layout.cols,
            table.layout.pitch_um,
            tuple(table.layout.depopulated),
            tuple((name, x_um, y_um) for name, x_um, y_um in table.layout.positions),
        ),
        view=table.view,
        limits=Limits(**limits),
        diameter_um=table.diameter_um,
        height_um=table.height_um,
        gravity_um=None if table.gravity_um is None else (table.gravity_um[0], table.gravity_um[1]),
        material_file=None if table.material_file is None else Path(table.material_file),
        file=None if table.file is None else Path(table.file),
        q=table.q,
        u_q=table.u_q,
        pitch_u_um=table.pitch_u_um,
    )


def _fields(table: Table, *left_out: str) -> dict[str, Any]:
    """The values of a table as a record takes them: NaN for a number that is null, tuples for lists."""
    values: dict[str, Any] = {}
    for name, value in table:
        if name in left_out:
            continue
        if value is None and _is_number(table, name):
            values[name] = math.nan
        else:
            values[name] = tuple(value) if isinstance(value, list) else value
    return values


def _is_number(table: Table, name: str) -> bool:
    """Whether null stands for a number that is not known, and not for a place, a verdict or a recipe."""
    return type(table).model_fields[name].annotation == Reading
