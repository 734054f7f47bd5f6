"""Write tests/unit/public_api.txt: public names, signatures, members. ``make api``."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import bgars

FILE = Path(__file__).with_name("public_api.txt")


def public_api() -> str:
    """One line for each public name, indented lines for what a class has of its own and inherits within bgars."""
    lines: list[str] = []
    for name in sorted(set(bgars.__all__) - {"__version__"}):
        thing = getattr(bgars, name)
        if inspect.isclass(thing):
            bases = ", ".join(base.__name__ for base in thing.__bases__ if base is not object)
            lines += [f"class {name}({bases})", *(f"    {member}" for member in _members(thing))]
        else:
            lines.append(f"{name}{_signature(thing)}")
    return "\n".join(lines) + "\n"


def _members(cls: type) -> list[str]:
    """Constructor, fields, properties and methods, sorted."""
    found: dict[str, str] = {}
    for owner in reversed(cls.__mro__):
        if not owner.__module__.startswith("bgars"):
            continue
        for name, value in vars(owner).items():
            if name == "__init__" or not name.startswith("_"):
                found[name] = _member(name, value)
        for name, kind in vars(owner).get("__annotations__", {}).items():
            if not name.startswith("_"):
                found[name] = f"{name}: {_plain(kind)}"
    return [found[name] for name in sorted(found)]


def _member(name: str, value: object) -> str:
    if isinstance(value, property):
        return f"{name}: property -> {_plain(inspect.signature(value.fget).return_annotation)}" if value.fget else name
    if isinstance(value, (classmethod, staticmethod)):
        return f"{type(value).__name__} {name}{_signature(value.__func__)}"
    return f"{name}{_signature(value)}" if inspect.isfunction(value) else name


def _signature(function: object) -> str:
    """Parameters with their types and defaults; of a record's constructor the fields say the types."""
    if not callable(function):
        return ""
    signature = inspect.signature(function)
    is_init = getattr(function, "__name__", "") == "__init__"
    parameters = [
        parameter.replace(annotation=parameter.empty if is_init else _Text(_plain(parameter.annotation)))
        for parameter in signature.parameters.values()
        if parameter.name not in ("self", "cls")
    ]
    returned = signature.empty if is_init else _Text(_plain(signature.return_annotation))
    return str(signature.replace(parameters=parameters, return_annotation=returned))


class _Text(str):
    """An annotation that shows without quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def _plain(annotation: object) -> str:
    """An annotation as it is written, without what ``Annotated`` says beside the type."""
    tree = ast.parse(str(annotation), mode="eval").body
    if isinstance(tree, ast.Subscript) and ast.unparse(tree.value) == "Annotated" and isinstance(tree.slice, ast.Tuple):
        tree = tree.slice.elts[0]
    return ast.unparse(tree)


if __name__ == "__main__":
    FILE.write_text(public_api(), encoding="utf-8")
