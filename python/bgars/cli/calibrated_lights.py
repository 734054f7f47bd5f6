"""Calibrated lights as ``bgars calibrate`` shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bgars.cli.console import say

if TYPE_CHECKING:
    from bgars.records.light_calibration import LightCalibration
    from bgars.records.remark import Remark

__all__ = ["lights_values", "said_values", "tell_lights"]


def lights_values(found: LightCalibration) -> dict[str, Any]:
    """Lights as plain values."""
    rig = found.rig
    return {
        "sphere": found.sphere,
        "directions": rig.directions.tolist(),
        "positions_mm": None if rig.positions_um is None else (rig.positions_um / 1000.0).tolist(),
        "intensities": rig.intensities.tolist(),
        "u_deg": found.u_deg.tolist(),
        "u_own_deg": found.u_own_deg.tolist(),
        "u_common_deg": found.u_common_deg.tolist(),
        "outlines_px": [ball.outline_px.tolist() for ball in found.balls],
        "residual_px": found.residual_px,
        **said_values(found.findings),
    }


def said_values(findings: tuple[Remark, ...]) -> dict[str, Any]:
    """Findings as plain values."""
    return {"findings": [finding.to_dict() for finding in findings]}


def tell_lights(found: LightCalibration) -> None:
    """Print a line per light."""
    rig = found.rig
    kind = "near lights, positions in mm" if rig.is_near else "distant lights"
    count = len(found.balls)
    balls = f"{found.sphere} ball{'s' if count != 1 else ''}" if found.sphere != "balls" else "solder balls"
    say(f"{len(rig)} {kind}, on {count} {balls}:")
    say("  light  azimuth  elevation   u (deg)   own  common  intensity" + ("   x, y, z (mm)" if rig.is_near else ""))
    for index in range(len(rig)):
        place = (
            ""
            if rig.positions_um is None
            else "   " + ", ".join(f"{value / 1000.0:.2f}" for value in rig.positions_um[index])
        )
        say(
            f"  {index:>5}  {rig.azimuths_deg[index]:7.2f}  {rig.elevations_deg[index]:9.2f}  {found.u_deg[index]:8.3f}"
            f" {found.u_own_deg[index]:5.3f}   {found.u_common_deg[index]:5.3f}  {rig.intensities[index]:9.3f}{place}"
        )
