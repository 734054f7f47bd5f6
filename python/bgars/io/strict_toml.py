"""Recipes in TOML or JSON, checked against a pydantic model: one clear line for the first mistake."""

from __future__ import annotations

import difflib
import json
import re
import sys
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from bgars.errors import FileFormatError, InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from pathlib import Path

    from pydantic_core import ErrorDetails

__all__ = ["Strict", "bounded_text", "checked", "read_values"]

Model = TypeVar("Model", bound=BaseModel)
MAX_BYTES = 64_000_000
MAX_DOTS = 32
LONG_KEY = re.compile(r"(?:[\w\"'-]{1,64}[ \t]{0,8}\.[ \t]{0,8}){33}")
MAX_SHOWN = 200
SCALARS = {"str", "int", "float", "bool"}
SCALAR_WANTED = {"string_type", "float_type", "int_type", "bool_type", "literal_error"}


class Strict(BaseModel):
    """A table whose unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


def read_values(path: Path) -> dict[str, Any]:
    """Read a ``.toml`` file, or a ``.json`` file with one object.

    Raises
    ------
    FileFormatError
        The file is missing or does not parse.
    """
    is_json = path.suffix.lower() == ".json"
    kind = "JSON" if is_json else "TOML"
    try:
        content = bounded_text(path)
        _check_keys(path, content, kind)
        values = json.loads(content) if is_json else tomllib.loads(content)
    except FileFormatError:
        raise
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    except RecursionError:
        msg = f"{path}: is nested too deeply to be {kind} of bgars"
        raise FileFormatError(msg) from None
    except ValueError as error:  # both decoders' errors, and bytes that are no text
        msg = f"{path}: is not valid {kind} ({error})"
        raise FileFormatError(msg) from error
    if not isinstance(values, dict):
        msg = f"{path}: must hold one object, got {type(values).__name__}"
        raise FileFormatError(msg)
    return values


def bounded_text(path: Path) -> str:
    """Return the text of a plain file of bounded size: never of a pipe or a device, which may not end.

    Raises
    ------
    FileFormatError
        It is no plain file, or too long.
    OSError, ValueError
        It cannot be read, or is no UTF-8.
    """
    if path.exists() and not path.is_file():
        msg = f"{path}: cannot be read (is a folder or a device, not a file)"
        raise FileFormatError(msg)
    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        msg = f"{path}: is longer than {MAX_BYTES} bytes: no recipe or result"
        raise FileFormatError(msg)
    return content.decode("utf-8")


def _check_keys(path: Path, content: str, kind: str) -> None:
    """Raise where a key has so many parts that the tables it makes could not be walked any more."""
    for number, line in enumerate(content.splitlines(), start=1):
        if kind == "TOML" and line.count(".") > MAX_DOTS and LONG_KEY.search(line):
            msg = f"{path}: line {number}: a key must have at most {MAX_DOTS} dots"
            raise FileFormatError(msg)


def checked(model: type[Model], values: dict[str, Any], path: Path) -> Model:
    """Return the model of some values.

    Raises
    ------
    InputError
        An unknown key (the nearest known one is named), a wrong type or a value out of range.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise InputError(_explain(model, path, error)) from None


def _explain(model: type[BaseModel], path: Path, error: ValidationError) -> str:
    """One line for the first mistake, unknown keys first: they are usually the cause of the others."""
    first = min(error.errors(include_url=False), key=lambda detail: _rank(model, detail))
    is_unknown = first["type"] == "extra_forbidden"
    keys, known = _walk(model, first["loc"][:-1] if is_unknown else first["loc"])
    if is_unknown:
        name = _short(str(first["loc"][-1]))
        nearest = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
        hint = f"; the nearest known key is '{nearest[0]}'" if nearest else ""
        return f"{path}: unknown key '{'.'.join([*keys, name])}'{hint} (known: {', '.join(known)})"
    reason = first["msg"].removeprefix("Value error, ")
    value = "" if isinstance(first["input"], dict) else f", got {_short(repr(first['input']))}"
    # A rule over several keys names them itself.
    return ": ".join([str(path), *([".".join(keys)] if keys else []), f"{reason}{value}"])


def _short(text: str) -> str:
    """A text that still fits a message, and a comparison."""
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."


def _rank(model: type[BaseModel], detail: ErrorDetails) -> int:
    """How late a mistake is told: pydantic tries every branch of a union, and blames what belongs to another one."""
    if detail["type"] == "extra_forbidden":
        return 4 if detail["loc"][-1] in _walk(model, detail["loc"][:-1])[1] else 0
    if detail["type"] in SCALAR_WANTED and isinstance(detail["input"], dict | list):
        return 3
    return 2 if detail["type"] == "missing" else 1


def _walk(model: type[BaseModel], location: tuple[int | str, ...]) -> tuple[list[str], list[str]]:
    """Keys of the file along a location, and the keys known at its end.

    pydantic puts the branch of a union that it tried into the location: those are no keys of the file.
    """
    models, keys = [model], []
    for part in location:
        fields = [at.model_fields[part].annotation for at in models if part in at.model_fields]
        if fields:
            models = [found for field in fields for found in _models_in(field)] or models
        elif any(_is_tag(at, part) for at in models):
            models = [at for at in models if _is_tag(at, part)]
            continue
        elif part in SCALARS or part in {at.__name__ for at in models} or re.search(r"\[|^constrained-", str(part)):
            continue
        keys.append(str(part))
    known = dict.fromkeys(name for at in models for name in at.model_fields)
    return keys, list(known)


def _is_tag(model: type[BaseModel], part: int | str) -> bool:
    kind = model.model_fields.get("kind")
    return kind is not None and part in get_args(kind.annotation)


def _models_in(annotation: Any) -> list[type[BaseModel]]:  # noqa: ANN401 - whatever an annotation is
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]
