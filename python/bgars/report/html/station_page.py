"""The page of a station: every calibration with its residuals, and what limits it. One file, no network."""

from __future__ import annotations

import html
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.io.atomic import atomic_file
from bgars.records.station_sections import section_of

if TYPE_CHECKING:
    from collections.abc import Iterable
    from os import PathLike

    from bgars.records.flat_field import FlatField
    from bgars.records.light_calibration import LightCalibration
    from bgars.records.response_curve import ResponseCurve
    from bgars.records.scale import Scale
    from bgars.records.station import Station

__all__ = ["write_station_page"]

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1, h2 { font-weight: 600; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
.wide { overflow-x: auto; background: linear-gradient(90deg, #fff 1rem, #fff0 2rem) local,
  linear-gradient(270deg, #fff 1rem, #fff0 2rem) local, linear-gradient(90deg, #0003, #0000 .8rem),
  linear-gradient(270deg, #0003, #0000 .8rem); } figure { margin: 1rem 0; }
table { border-collapse: collapse; } td, th { padding: .15rem .7rem; text-align: right; }
th { border-bottom: 1px solid #888; font-weight: 600; } td:first-child, th:first-child { text-align: left; }
.doubt, .fail { color: #a33; font-weight: 600; } svg { max-width: 100%; height: auto; }
figcaption { color: #555; font-size: .85rem; } h3 { font-size: 1rem; margin: 1rem 0 0; }
.missing { color: #777; }
"""
TITLES = {
    "whole": "All sections together",
    "lights": "Lights",
    "flat": "Flat field",
    "response": "Response",
    "scale": "Scale",
    "verified": "Verification",
}
SIDE, EDGE = 300, 40
"""Side of a picture, and what is kept free around it for what stands over, and for numbers."""
SHADED_U, LARGEST_SHADE = (20, 10, 5, 2, 1), 24.0
"""Standard uncertainties that a disc may show, and the largest radius at which discs of a ring do not overlap."""
LEAST_RESIDUAL_PX = 0.0005
"""Below it, a residual is 0 as it is shown."""


def write_station_page(station: Station, path: str | PathLike[str]) -> None:
    """Write ``station.html``.

    Raises
    ------
    FileFormatError
        The folder is missing or not writable.
    """
    pictures = Path(path).with_suffix(".balls.svg")
    parts = [
        f"<h1>{html.escape(station.name)}</h1>",
        f"<p>Calibrated {html.escape(station.calibrated_utc or 'at an unknown time')}.</p>",
        "<h2>Lights</h2>",
        *(_lights(station.lights) if station.lights else _missing("bgars calibrate lights FOLDER -o station.toml")),
        *(_balls(pictures) if station.lights and pictures.is_file() else ()),
        "<h2>Flat field (evenness of the lights)</h2>",
        *(_flat(station.flat) if station.flat else _missing("bgars calibrate flat FOLDER -o station.toml")),
        "<h2>Response of the camera</h2>",
        *(
            _response(station.response)
            if station.response
            else _missing("bgars calibrate response FOLDER -o station.toml")
        ),
        "<h2>Scale</h2>",
        *(_scale(station.scale) if station.scale else _missing("bgars calibrate scale FOLDER -o station.toml")),
        "<h2>Verification</h2>",
        *(
            _verified(station)
            if station.verified
            else _missing("bgars verify FOLDER... --known known.csv --station station.toml")
        ),
        *_findings(station),
    ]
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="generator" content="bgars">'
        f"<title>{html.escape(station.name)}</title>"
        f"<style>{STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    )
    with atomic_file(path) as place:
        Path(place).write_text(page, encoding="utf-8")


def _findings(station: Station) -> Iterable[str]:
    """Findings by the calibration that they belong to, those first that want something done."""
    yield "<h2>Findings</h2>"
    if not station.findings:
        yield "<p>None.</p>"
    for section, title in TITLES.items():
        found = [one for one in station.findings if section_of(one.code) == section]
        if not found:
            continue
        yield f"<h3>{title}</h3><ul>"
        for one in sorted(found, key=lambda one: one.severity == "note"):
            yield f'<li class="{one.severity}">{html.escape(one.severity)}: {html.escape(one.message)}</li>'
        yield "</ul>"


def _missing(command: str) -> list[str]:
    return [f'<p class="missing">Not calibrated. <code>{html.escape(command)}</code></p>']


def _lights(lights: LightCalibration) -> Iterable[str]:
    rig = lights.rig
    head = ["light", "azimuth (deg)", "elevation (deg)", "u (deg)", "u own (deg)", "u common (deg)", "intensity"]
    if rig.positions_um is not None:
        head += ["x (mm)", "y (mm)", "z (mm)"]
    rows = []
    for index in range(len(rig)):
        cells = [
            str(index),
            f"{rig.azimuths_deg[index]:.2f}",
            f"{rig.elevations_deg[index]:.2f}",
            f"{lights.u_deg[index]:.3f}",
        ]
        cells += [
            f"{lights.u_own_deg[index]:.3f}",
            f"{lights.u_common_deg[index]:.3f}",
            f"{rig.intensities[index]:.3f}",
        ]
        if rig.positions_um is not None:
            cells += [f"{value / 1000.0:.2f}" for value in rig.positions_um[index]]
        rows.append(cells)
    yield _table(head, rows)
    yield _sky(rig.directions, lights.u_deg)
    common, own = float(np.median(lights.u_common_deg)), float(np.median(lights.u_own_deg))
    limit = (
        "the outline of the ball (a larger ball, or a plainer background)"
        if common > own
        else "the highlights themselves (expose so that they just clip; a sharper image)"
    )
    lens = 0.0 if lights.u_lens_deg is None else float(np.median(lights.u_lens_deg))
    if lens > max(math.sqrt(max(common**2 - lens**2, 0.0)), own):
        limit = "the lens, which is not stated (telecentric, or its distance)"
    distance = 0.0 if lights.u_distance_deg is None else float(np.median(lights.u_distance_deg))
    if distance > max(math.sqrt(max(common**2 - distance**2, 0.0)), own):
        limit = "the distance of the lamps (photograph the ball at three places)"
    # One mirror ball gives each light one highlight: nothing is left over to disagree.
    alone = lights.residual_px < LEAST_RESIDUAL_PX
    residual = "one ball leaves no residual" if alone else f"residual {lights.residual_px:.3f} px"
    yield f"<p>By a {html.escape(lights.sphere)} ball; {residual}. Limited by {limit}.</p>"


def _balls(pictures: Path) -> Iterable[str]:
    """The balls as they were seen, where calibration left their pictures beside the station."""
    drawing = pictures.read_text(encoding="utf-8")
    if drawing.startswith("<svg"):
        caption = "Brightest level of all lights; red: outline; yellow: highlight of each light"
        yield f"<figure>{drawing}<figcaption>{caption}</figcaption></figure>"


def _sky(directions: np.ndarray, u_deg: np.ndarray) -> str:
    """Where the lights are, seen from above; discs of as many u as leave them apart."""
    radii = np.radians(u_deg) * SIDE / 2
    times = next((each for each in SHADED_U if each * radii.max() <= LARGEST_SHADE), SHADED_U[-1])
    marks = []
    for index, ((x, y, _), radius) in enumerate(zip(directions, radii, strict=True)):
        cx, cy = SIDE / 2 * (1 + 0.92 * x), SIDE / 2 * (1 - 0.92 * y)
        size = max(times * float(radius), 1.0)
        marks.append(
            f'<circle cx="{cx:.1f}" cy="{cy:.1f}" r="{size:.1f}" fill="#4477aa55"/><circle cx="{cx:.1f}" '
            f'cy="{cy:.1f}" r="2"/>'
        )
        marks.append(f'<text x="{cx + 6:.1f}" y="{cy - 4:.1f}" font-size="11">{index}</text>')
    rings = "".join(
        f'<circle cx="{SIDE / 2}" cy="{SIDE / 2}" r="{SIDE / 2 * 0.92 * math.cos(math.radians(e)):.1f}" '
        'fill="none" stroke="#ccc"/>'
        for e in (0, 30, 60)
    )
    title = f"Lights as the camera sees them; rings at elevations of 0, 30 and 60 degrees; shaded: {times} u"
    return _figure(title, rings + "".join(marks))


def _figure(title: str, content: str) -> str:
    """A drawing of SIDE by SIDE with an edge, and its title below."""
    side = SIDE + 2 * EDGE
    return (
        f'<figure><svg viewBox="{-EDGE} {-EDGE} {side} {side}" width="{side}" height="{side}" role="img" '
        f'aria-label="{title}"><title>{title}</title>{content}</svg><figcaption>{title}</figcaption></figure>'
    )


def _flat(flat: FlatField) -> Iterable[str]:
    levels = flat.coefficients[:, 0]
    rows = [[str(index), f"{100 * level / levels.mean():.1f} %"] for index, level in enumerate(levels)]
    yield _table(["light", "level, of the mean"], rows)
    yield (
        f"<p>Polynomials of degree {flat.degree} over {flat.size_px[1]} x {flat.size_px[0]} pixels; "
        f"residual {100 * flat.residual:.2f} % of the "
        "level, noise removed: the texture of the board limits it.</p>"
    )


def _response(curve: ResponseCurve) -> Iterable[str]:
    points = " ".join(
        f"{SIDE * x:.1f},{SIDE * (1 - y):.1f}" for x, y in zip(curve.levels, curve.radiances, strict=True)
    )
    ticks = "".join(
        f'<path d="M{SIDE * at:g} {SIDE}v5M0 {SIDE * (1 - at):g}h-5" stroke="#888"/>'
        f'<text x="{SIDE * at:g}" y="{SIDE + 17}" text-anchor="middle">{100 * at:g}</text>'
        f'<text x="-8" y="{SIDE * (1 - at) + 4:g}" text-anchor="end">{100 * at:g}</text>'
        for at in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    content = (
        f'<rect width="{SIDE}" height="{SIDE}" fill="none" stroke="#ccc"/><line x1="0" y1="{SIDE}" x2="{SIDE}" '
        f'y2="0" stroke="#bbb" stroke-dasharray="4"/><g font-size="11" fill="#555">{ticks}'
        f'<text x="{SIDE / 2:g}" y="{SIDE + 34}" text-anchor="middle">grey level (% of full scale)</text>'
        f'<text transform="translate(-31,{SIDE / 2:g}) rotate(-90)" text-anchor="middle">light (% of full scale)</text>'
        f'</g><polyline points="{points}" fill="none" stroke="#4477aa" stroke-width="2"/>'
    )
    yield _figure("Light over grey level; dashed: a linear camera", content)
    yield (
        f"<p>By {html.escape(curve.source)}: {100 * curve.nonlinearity:.1f} % off a straight line, gamma about "
        f"{curve.gamma:.2f}; u {100 * curve.u_radiance:.2f} % of full scale.</p>"
    )


def _scale(scale: Scale) -> Iterable[str]:
    yield (
        f"<p>A pixel is {scale.pixel_pitch_um:.4f} um (u {scale.pixel_pitch_u_um:.2g} um) by {scale.points} "
        "points, residual "
        f"{scale.residual_px:.3f} px; distortion at the corners {100 * scale.distortion:.2f} %{_camera(scale)}.</p>"
    )


def _camera(scale: Scale) -> str:
    if scale.camera_distance_mm is None:
        return ""
    if math.isinf(scale.camera_distance_mm):
        return "; the lens is telecentric"
    tilt = "" if math.isnan(scale.tilt_deg) else f"; the grid was tilted by {scale.tilt_deg:.2f} deg"
    return f"; the camera is {scale.camera_distance_mm:.1f} mm above the board{tilt}"


def _verified(station: Station) -> Iterable[str]:
    def shown(value: float, unit: str = "um") -> str:
        return "" if math.isnan(value) else f"{value:+.2f} {unit}" if value < 0 else f"{value:.2f} {unit}"

    rows = [
        [
            one.quantity,
            shown(one.bias_um),
            shown(one.u_bias_um),
            shown(1000.0 * one.slope, "um/mm"),
            shown(one.repeatability_um),
            shown(one.largest_um),
            "" if one.mpe_um is None else shown(one.mpe_um),
            f"{one.balls} x {one.captures}",
        ]
        for one in station.verified
    ]
    yield f"<p>Against a part of known sizes, {html.escape(station.verified_utc)}.</p>"
    yield _table(["", "bias", "u of bias", "slope", "repeatability", "largest error", "permissible", "balls"], rows)


def _table(head: list[str], rows: list[list[str]]) -> str:
    top = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
