"""The methods of ``estimate_normals``: a table of names that loads no estimator, and those that others add."""

from __future__ import annotations

import re
from dataclasses import dataclass
from inspect import signature
from typing import TYPE_CHECKING, Any, TypeAlias

from bgars.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.capture import Capture

__all__ = [
    "ALL_METHODS",
    "DEFAULT_METHOD",
    "ENTRY_POINTS",
    "METHODS",
    "TABLE",
    "Method",
    "NormalsMethod",
    "added_method",
    "method_names",
    "register_method",
]

Method: TypeAlias = str
"""The name of a method: of the table, registered, or of an installed package."""
ENTRY_POINTS = "bgars.methods"
"""Group of entry points by which a package adds methods."""
NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
UNASKED = {"mask", "threads", "progress"}
"""A function need not name these: pixels outside the mask are taken off its result."""
OPTIONS = {"threshold", "anchors", "material", "keep_sets", "out", *UNASKED}


@dataclass(frozen=True)
class NormalsMethod:
    """A method by its name; the function stands in ``RUNNERS`` of ``pipelines/normals.py``.

    Attributes
    ----------
    name : str
    summary : str
        For the help of the command line.
    options : tuple of str
        Which of the options that few methods have it takes.
    is_compared : bool
        False: it is left out where methods are compared.
    """

    name: str
    summary: str
    options: tuple[str, ...] = ()
    is_compared: bool = True


TABLE = {
    method.name: method
    for method in (
        NormalsMethod("lambertian", "least squares over all lights."),
        NormalsMethod("specular-filter", "the published sorted-gap filter.", options=("threshold",)),
        NormalsMethod(
            "robust-filter",
            "least squares over the window of sorted values that fits a matt facet best; leaves out shadows and "
            "highlights.",
        ),
        NormalsMethod(
            "reflectance",
            "uses highlights: on balls, by the material fitted on them; elsewhere robust-filter. Without balls and a "
            "material, with fewer than 4 lights, or if no material fits the balls: blind.",
            options=("anchors", "material"),
        ),
        NormalsMethod(
            "blind",
            "fits one material and all normals together (slow). If it predicts left-out lights worse than least "
            "squares and robust-filter, the better of these is used; with fewer than 5 lights robust-filter.",
            is_compared=False,  # it is what reflectance does without balls
        ),
    )
}
ALL_METHODS: tuple[Method, ...] = tuple(TABLE)
METHODS: tuple[Method, ...] = tuple(method.name for method in TABLE.values() if method.is_compared)
"""The methods that are compared."""
DEFAULT_METHOD: Method = "reflectance"

_registered: dict[str, Callable[..., Any]] = {}


def register_method(name: str, function: Callable[..., Any], *, replace: bool = False) -> None:
    """Add a method to :func:`bgars.estimate_normals`, and so to all that is given a method's name, in this process.

    A package that is to be known to the command line, and to the worker processes of ``bgars batch``, names its
    function as an entry point instead: under ``[project.entry-points."bgars.methods"]`` the line
    ``name = "package.module:function"``.

    Parameters
    ----------
    name : str
        Lower-case letters, digits and hyphens; not a method of bgars.
    function : callable
        Called with the :class:`bgars.Capture`, and with those of `mask` ((H, W) bool or None), `threshold`, `anchors`,
        `material`, `keep_sets`, `out`, `threads` and `progress` that its signature names: what the caller did not give
        has the function's default, else None. Returns a :class:`bgars.NormalField`, or an array (H, W, 3) of normals,
        NaN or zero where there is none.
    replace : bool
        A name that was registered before is given to this function; else only the same function may have it again.

    Raises
    ------
    InputError
        Another name, one that another function has, or something that cannot be called.

    Examples
    --------
    >>> import bgars, numpy as np
    >>> def upward(capture):
    ...     return np.tile(np.float32([0, 0, 1]), (*capture.mask.shape, 1))
    >>> bgars.register_method("upward", upward)
    >>> field = bgars.estimate_normals(bgars.read_capture(bgars.sample_capture()), method="upward")
    >>> field.method, float(field.normals[..., 2].min())
    ('upward', 1.0)
    """
    if not NAME.fullmatch(str(name)):
        msg = f"name: a method's name is made of lower-case letters, digits and hyphens, got {name!r}"
        raise InputError(msg)
    if name in TABLE:
        msg = f"name: {name} is a method of bgars, choose another name"
        raise InputError(msg)
    given: object = function
    if not callable(given):
        msg = f"function: must be callable, got {type(function).__name__}"
        raise InputError(msg)
    if not replace and _registered.get(name, function) is not function:
        msg = f"name: {name} is the name of another function; replace=True replaces it"
        raise InputError(msg)
    _registered[name] = function


def method_names() -> tuple[Method, ...]:
    """Every name that `method` may have: those of the table, then registered ones and those of installed packages."""
    return (*TABLE, *sorted({*_registered, *_entry_points()}))


def added_method(name: object) -> Callable[..., Any]:
    """Return the function of a method that others added, which takes a capture and the given options by name.

    Raises
    ------
    InputError
        An unknown name (the message lists those there are), or a package that cannot be loaded; when called, an option
        that the function does not take.
    """
    function = _registered.get(str(name))
    if function is None:
        entry = _entry_points().get(str(name))
        if entry is None:
            msg = f"method: must be one of {', '.join(method_names())}; got {name!r}"
            raise InputError(msg)
        try:
            function = entry.load()
        except (ImportError, AttributeError) as error:
            msg = f"method: {name} ({entry.value}) cannot be loaded ({error})"
            raise InputError(msg) from error
        if not callable(function):
            msg = f"method: {name} ({entry.value}) must be callable, got {type(function).__name__}"
            raise InputError(msg)
    parameters = signature(function).parameters.values()
    taken = {parameter.name for parameter in parameters}
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        taken |= OPTIONS
    without_default = {p.name for p in parameters if p.default is p.empty and p.name in OPTIONS}

    def run(capture: Capture, **options: Any) -> Any:  # noqa: ANN401 - normals in either form
        for option in options.keys() - taken - UNASKED:
            msg = f"{option}: the method {name} does not take it"
            raise InputError(msg)
        given = {option: value for option, value in options.items() if option in taken}
        return function(capture, **(dict.fromkeys(without_default) | given))

    return run


def _entry_points() -> dict[str, Any]:
    """Entry points by name; a package cannot replace a method of the table."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - 40 ms, for those who look beyond the table

    return {entry.name: entry for entry in entry_points(group=ENTRY_POINTS) if entry.name not in TABLE}
