"""Recipes in TOML or JSON, checked against a pydantic model: one clear line for the first mistake."""

from __future__ import annotations

import difflib
import re
import warnings
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from bgars.errors import InputError
from bgars.io.toml_text import read_values

if TYPE_CHECKING:
    from pathlib import Path

    from pydantic import ValidationInfo
    from pydantic_core import ErrorDetails

__all__ = ["Strict", "checked", "read_values"]

Model = TypeVar("Model", bound=BaseModel)
PLAIN = {
    r"Input should be a valid dictionary( or instance of \w+)?": "must be a table, { key = value, ... }",
    r"Tuple should have at \w+ (\d+) items? after validation, not \d+": r"must hold \1 numbers",
}
SCALARS = {"str", "int", "float", "bool"}
SCALAR_WANTED = {"string_type", "float_type", "int_type", "bool_type", "literal_error"}


class Strict(BaseModel):
    """A table whose unknown keys are errors; `old_names` of keys are taken for one release, with a warning."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False, defer_build=True)
    old_names: ClassVar[dict[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _take_old_names(cls, values: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - whatever the file holds
        for old, new in cls.old_names.items() if isinstance(values, dict) else ():
            if old in values and new not in values:
                place = f"{info.context}: " if info.context else ""
                text = f"{place}{old} is called {new} now; the next release removes the old name"
                warnings.warn(text, FutureWarning, stacklevel=2)
                values = {new if key == old else key: value for key, value in values.items()}
        return values


def checked(model: type[Model], values: dict[str, Any], path: Path) -> Model:
    """Return the model of some values.

    Raises
    ------
    InputError
        An unknown key (the nearest known one is named), a wrong type or a value out of range.
    """
    try:
        return model.model_validate(values, context=path)
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
        return f"{path}: unknown key '{_short('.'.join([*keys, name]))}'{hint} (known: {', '.join(known)})"
    reason = _plain(first["msg"].removeprefix("Value error, "))
    value = "" if isinstance(first["input"], dict) else f", got {_shown(first['input'])}"
    # A rule over several keys names them itself.
    return ": ".join([str(path), *([".".join(keys)] if keys else []), f"{reason}{value}"])


def _plain(reason: str) -> str:
    """The words of pydantic without those of Python."""
    for words, plain in PLAIN.items():
        reason = re.sub(words, plain, reason)
    return reason


def _short(name: str) -> str:
    """A key as it can be printed on one line."""
    longest = 100
    text = name if name.isprintable() else repr(name)[1:-1]
    return text if len(text) <= longest else f"{text[:longest]}..."


def _shown(value: object) -> str:
    """A value on one short line."""
    longest = 200
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        text = "a very large number"
    return text if len(text) <= longest else f"{text[:longest]}..."


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
