"""The setup of a simulation as plain values, from which the same capture comes back bit by bit."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bgars.records.rig import LightRig
    from bgars.simulate import Board, SimulationSetup

__all__ = ["ALBEDO_MAP", "setup_values"]

ALBEDO_MAP = "albedo_map.npy"


def setup_values(setup: SimulationSetup, version: str) -> dict[str, Any]:
    """Return values in the form of a recipe; Python writes floats with all their digits.

    A measured albedo map goes into a file of its own, :data:`ALBEDO_MAP`.
    """
    values: dict[str, Any] = {
        "bgars": version,
        "seed": setup.seed,
        "scene": {
            "kind": "balls",
            "balls": [asdict(ball) for ball in setup.scene.balls],
            "bridges": [asdict(bridge) for bridge in setup.scene.bridges],
            "size_um": list(setup.scene.size_um),
            "board": _board_values(setup.scene.board),
        },
        "rig": _rig_values(setup.rig),
        "material": asdict(setup.material),
        "camera": asdict(setup.camera),
    }
    return {name: _without_none(value) for name, value in values.items()}


def _board_values(board: Board) -> dict[str, Any]:
    values = {
        field.name: getattr(board, field.name)
        for field in fields(board)
        if field.name not in {"material", "texture", "albedo_map"}
    }
    values["material"] = asdict(board.material)
    values["texture"] = None if board.texture is None else asdict(board.texture)
    values["albedo_map"] = None if board.albedo_map is None else ALBEDO_MAP
    return values


def _rig_values(rig: LightRig) -> dict[str, Any]:
    values = {
        "intensities": rig.intensities.tolist(),
        "u_deg": None if rig.u_deg is None else rig.u_deg.tolist(),
    }
    if rig.positions_um is None or rig.intensity_distance_um is None:
        return {"directions": rig.directions.tolist(), **values}
    return {
        "positions_um": rig.positions_um.tolist(),
        "intensity_distance_um": rig.intensity_distance_um.tolist(),
        **values,
    }


def _without_none(values: Any) -> Any:  # noqa: ANN401 - any JSON value
    if isinstance(values, dict):
        return {name: _without_none(value) for name, value in values.items() if value is not None}
    if isinstance(values, (list, tuple)):
        return [_without_none(value) for value in values]
    return values
