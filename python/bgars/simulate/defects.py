"""What may be wrong with a ball."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from bgars.records.renamed import renamed
from bgars.simulate.checks import at_least, number, one_of, positive, require

if TYPE_CHECKING:
    from bgars.simulate.balls import Ball

__all__ = ["Defect"]

DefectKind = Literal["missing", "offset", "size", "flattened", "clipped"]
KINDS = ("missing", "offset", "size", "flattened", "clipped")


@renamed(flat_um="flat_top_depth_um")
@dataclass(frozen=True)
class Defect:
    """A defect of one ball; bridges join two and are given apart (:class:`bgars.Bridge`).

    Make one with :meth:`missing`, :meth:`offset`, :meth:`size`, :meth:`flattened` or :meth:`clipped`.

    Attributes
    ----------
    kind : str
        Which of these.
    dx_um, dy_um : float
        Offset.
    scale : float
        Factor of radius and height ("size").
    height, width : float
        Factors of top height and radius ("flattened").
    flat_top_depth_um : float
        Height cut off the top ("clipped").
    """

    kind: DefectKind
    dx_um: float = 0.0
    dy_um: float = 0.0
    scale: float = 1.0
    height: float = 1.0
    width: float = 1.0
    flat_top_depth_um: float = 0.0

    def __post_init__(self) -> None:
        one_of("defect.kind", self.kind, KINDS)
        number("defect.dx_um", self.dx_um)
        number("defect.dy_um", self.dy_um)
        for name in ("scale", "height", "width"):
            positive(f"defect.{name}", getattr(self, name))
        at_least("defect.flat_top_depth_um", self.flat_top_depth_um, 0.0)
        require(
            self.kind != "size" or self.scale != 1.0, "defect.scale", "of kind 'size', must differ from 1", self.scale
        )

    @classmethod
    def missing(cls) -> Defect:
        """No ball: the board shows."""
        return cls("missing")

    @classmethod
    def offset(cls, dx_um: float, dy_um: float) -> Defect:
        """Off its place."""
        return cls("offset", dx_um=dx_um, dy_um=dy_um)

    @classmethod
    def size(cls, scale: float) -> Defect:
        """Too small (scale below 1) or too large: radius and height grow together."""
        return cls("size", scale=scale)

    @classmethod
    def flattened(cls, height: float = 0.85, width: float = 1.08) -> Defect:
        """Pressed flat: a spheroid of lower top and larger radius, its centre where it was."""
        return cls("flattened", height=height, width=width)

    @classmethod
    def clipped(cls, flat_top_depth_um: float) -> Defect:
        """A sphere whose top `flat_top_depth_um` is cut off by a horizontal plane."""
        return cls("clipped", flat_top_depth_um=flat_top_depth_um)

    def applied(self, ball: Ball) -> Ball:
        """Return the ball with this defect.

        Examples
        --------
        >>> from bgars.simulate import Ball
        >>> Defect.size(0.8).applied(Ball(0, 0, 300, 200)).top_um
        400.0
        """
        if self.kind == "missing":
            return replace(ball, present=False, defect="missing")
        if self.kind == "offset":
            return replace(ball, x_um=ball.x_um + self.dx_um, y_um=ball.y_um + self.dy_um, defect="offset")
        if self.kind == "size":
            defect = "undersized" if self.scale < 1 else "oversized"
            radius_um, centre_z_um = ball.radius_um * self.scale, ball.centre_z_um * self.scale
            return replace(ball, radius_um=radius_um, centre_z_um=centre_z_um, defect=defect)
        if self.kind == "clipped":
            return replace(ball, flat_top_depth_um=self.flat_top_depth_um, defect="clipped")
        radius_um = ball.radius_um * self.width
        vertical_um = ball.top_um * self.height - ball.centre_z_um
        require(
            vertical_um > 0,
            f"ball {ball.name}: defect.height",
            "must leave the top above the ball's centre; its vertical semi-axis is",
            vertical_um,
        )
        return replace(ball, radius_um=radius_um, aspect_ratio=vertical_um / radius_um, defect="flattened")
