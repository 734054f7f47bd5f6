"""The published JSON Schema of ``result.json``, and the model that reads it; both made from the records."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, Strict, create_model, model_validator

from bgars.records.keys import default_of, keys_of, old_names, types_of
from bgars.records.part_result import FORMAT, FORMAT_VERSION, OLDEST_VERSION, PartResult

__all__ = ["result_model", "result_schema", "table_of"]

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"
ABOUT = "The result of one inspection; lengths in um, angles in degrees, null = not measured."
Number = Annotated[float, Field(allow_inf_nan=False)]
Reading = Number | None
"""null = not measured, or not known."""


class Table(BaseModel):
    """An object whose keys are all known and all there."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def result_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``result.json``; ``docs/result.schema.json`` holds it.

    Examples
    --------
    >>> schema = result_schema()
    >>> schema["properties"]["pixel_pitch_um"]["description"]
    'size of a pixel on the board, in um'
    """
    schema = result_model().model_json_schema(mode="validation")
    heading = {"$schema": SCHEMA_DIALECT, "title": f"{FORMAT} {FORMAT_VERSION}", "description": ABOUT}
    return heading | {key: value for key, value in schema.items() if key not in heading}


@cache
def result_model() -> type[Table]:
    """The whole of ``result.json``."""
    versions = Literal[tuple(range(OLDEST_VERSION, FORMAT_VERSION + 1))]  # type: ignore[valid-type]
    heading = {
        "format": (Literal["bgars-result"], Field(description="says that this file is a result of bgars")),
        "format_version": (versions, Field(description="rises with every change of the keys or their meaning")),
    }
    return _model(PartResult, heading)


@cache
def table_of(record: type) -> type[Table]:
    """The model of a record in a file: all its keys, in their order."""
    return _model(record, {})


def _model(record: type, heading: dict[str, Any]) -> type[Table]:
    types = types_of(record)
    entries = dict(heading)
    for name, key in keys_of(record).items():
        about: dict[str, Any] = {"description": key.meaning}
        rules = {rule: value for rule in ("ge", "gt", "pattern") if (value := getattr(key, rule)) is not None}
        if len(key.shape) == 1 and key.shape[0] is not None:
            about |= {"min_length": key.shape[0], "max_length": key.shape[0]}
        entries[name] = (_form(types[name], key.shape, key.names, is_known=bool(rules)), Field(**about, **rules))
    late = {name: default_of(record, name) for name, key in keys_of(record).items() if key.is_late}
    old = old_names(record)

    def earlier(values: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        if not isinstance(values, dict):
            return values
        return late | {key if old.get(key, key) in values else old[key]: value for key, value in values.items()}

    checks: dict[str, Any] = {"earlier": model_validator(mode="before")(earlier)} if late or old else {}
    about_record = (record.__doc__ or "").partition("\n\n")[0].strip()
    return create_model(record.__name__, __base__=Table, __doc__=about_record, __validators__=checks, **entries)


def _form(  # noqa: PLR0911 - a line a kind
    hint: Any,  # noqa: ANN401 - a type
    shape: tuple[int | None, ...] = (),
    names: tuple[str, ...] = (),
    *,
    is_known: bool = False,
) -> Any:  # noqa: ANN401 - a type
    """The type of a field's value in JSON."""
    kind, parts = get_origin(hint), get_args(hint)
    if hint is float:
        return Number if is_known else Reading
    if hint is Path:
        return str
    if kind is np.ndarray:
        return _array_form(shape)
    if kind in {Union, UnionType}:
        (inner,) = (part for part in parts if part is not type(None))
        return _form(inner, is_known=True) | None
    if kind is dict:
        values = Annotated[Number, Field(ge=0)] if parts[1] is float else _form(parts[1])
        names_form = Literal[names] if names else str
        return dict[names_form, values]  # type: ignore[valid-type]
    if kind is tuple:
        return _tuple_form(parts)
    return table_of(hint) if isinstance(hint, type) and hasattr(hint, "__annotations__") else hint


def _array_form(shape: tuple[int | None, ...]) -> Any:  # noqa: ANN401 - a type
    """Lists of numbers; where the length is stated, they may be unknown."""
    first, *rest = shape
    if rest:
        return list[Annotated[list[Number], Field(min_length=rest[0], max_length=rest[0])]]
    return list[Number] if first is None else list[Reading]


def _tuple_form(parts: tuple[Any, ...]) -> Any:  # noqa: ANN401 - a type
    """A list; of mixed kinds, a list of that many."""
    if parts[-1] is Ellipsis:
        return list[_form(parts[0])]  # type: ignore[misc]
    forms = tuple(_form(part, is_known=True) for part in parts)
    if len(set(parts)) > 1:
        return Annotated[tuple[forms], Strict(strict=False)]  # type: ignore[valid-type]
    return Annotated[list[forms[0]], Field(min_length=len(parts), max_length=len(parts))]  # type: ignore[valid-type]
