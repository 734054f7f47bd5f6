"""The file ``station.toml``: what a calibration found, for every later capture of the same station."""

from __future__ import annotations

import hashlib
import json
import math
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.io.atomic import atomic_file
from bgars.io.station_tables import FlatTable, LightsTable, ResponseTable, ScaleTable, StationFile, VerifyTable
from bgars.io.strict_toml import checked, read_values
from bgars.records.flat_field import FlatField
from bgars.records.light_calibration import BallView, LightCalibration
from bgars.records.remark import Remark
from bgars.records.response_curve import ResponseCurve
from bgars.records.rig import LightRig
from bgars.records.scale import Scale
from bgars.records.station import Station, Verification

if TYPE_CHECKING:
    from os import PathLike

    from pydantic import BaseModel

__all__ = ["STATION_FORMAT", "is_station_file", "read_station", "station_keys", "write_station"]

STATION_FORMAT = "bgars-station"
STATION_VERSION = 1
MM = 1000.0


def is_station_file(path: str | PathLike[str]) -> bool:
    """True where a file says that it is a station, whatever its name."""
    try:
        return read_values(Path(path)).get("format") == STATION_FORMAT
    except FileFormatError:
        return False


def station_keys() -> list[tuple[str, str]]:
    """Return every key of the file and what it means, for the documentation."""
    tables: dict[str, type[BaseModel]] = {
        "lights": LightsTable,
        "flat": FlatTable,
        "response": ResponseTable,
        "scale": ScaleTable,
        "verified": VerifyTable,
    }
    keys = [(name, str(entry.description)) for name, entry in StationFile.model_fields.items() if name not in tables]
    for table, model in tables.items():
        keys += [(f"{table}.{name}", str(entry.description)) for name, entry in model.model_fields.items()]
    return keys


def read_station(path: str | PathLike[str]) -> Station:
    """Read and check a station file.

    Raises
    ------
    FileFormatError
        The file is missing, no TOML, not a station, or its flat field is missing or not the one it was written with.
    InputError
        An unknown key (the nearest known one is named), a wrong type or a value out of range.

    Examples
    --------
    >>> import bgars, tempfile, pathlib
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "station.toml"
    >>> bgars.write_station(bgars.Station("line 3", scale=bgars.Scale(3.4, 0.002)), place)
    >>> bgars.read_station(place).scale.pixel_pitch_um
    3.4
    """
    path = Path(path)
    values = read_values(path)
    if values.get("format") != STATION_FORMAT:
        msg = f'{path}: is not a station file: format must be "{STATION_FORMAT}", got {values.get("format")!r}'
        raise FileFormatError(msg)
    table = checked(StationFile, values, path)
    try:
        lights = None if table.lights is None else _lights(table.lights)
    except InputError as error:
        msg = f"{path}: lights: {error}"
        raise InputError(msg) from None
    scale = table.scale
    response = table.response
    return Station(
        name=table.name,
        lights=lights,
        flat=None if table.flat is None else _flat(path, table.flat),
        response=None
        if response is None
        else ResponseCurve(
            np.array(response.levels), np.array(response.radiances), response.u_radiance, response.source
        ),
        scale=None
        if scale is None
        else Scale(**{**scale.model_dump(), "tilt_deg": math.nan if scale.tilt_deg is None else scale.tilt_deg}),
        calibrated_utc=table.calibrated_utc,
        verified=tuple(_verified(one) for one in table.verified),
        verified_utc=table.verified_utc,
        findings=tuple(Remark(one.severity, one.message, one.code) for one in table.findings),
    )


def _verified(table: VerifyTable) -> Verification:
    unknown = {"u_bias_um", "slope", "u_slope", "repeatability_um"}
    values: dict[str, Any] = table.model_dump()
    known: dict[str, Any] = {
        key: math.nan if value is None and key in unknown else value for key, value in values.items()
    }
    return Verification(**known)


def _lights(table: LightsTable) -> LightCalibration:
    if table.positions_mm is not None:
        rig = LightRig.from_positions(
            np.array(table.positions_mm) * MM, intensities=table.intensities, u_deg=table.u_deg
        )
    else:
        rig = LightRig.from_directions(np.array(table.directions), intensities=table.intensities, u_deg=table.u_deg)
    u_mm = table.u_positions_mm
    return LightCalibration(
        rig=rig,
        u_deg=np.array(table.u_deg),
        u_own_deg=np.array(table.u_own_deg),
        u_common_deg=np.array(table.u_common_deg),
        u_lens_deg=None if table.u_lens_deg is None else np.array(table.u_lens_deg),
        u_distance_deg=None if table.u_distance_deg is None else np.array(table.u_distance_deg),
        sphere=table.sphere,
        balls=_balls(table, len(rig)),
        residual_px=table.residual_px,
        u_positions_um=None if u_mm is None else np.array(u_mm) * MM,
        u_intensities=None if table.u_intensities is None else np.array(table.u_intensities),
        lamp_deg=math.nan if table.lamp_deg is None else table.lamp_deg,
        level=math.nan if table.level is None else table.level,
        level_by=table.level_by,
        pixel_pitch_um=table.pixel_pitch_um,
        size_px=table.size_px,
    )


def _balls(table: LightsTable, lights: int) -> tuple[BallView, ...]:
    """The balls without their highlights and uncertainties, which the file does not hold."""
    unseen = np.full((lights, 2), np.nan)
    u = np.full(3, np.nan)
    return tuple(BallView("", np.array(outline), u, unseen, unseen) for outline in table.outlines_px or ())


def _flat(path: Path, table: FlatTable) -> FlatField:
    file = path.parent / table.file
    try:
        content = file.read_bytes()
    except OSError as error:
        msg = f"{path}: flat.file: {file} cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    if hashlib.sha256(content).hexdigest() != table.sha256:
        msg = f"{path}: flat.file: {file} is not the one that was calibrated (its checksum differs)"
        raise FileFormatError(msg)
    with np.load(file, allow_pickle=False) as archive:
        coefficients = archive["coefficients"]
    terms = (table.degree + 1) * (table.degree + 2) // 2
    if coefficients.ndim != 2 or coefficients.shape[1] != terms:  # noqa: PLR2004 - lights and terms
        msg = (
            f"{path}: flat.degree: must be the degree of the maps in {table.file}, which have "
            f"{coefficients.shape[-1]} coefficients each (a degree of {table.degree} has {terms}), got {table.degree}"
        )
        raise InputError(msg)
    return FlatField(coefficients, table.degree, table.size_px, table.residual)


def write_station(station: Station, path: str | PathLike[str]) -> None:
    """Write a station file, and its flat field beside it as ``NAME.flat.npz``.

    Raises
    ------
    FileFormatError
        The folder is missing or not writable.
    """
    path = Path(path)
    lines = [f'format = "{STATION_FORMAT}"', f"version = {STATION_VERSION}", f"name = {json.dumps(station.name)}"]
    lines += [f"calibrated_utc = {json.dumps(station.calibrated_utc)}", f"bgars = {json.dumps(version('bgars'))}"]
    if station.verified_utc:
        lines += [f"verified_utc = {json.dumps(station.verified_utc)}"]
    if station.lights is not None:
        lines += _table("lights", _lights_values(station.lights))
    if station.flat is not None:
        file = path.with_name(f"{path.stem}.flat.npz")
        with atomic_file(file) as place, place.open("wb") as stream:
            np.savez(stream, coefficients=station.flat.coefficients)
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
        flat = station.flat
        values = {"file": file.name, "sha256": digest, "degree": flat.degree, "size_px": list(flat.size_px)}
        lines += _table("flat", {**values, "residual": flat.residual})
    if station.response is not None:
        curve = station.response
        values = {"levels": curve.levels.round(6).tolist(), "radiances": curve.radiances.tolist()}
        lines += _table("response", {**values, "u_radiance": curve.u_radiance, "source": curve.source})
    if station.scale is not None:
        lines += _table("scale", dict(vars(station.scale)))
    for one in station.verified:
        lines += _table("[verified]", dict(vars(one)))
    for finding in station.findings:
        lines += ["", "[[findings]]", f"severity = {json.dumps(finding.severity)}"]
        lines += [f"code = {json.dumps(finding.code)}", f"message = {json.dumps(finding.message)}"]
    with atomic_file(path) as place:
        place.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _lights_values(lights: LightCalibration) -> dict[str, Any]:
    rig = lights.rig
    places = {"directions": rig.directions.tolist()}
    if rig.positions_um is not None:
        places = {"positions_mm": (rig.positions_um / MM).round(6).tolist()}
    # Solder balls differ from part to part: they say nothing of the station's scale.
    outlines = [] if lights.sphere == "balls" else [ball.outline_px.tolist() for ball in lights.balls]
    return {
        "sphere": lights.sphere,
        **places,
        "intensities": rig.intensities.tolist(),
        "u_deg": lights.u_deg.tolist(),
        "u_own_deg": lights.u_own_deg.tolist(),
        "u_common_deg": lights.u_common_deg.tolist(),
        "u_lens_deg": _unless_zero(lights.u_lens_deg),
        "u_distance_deg": _unless_zero(lights.u_distance_deg),
        "u_positions_mm": None if lights.u_positions_um is None else (lights.u_positions_um / MM).tolist(),
        "u_intensities": None if lights.u_intensities is None else lights.u_intensities.tolist(),
        "lamp_deg": lights.lamp_deg,
        "residual_px": lights.residual_px,
        "balls": len(lights.balls),
        "outlines_px": outlines or None,
        "level": lights.level,
        "level_by": lights.level_by or None,
        "pixel_pitch_um": lights.pixel_pitch_um,
        "size_px": lights.size_px,
    }


def _unless_zero(values: np.ndarray | None) -> list[float] | None:
    return values.tolist() if values is not None and values.any() else None


def _table(name: str, values: dict[str, Any]) -> list[str]:
    """A table of TOML; JSON's numbers, texts and arrays are TOML's, too. None and NaN are left out."""
    kept = {key: value for key, value in values.items() if value is not None and value == value}  # noqa: PLR0124 - NaN
    return [
        "",
        f"[{name}]",
        *(f"{key} = {'inf' if value == math.inf else json.dumps(value)}" for key, value in kept.items()),
    ]
