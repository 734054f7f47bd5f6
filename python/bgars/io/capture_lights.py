"""Which lights a capture folder describes, which images it names, and how the two pair up."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe
from bgars.light_files import read_filenames, read_intensities, read_numbers
from bgars.light_names import light_name
from bgars.rig import LightRig

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Lights", "default_recipe", "image_names", "match", "read_lights"]

IMAGE_SUFFIXES = {".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".pnm"}
NOT_A_LIGHT = re.compile(r"(mask|dark)", re.IGNORECASE)


@dataclass(frozen=True)
class Lights:
    """Lights as the files give them: intensities may have three columns still."""

    rig: LightRig
    intensities: NDArray[np.float64]
    source: str

    def take(self, indices: Sequence[int]) -> Lights:
        """Return the lights at `indices`, in that order."""
        rows = np.array(indices, dtype=np.intp)
        return replace(self, rig=self.rig.take(rows), intensities=self.intensities[rows])


def default_recipe(folder: Path) -> CaptureRecipe:
    """The recipe that a folder without ``capture.toml`` amounts to."""
    lights: dict[str, str] = {}
    lp_files = sorted(folder.glob("*.lp"))
    if (folder / "light_directions.txt").exists():
        lights["directions"] = "light_directions.txt"
    elif len(lp_files) == 1:
        lights["lp"] = lp_files[0].name
    elif lp_files:
        msg = (
            f"{folder}: holds {len(lp_files)} .lp files ({', '.join(p.name for p in lp_files)}); name one in "
            f"{RECIPE_NAME}"
        )
        raise InputError(msg)
    else:
        msg = (
            f"{folder}: no description of the lights: expected {RECIPE_NAME} with [lights], light_directions.txt, "
            "or one .lp file"
        )
        raise InputError(msg)
    if (folder / "light_intensities.txt").exists():
        lights["intensities"] = "light_intensities.txt"
    mask = "mask.png" if (folder / "mask.png").exists() else None
    return CaptureRecipe.model_validate({"lights": lights, "mask": mask})


def read_lights(folder: Path, recipe: CaptureRecipe) -> Lights:
    """Return the lights that a recipe describes, from whichever source it names."""
    lights = recipe.lights
    if lights is None:
        msg = (
            f"{folder / RECIPE_NAME}: lights: missing; add a [lights] table with directions, angles_deg, "
            f"positions_mm, lp or ring"
        )
        raise InputError(msg)

    def numbers(value: str | Sequence[object], columns: int, meaning: str) -> NDArray[np.float64]:
        if isinstance(value, str):
            return read_numbers(folder / value, (columns,), meaning)
        return np.array(value, dtype=np.float64)

    def where(value: object, key: str) -> str:
        return str(folder / value) if isinstance(value, str) else f"{folder / RECIPE_NAME} (lights.{key})"

    try:
        if lights.directions is not None:
            source = where(lights.directions, "directions")
            rig = LightRig.from_directions(numbers(lights.directions, 3, "x y z of a light"))
        elif lights.angles_deg is not None:
            source = where(lights.angles_deg, "angles_deg")
            rig = LightRig.from_angles(numbers(lights.angles_deg, 2, "azimuth and elevation in degrees"))
        elif lights.positions_mm is not None:
            source = where(lights.positions_mm, "positions_mm")
            distance_mm = lights.intensity_distance_mm
            rig = LightRig.from_positions(
                numbers(lights.positions_mm, 3, "x y z of an LED in mm") * 1000.0,
                intensity_distance_um=None if distance_mm is None else distance_mm * 1000.0,
            )
        elif lights.lp is not None:
            source = str(folder / lights.lp)
            rig = LightRig.from_lp(folder / lights.lp)
        else:
            source = where(None, "ring")
            rig = LightRig.ring(**lights.ring.model_dump()) if lights.ring is not None else LightRig.ring()
    except InputError as error:
        msg = f"{source}: {error}"
        raise InputError(msg) from error
    if isinstance(lights.u_deg, list) and len(lights.u_deg) != len(rig):
        where_u = f"{folder / RECIPE_NAME} (lights.u_deg)"
        msg = f"{where_u}: {len(lights.u_deg)} uncertainties, but {source} gives {len(rig)} lights"
        raise InputError(msg)
    rig = rig.with_u_deg(lights.u_deg)
    intensities = _intensity_rows(folder, lights.intensities, len(rig), source)
    return Lights(rig, intensities, source)


def _intensity_rows(folder: Path, value: str | Sequence[object] | None, count: int, source: str) -> NDArray[np.float64]:
    """Return (L, 1) or (L, 3) intensities, 1 where none are given."""
    if value is None:
        return np.ones((count, 1))
    if isinstance(value, str):
        where = str(folder / value)
        intensities = read_intensities(folder / value)
    else:
        where = f"{folder / RECIPE_NAME} (lights.intensities)"
        intensities = np.array(value, dtype=np.float64).reshape(len(value), -1)
    if len(intensities) != count:
        msg = f"{where}: {len(intensities)} intensities, but {source} gives {count} lights"
        raise InputError(msg)
    wrong = np.argwhere(~(np.isfinite(intensities) & (intensities > 0)))
    if wrong.size:
        light, column = wrong[0]
        msg = (
            f"{where}: intensity of {light_name(light)} must be finite and above 0, got {intensities[light, column]:g}"
        )
        raise InputError(msg)
    return intensities


def image_names(folder: Path, recipe: CaptureRecipe, lights: Lights) -> list[str]:
    """Return the image files, in the order of the recipe, filenames.txt, the .lp file, or their natural order."""
    if recipe.images is not None:
        return recipe.images
    if (folder / "filenames.txt").exists():
        return read_filenames(folder / "filenames.txt")
    if lights.rig.files:
        return list(lights.rig.files)
    special = {recipe.dark, recipe.mask}
    found = [
        path.name
        for path in folder.iterdir()
        if path.suffix.lower() in IMAGE_SUFFIXES and path.name not in special and not NOT_A_LIGHT.match(path.name)
    ]
    return sorted(found, key=_natural_key)


def _natural_key(name: str) -> list[tuple[int, int | str]]:
    """Sort key that puts ``img2`` before ``img10``."""
    return [(0, int(part)) if part.isdigit() else (1, part.lower()) for part in re.split(r"(\d+)", name) if part]


def match(folder: Path, lights: Lights, names: list[str], wanted: Sequence[str] | None) -> tuple[Lights, list[str]]:
    """Pair lights and images: by name where the ``.lp`` file names them all, else by order."""
    if lights.rig.files and names != list(lights.rig.files):
        place = {Path(name).name: index for index, name in enumerate(lights.rig.files)}
        if all(Path(name).name in place for name in names):
            lights = lights.take([place[Path(name).name] for name in names])
    if len(names) != len(lights.rig):
        shown = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")  # noqa: PLR2004 - enough to recognise them
        msg = (
            f"{folder}: {len(names)} images ({shown or 'none found'}), but {lights.source} gives "
            f"{len(lights.rig)} lights"
        )
        raise InputError(msg)
    if wanted is None:
        return lights, names
    unknown = [name for name in wanted if name not in names]
    if unknown:
        msg = f"images: {unknown[0]!r} is not an image of {folder}"
        raise InputError(msg)
    if len(wanted) < 3:  # noqa: PLR2004 - three unknowns a pixel
        msg = f"images: at least 3 images are needed, got {len(wanted)}"
        raise InputError(msg)
    return lights.take([names.index(name) for name in wanted]), list(wanted)
