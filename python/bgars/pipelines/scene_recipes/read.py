"""Recipes to the records that the simulator takes: named ones that ship with bgars, and files."""

from __future__ import annotations

import difflib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.io.strict_toml import checked, read_values
from bgars.pipelines.scene_recipes.schema import (
    BallArrayRecipe,
    BallRecipe,
    BoardRecipe,
    DefectRecipe,
    HemisphereRecipe,
    MaterialRecipe,
    PlaneRecipe,
    RigRecipe,
    SceneRecipe,
    SimulationRecipe,
)
from bgars.records.rig import LightRig
from bgars.simulate import (
    Ball,
    Board,
    Bridge,
    Camera,
    Defect,
    Jitter,
    Lobe,
    Material,
    Scene,
    SimulationSetup,
    Texture,
    Variation,
    roughness_from_hardness,
)

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["named_recipes", "read_scene"]

FOLDER = Path(__file__).parent / "named"
EXACT_UNIT = 1e-12


def named_recipes() -> dict[str, str]:
    """Names and descriptions of the recipes that ship with bgars.

    Examples
    --------
    >>> "one-ball" in named_recipes()
    True
    """
    return {path.stem: str(read_values(path).get("description", "")) for path in sorted(FOLDER.glob("*.toml"))}


def read_scene(recipe: str | PathLike[str]) -> SimulationSetup:
    """Read a simulation recipe: a name that ships with bgars, a ``.toml`` file, or a ``scene.json``.

    Parameters
    ----------
    recipe : str or path
        A name of :func:`named_recipes`, or a file.

    Returns
    -------
    SimulationSetup
        The arguments of :func:`bgars.simulate`.

    Raises
    ------
    FileFormatError
        No such recipe or file, or it does not parse.
    InputError
        An unknown key, a wrong type, an impossible scene; field and rule are named.

    Examples
    --------
    >>> import bgars
    >>> setup = bgars.read_scene("one-ball")
    >>> len(setup.scene.balls), len(setup.rig)
    (1, 8)
    """
    path = _find(recipe)
    values = checked(SimulationRecipe, read_values(path), path)
    try:
        return SimulationSetup(
            scene=_scene(values.scene, path.parent),
            rig=_rig(values.rig).with_u_deg(values.rig.u_deg),
            material=_material(values.material),
            camera=_camera(values),
            seed=values.seed,
        )
    except InputError as error:
        msg = f"{path}: {error}"
        raise InputError(msg) from error


def _find(recipe: str | PathLike[str]) -> Path:
    path = Path(recipe)
    if path.suffix.lower() in {".toml", ".json"}:
        return path
    named = FOLDER / f"{path.name}.toml"
    if len(path.parts) == 1 and named.is_file():
        return named
    msg = f"{recipe}: is neither a recipe file (.toml, .json) nor one of {', '.join(named_recipes())}"
    nearest = difflib.get_close_matches(path.name, named_recipes(), n=1)
    if nearest:
        msg = f"{msg}; did you mean {nearest[0]}?"
    raise FileFormatError(msg)


def _scene(recipe: SceneRecipe, folder: Path) -> Scene:
    board = _board(recipe.board, folder)
    if isinstance(recipe, PlaneRecipe):
        return Scene.plane(size_um=recipe.size_um, board=board)
    if isinstance(recipe, HemisphereRecipe):
        return Scene.hemisphere(recipe.radius_um, x_um=recipe.x_um, y_um=recipe.y_um, board=board)
    if isinstance(recipe, BallRecipe):
        return Scene.ball(
            recipe.diameter_um,
            height_um=recipe.height_um,
            x_um=recipe.x_um,
            y_um=recipe.y_um,
            defect=None if recipe.defect is None else _defect(recipe.defect),
            board=board,
        )
    bridges = [Bridge(**bridge.model_dump()) for bridge in recipe.bridges]
    if isinstance(recipe, BallArrayRecipe):
        return Scene.ball_array(
            recipe.rows,
            recipe.cols,
            pitch_um=recipe.pitch_um,
            diameter_um=recipe.diameter_um,
            height_um=recipe.height_um,
            centre_um=recipe.centre_um,
            rotation_deg=recipe.rotation_deg,
            jitter=Jitter(**recipe.jitter.model_dump()),
            defects={name: _defect(defect) for name, defect in recipe.defects.items()},
            bridges=bridges,
            seed=recipe.seed,
            board=board,
        )
    balls = tuple(Ball(**ball.model_dump()) for ball in recipe.balls)
    return Scene(balls, tuple(bridges), board, recipe.size_um)


def _defect(recipe: DefectRecipe) -> Defect:
    return Defect(**recipe.model_dump())


def _board(recipe: BoardRecipe, folder: Path) -> Board:
    values: dict[str, Any] = recipe.model_dump(exclude={"i_d", "material", "texture", "albedo_map"})
    if recipe.i_d is not None and recipe.material is not None:
        msg = "scene.board: needs one of i_d and material, got both"
        raise InputError(msg)
    if recipe.i_d is not None:
        values["material"] = Material.matte(recipe.i_d)
    elif recipe.material is not None:
        values["material"] = _material(recipe.material)
    if recipe.texture is not None:
        values["texture"] = Texture(**recipe.texture.model_dump())
    if recipe.albedo_map is not None:
        try:
            values["albedo_map"] = np.load(folder / recipe.albedo_map, allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            msg = f"{folder / recipe.albedo_map}: is not an array of albedo factors ({error})"
            raise FileFormatError(msg) from error
    return Board(**values)


def _material(recipe: MaterialRecipe) -> Material:
    values: dict[str, Any] = recipe.model_dump(exclude={"second_lobe", "variation"})
    second = recipe.second_lobe
    lobe = None
    if second is not None:
        if (second.roughness is None) == (second.hardness is None):
            msg = "material.second_lobe: needs exactly one of hardness and roughness"
            raise InputError(msg)
        roughness = second.roughness
        if second.hardness is not None:
            roughness = roughness_from_hardness(second.hardness)
        lobe = Lobe(second.i_s, float(roughness or 0.0), second.distribution)
    return Material(**values, second_lobe=lobe, variation=Variation(**recipe.variation.model_dump()))


def _camera(values: SimulationRecipe) -> Camera:
    camera = values.camera.model_dump(exclude={"response_table"})
    table = values.camera.response_table
    return Camera(**camera, response_table=None if table is None else tuple(table))


def _rig(recipe: RigRecipe) -> LightRig:
    sources = ("ring", "angles_deg", "directions", "positions_um")
    given = [name for name in sources if getattr(recipe, name) is not None]
    if len(given) > 1:
        msg = f"rig: needs exactly one of {', '.join(sources)}; got {' and '.join(given)}"
        raise InputError(msg)
    if recipe.intensity_distance_um is not None and recipe.positions_um is None:
        msg = "rig.intensity_distance_um: goes with positions_um only"
        raise InputError(msg)
    if recipe.positions_um is not None:
        return _near_rig(recipe)
    if recipe.angles_deg is not None:
        return LightRig.from_angles(recipe.angles_deg, intensities=recipe.intensities)
    if recipe.directions is not None:
        rig = LightRig.from_directions(recipe.directions, intensities=recipe.intensities)
        vectors = np.array(recipe.directions, dtype=np.float64)
        # Unit vectors stay as they are: dividing by a length of 1 + 1e-16 again would change their last bit.
        exact = np.abs(np.linalg.norm(vectors, axis=1) - 1.0) < EXACT_UNIT
        return replace(rig, directions=np.where(exact[:, None], vectors, rig.directions))
    ring = {} if recipe.ring is None else recipe.ring.model_dump()
    return LightRig.ring(**ring, intensities=recipe.intensities)


def _near_rig(recipe: RigRecipe) -> LightRig:
    distance_um = recipe.intensity_distance_um
    each_um = distance_um if isinstance(distance_um, list) else None
    one_um = None if isinstance(distance_um, list) else distance_um
    rig = LightRig.from_positions(
        recipe.positions_um or [], intensities=recipe.intensities, intensity_distance_um=one_um
    )
    if each_um is None:
        return rig
    distances_um = np.array(each_um, dtype=np.float64)
    if distances_um.shape != (len(rig),) or not (np.isfinite(distances_um) & (distances_um > 0)).all():
        msg = f"rig.intensity_distance_um: must be one length, or {len(rig)} lengths above 0, got {each_um}"
        raise InputError(msg)
    return replace(rig, intensity_distance_um=distances_um)
