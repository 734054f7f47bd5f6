"""Material files: what was learnt of a surface on one capture, to be used on the next."""

from __future__ import annotations

import json
import re
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.io.strict_toml import Strict, checked, read_values
from bgars.records.surface_material import SurfaceLobe, SurfaceMaterial

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["material_path", "read_material", "write_material"]

MATERIAL_SUFFIX = ".toml"

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]

LEVELS = re.compile(r"diffuse|ambient|strength_\d+")
"""Parameters whose unit is a grey level of 255."""
LEVEL_SUFFIX = "_level"


class LobeTable(Strict):
    """A ``[[lobes]]`` table: :class:`bgars.SurfaceLobe`."""

    strength_level: NotNegative
    roughness: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]
    tail: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class FitTable(Strict):
    """Where a material comes from; nothing is computed from it."""

    capture: str = ""
    balls: Annotated[int, Field(ge=0)] | None = None
    loss: NotNegative | None = None
    bgars: str = ""


class MaterialFile(Strict):
    """The whole file."""

    diffuse_level: NotNegative
    grazing: Finite
    ambient_level: Finite
    masking: Literal["smith", "cook-torrance"]
    gains: Annotated[list[Positive], Field(min_length=1)]
    lobes: Annotated[list[LobeTable], Field(min_length=1, max_length=2)]
    standard_errors: dict[str, NotNegative] = Field(default_factory=dict)
    fit: FitTable = FitTable()

    @model_validator(mode="after")
    def _errors_of_parameters(self) -> MaterialFile:
        known = {"diffuse_level", "grazing", "ambient_level"}
        for lobe in range(1, len(self.lobes) + 1):
            known |= {f"strength_{lobe}_level", f"roughness_{lobe}", f"tail_{lobe}"}
        known |= {f"gain_{light}" for light in range(len(self.gains))}
        for name in self.standard_errors:
            if name not in known:
                has = f"gains: one per light, got {len(self.gains)}; known: {', '.join(sorted(known))}"
                msg = f"standard_errors: '{name}' is no parameter of this material ({has})"
                raise ValueError(msg)
        return self


def read_material(path: str | PathLike[str], *, lights: int | None = None) -> SurfaceMaterial:
    """Read a material file.

    Parameters
    ----------
    path : path
        Written by :func:`write_material` or ``bgars calibrate material``.
    lights : int, optional
        Lights of the capture that it is meant for: it must have as many gains.

    Returns
    -------
    SurfaceMaterial
        For ``estimate_normals(material=...)`` on captures with the same lights and exposure.

    Raises
    ------
    FileFormatError
        The file is missing or not TOML.
    InputError
        An unknown key (the nearest known one is named), a missing one, a value out of range, another number of gains
        than `lights`.
    """
    path = Path(path)
    file = checked(MaterialFile, read_values(path), path)
    if lights is not None and len(file.gains) != lights:
        msg = f"{path}: gains: must have one number for each of the capture's {lights} lights, got {len(file.gains)}"
        raise InputError(msg)
    return SurfaceMaterial(
        diffuse_level=file.diffuse_level,
        grazing=file.grazing,
        ambient_level=file.ambient_level,
        lobes=tuple(SurfaceLobe(lobe.strength_level, lobe.roughness, lobe.tail) for lobe in file.lobes),
        masking=file.masking,
        gains=tuple(file.gains),
        standard_errors={name.removesuffix(LEVEL_SUFFIX): value for name, value in file.standard_errors.items()},
    )


def write_material(
    material: SurfaceMaterial,
    path: str | PathLike[str],
    *,
    capture: str = "",
    balls: int | None = None,
    loss: float | None = None,
) -> None:
    """Write a material file, whole or not at all.

    Parameters
    ----------
    material : SurfaceMaterial
        What is written; every number is read back with the same bits.
    path : path
        Ends in ``.toml``.
    capture, balls, loss : optional
        Name of the capture it was fitted on, the number of balls there, and the loss of the fit: for the reader.

    Raises
    ------
    FileFormatError
        The file cannot be written.
    InputError
        Another suffix.

    Examples
    --------
    >>> import bgars, tempfile, pathlib
    >>> lobe = bgars.SurfaceLobe(strength_level=255.0, roughness=0.2, tail=0.0)
    >>> solder = bgars.SurfaceMaterial(30.0, 0.0, 0.0, (lobe,), "smith", gains=(1.0,) * 8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "solder.toml"
    ...     bgars.write_material(solder, path)
    ...     bgars.read_material(path) == solder
    True
    """
    with atomic_file(material_path(path)) as temporary:
        temporary.write_text(_toml(material, capture, balls, loss), encoding="utf-8")


def material_path(path: str | PathLike[str]) -> Path:
    """The path of a material file.

    Raises
    ------
    InputError
        It does not end in ``.toml``.
    """
    path = Path(path)
    if path.suffix.lower() != MATERIAL_SUFFIX:
        msg = f"{path}: a material file must end in {MATERIAL_SUFFIX}, got {path.suffix or 'no suffix'}"
        raise InputError(msg)
    return path


def _toml(material: SurfaceMaterial, capture: str, balls: int | None, loss: float | None) -> str:
    lines = [
        "# A surface under the lights of one rig, at one exposure. Levels are grey levels of 255 at light intensity 1:",
        "# level = gain (diffuse n.l [1 + grazing (A - 1)] + sum strength D G / n_z) + ambient",
        f"diffuse_level = {_number(material.diffuse_level)}",
        f"grazing = {_number(material.grazing)}",
        f"ambient_level = {_number(material.ambient_level)}",
        f"masking = {_text(material.masking)}",
        f"gains = [{', '.join(_number(gain) for gain in material.gains)}]",
    ]
    for lobe in material.lobes:
        lines += [
            "",
            "[[lobes]]",
            f"strength_level = {_number(lobe.strength_level)}",
            f"roughness = {_number(lobe.roughness)}",
            f"tail = {_number(lobe.tail)}  # 0 Beckmann, 1 GGX",
        ]
    lines += ["", "[fit]  # where it comes from"]
    lines += [f"capture = {_text(capture)}"] if capture else []
    lines += [] if balls is None else [f"balls = {balls}"]
    lines += [] if loss is None else [f"loss = {_number(loss)}"]
    lines += [f"bgars = {_text(version('bgars'))}"]
    if material.standard_errors:
        lines += ["", "[standard_errors]"]
        lines += [
            f"{name}{LEVEL_SUFFIX if LEVELS.fullmatch(name) else ''} = {_number(value)}"
            for name, value in material.standard_errors.items()
        ]
    return "\n".join(lines) + "\n"


def _text(value: str) -> str:
    """A TOML string: JSON's, but for DEL; file names that are no Unicode lose their odd bytes."""
    readable = value.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(readable, ensure_ascii=False).replace("\x7f", "\\u007f")


def _number(value: float) -> str:
    """A float as TOML reads it back, bit by bit."""
    return repr(float(value))
