"""The material on the page: every fitted parameter in words, and how well the fit explains the balls."""

from __future__ import annotations

import re
from typing import Any

from bgars.records.reflectance_fit import loss_in_words
from bgars.report.html.words import NOT_MEASURED, is_known

__all__ = ["material_facts", "material_rows"]

MEANINGS = {
    "diffuse_level": ("diffuse light", "level of a matt facet that faces the light"),
    "grazing": ("grazing loss", "weight of the loss of diffuse light at grazing angles, 0 = Lambertian"),
    "ambient_level": ("ambient light", "level without lamps: mean interreflection"),
    "strength_level": ("strength of lobe {}", "level at its peak, where the camera looks along the normal"),
    "roughness": ("roughness of lobe {}", "root mean square slope of the microfacets"),
    "tail": ("tail of lobe {}", "0 = Beckmann, 1 = GGX"),
    "gain": ("brightness of light {}", "relative to the rig, 1 = as stated; lights count from 0"),
}
NUMBERED = re.compile(r"(strength|roughness|tail|gain)_(\d+)((?:_level)?)")
SIGNIFICANT = 2


def material_rows(result: dict[str, Any]) -> list[dict[str, str]]:
    """One row a parameter: name in words, value, standard error, unit, key in result.json."""
    material = result["material"]
    rows = []
    for row in [] if material is None else material["parameters"]:
        parts = NUMBERED.fullmatch(row["name"])
        key, number = (row["name"], "") if parts is None else (parts[1] + parts[3], parts[2])
        title, meaning = MEANINGS.get(key, (row["name"], ""))
        value, error = row["value"], row["standard_error"]
        digits = _digits(value, error)
        rows.append(
            {
                "key": row["name"],
                "title": title.format(number),
                "meaning": "" if key == "gain" and int(number) else meaning,
                "value": f"{value:.{digits}f}" if is_known(value) else NOT_MEASURED,
                "error": f"{error:.{digits}f}" if is_known(error) else "not fitted",
                "unit": row["unit"],
            }
        )
    return rows


def _digits(value: float | None, error: float | None) -> int:
    """Decimals that show two digits of the error, or three of the value where it has none."""
    if is_known(error) and error > 0:
        exponent = int(f"{error:e}".partition("e")[2])
        return min(max(SIGNIFICANT - 1 - exponent, 0), 6)
    return 3 if is_known(value) and abs(value) < 10 else 1  # noqa: PLR2004 - one digit before the point


def material_facts(result: dict[str, Any]) -> list[tuple[str, str]]:
    """What was chosen, and on what evidence."""
    material = result["material"]
    if material is None:
        return []
    loss = material["loss"]
    words = loss_in_words(loss, accepted=material["accepted"]) if is_known(loss) else ""
    facts = [
        ("material", "from the recipe's file, not fitted here" if material["from_file"] else "fitted to all balls"),
        ("loss", f"{loss:.3f}: one material explains the balls {words}" if is_known(loss) else "not known"),
        ("used for the normals", "yes" if material["accepted"] else "no: it explains the balls too badly"),
        ("attenuation of the lobes", f"{material['masking']}: the one that fits better"),
        ("balls with a material of their own", str(material["own_material_balls"])),
        (
            "interreflections estimated from the other balls",
            "yes" if material["residuals_learnt"] else "no: it did not lower the loss, or there are too few balls",
        ),
    ]
    if material["from_file"]:
        facts[3] = ("attenuation of the lobes", material["masking"])
    return facts
