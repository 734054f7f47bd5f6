"""The material that an inspection fitted to the balls, parameter by parameter, as result.json keeps it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

if TYPE_CHECKING:
    from bgars.records.reflectance_fit import ReflectanceFit
from bgars.records.keys import Key
from bgars.records.short import Short

__all__ = ["GREY_LEVELS", "MaterialParameter", "PartMaterial", "part_material"]

Unit = Literal["grey levels of 255", "ratio"]
Masking = Literal["smith", "cook-torrance"]
GREY_LEVELS: Unit = "grey levels of 255"
RATIO: Unit = "ratio"


@dataclass(frozen=True)
class MaterialParameter:
    """One number of a material.

    Attributes
    ----------
    name : str
        As in a material file (docs/conventions.md): ``diffuse_level``, ``roughness_1``, ``gain_0``, ...
    value, standard_error : float
        NaN = the parameter was not fitted: it was left out of the model, or came from a file that holds no error.
    unit : str
        "grey levels of 255" or "ratio".
    """

    name: Annotated[str, Key("as in a material file: diffuse_level, roughness_1, gain_0, ...")]
    value: Annotated[float, Key("the number, in `unit`")]
    standard_error: Annotated[float, Key("standard error (k = 1) in `unit`; null = the number was not fitted")]
    unit: Annotated[Unit, Key("unit of value and standard error")]


@dataclass(frozen=True, repr=False)
class PartMaterial(Short):
    """What the balls do with light, and how well one material explains them.

    Attributes
    ----------
    parameters : tuple of MaterialParameter
    masking : {"smith", "cook-torrance"}
        Geometric attenuation that explains the balls better.
    loss : float
        As :attr:`bgars.ReflectanceFit.loss`: below 0.1 very well, above 2 not at all.
    accepted : bool
        False where the fit was too bad to be used for normals.
    from_file : bool
        True where the recipe brought the material.
    own_material_balls : int
        Balls that were given a material of their own.
    residuals_learnt : bool
        Whether each ball was corrected by what the others show beyond the material.
    """

    parameters: Annotated[
        tuple[MaterialParameter, ...], Key("diffuse light, one or two lobes, brightness of each light")
    ]
    masking: Annotated[Masking, Key("attenuation of the lobes that explains more")]
    loss: Annotated[
        float,
        Key(
            "mean of log(1 + (r / 3)^2) over pixels and lights, r in grey levels: below 0.1 explained very "
            "well, above 2 not at all"
        ),
    ]
    accepted: Annotated[bool, Key("false: the fit was too bad, normals are another estimator's")]
    from_file: Annotated[bool, Key("true: the recipe brought the material, nothing was fitted")]
    own_material_balls: Annotated[int, Key("balls that were given a material of their own", ge=0)]
    residuals_learnt: Annotated[bool, Key("whether balls were corrected by what the others show beyond it")]


def part_material(fit: ReflectanceFit, *, from_file: bool) -> PartMaterial:
    """Return what a fit learnt, in the order of a material file.

    Examples
    --------
    >>> import bgars
    >>> lobe = bgars.SurfaceLobe(strength_level=255.0, roughness=0.2, tail=0.0)
    >>> solder = bgars.SurfaceMaterial(30.0, 0.0, 0.0, (lobe,), "smith", gains=(1.0,) * 8)
    >>> fit = bgars.ReflectanceFit(solder, 0.05, True, (), (False,), True, (0.4,), (None,))
    >>> [row.name for row in part_material(fit, from_file=False).parameters[:5]]
    ['diffuse_level', 'grazing', 'ambient_level', 'strength_1_level', 'roughness_1']
    """
    material = fit.material
    values: list[tuple[str, float, Unit]] = [
        ("diffuse", material.diffuse_level, GREY_LEVELS),
        ("grazing", material.grazing, RATIO),
        ("ambient", material.ambient_level, GREY_LEVELS),
    ]
    for number, lobe in enumerate(material.lobes, start=1):
        values += [
            (f"strength_{number}", lobe.strength_level, GREY_LEVELS),
            (f"roughness_{number}", lobe.roughness, RATIO),
            (f"tail_{number}", lobe.tail, RATIO),
        ]
    values += [(f"gain_{light}", gain, RATIO) for light, gain in enumerate(material.gains)]
    rows = tuple(
        MaterialParameter(
            f"{name}_level" if unit == GREY_LEVELS else name,
            float(value),
            float(material.standard_errors.get(name, math.nan)),
            unit,
        )
        for name, value, unit in values
    )
    return PartMaterial(
        parameters=rows,
        masking=material.masking,
        loss=float(fit.loss),
        accepted=bool(fit.accepted),
        from_file=from_file,
        own_material_balls=sum(map(bool, fit.own_material)),
        residuals_learnt=bool(fit.residuals_learnt),
    )
