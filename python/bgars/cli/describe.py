"""``bgars info``: what a capture is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import bgars
from bgars.cli.console import print_json, say
from bgars.cli.first_check import check_first
from bgars.cli.options import ChannelChoice, FolderArgument, JsonOption

if TYPE_CHECKING:
    from collections.abc import Iterator

    import typer

    from bgars.records.capture import Capture

__all__ = ["describe", "describe_in_words", "register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("info")(info)


def info(folder: FolderArgument, channel: ChannelChoice = None, as_json: JsonOption = False) -> None:
    """Describe a capture: images, lights, scale, clipped pixels.

    Also says what 'bgars check' finds in it.
    """
    capture = bgars.read_capture(folder, channel=channel)
    facts = describe(capture)
    findings = check_first(capture, force=True)
    if as_json:
        print_json({**facts, **findings.to_dict()})
        return
    for line in describe_in_words(facts):
        say(line)


def describe(capture: Capture) -> dict[str, Any]:
    """Return the facts of a capture as plain Python values."""
    rig = capture.rig
    lights = []
    for index in range(len(rig)):
        values = capture.images[index][capture.mask]
        lights.append(
            {
                "image": rig.files[index] if rig.files else str(index),
                "azimuth_deg": round(float(rig.azimuths_deg[index]), 3),
                "elevation_deg": round(float(rig.elevations_deg[index]), 3),
                "intensity": float(rig.intensities[index]),
                "median_grey": float(np.median(values)),
                "maximum_grey": float(values.max()),
                "clipped_fraction": float(np.mean(values >= capture.saturation)),
            }
        )
    return {
        "capture": capture.name,
        "image_size_px": [int(capture.images.shape[2]), int(capture.images.shape[1])],
        "dtype": str(capture.images.dtype),
        "pixel_pitch_um": capture.pixel_pitch_um,
        "mask_fraction": float(capture.mask.mean()),
        "dark_frame": capture.dark is not None,
        "response": "linear" if capture.response is None else "table",
        "black_level": capture.black_level,
        "saturation": capture.saturation if np.isfinite(capture.saturation) else None,
        "assumed": list(capture.assumed),
        "rig": "near point lights" if rig.is_near else "distant lights",
        "lights": lights,
    }


def describe_in_words(facts: dict[str, Any]) -> Iterator[str]:
    """Yield the lines that a person reads."""
    width, height = facts["image_size_px"]
    pitch = facts["pixel_pitch_um"]
    scale = (
        f"{pitch:g} um per pixel ({width * pitch / 1000:.2f} x {height * pitch / 1000:.2f} mm)" if pitch else "unknown"
    )
    yield f"capture     {facts['capture']}"
    yield f"images      {len(facts['lights'])} of {width} x {height} pixels, {facts['dtype']}"
    yield f"scale       {scale}"
    yield f"mask        {100 * facts['mask_fraction']:.1f} % of the image is used"
    dark = "dark frame" if facts["dark_frame"] else f"black level {facts['black_level']:g}"
    clip = "no clipping level" if facts["saturation"] is None else f"clipped at {facts['saturation']:g}"
    yield f"radiometry  {facts['response']} response, {dark}, {clip}"
    yield f"rig         {len(facts['lights'])} {facts['rig']}"
    yield ""
    yield (
        f"{'image':<24} {'azimuth':>9} {'elevation':>10} {'intensity':>10} {'median':>9} {'maximum':>9} {'clipped':>9}"
    )
    yield f"{'':<24} {'deg':>9} {'deg':>10} {'':>10} {'grey':>9} {'grey':>9} {'%':>9}"
    for light in facts["lights"]:
        yield (
            f"{light['image']:<24} {light['azimuth_deg']:>9.1f} {light['elevation_deg']:>10.1f} "
            f"{light['intensity']:>10.3f}"
            f" {light['median_grey']:>9.6g} {light['maximum_grey']:>9.6g} {100 * light['clipped_fraction']:>9.2f}"
        )
