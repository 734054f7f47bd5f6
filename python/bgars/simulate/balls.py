"""Balls and the bridges between them, as somebody describes them: heights above the local board."""

from __future__ import annotations

from dataclasses import dataclass

from bgars.records.renamed import renamed
from bgars.simulate.checks import at_least, number, positive, require

__all__ = ["Ball", "Bridge", "ball_name", "row_letters"]

ROW_LETTERS = "ABCDEFGHJKLMNPRTUVWY"
"""Letters of JEDEC JEP95 (SPP-010): no I, O, Q, S, X, Z."""

TOUCH_TOLERANCE = 1e-9


def row_letters(row: int) -> str:
    """Letters of a row, counted from 1.

    Examples
    --------
    >>> [row_letters(row) for row in (1, 8, 9, 20, 21, 41)]
    ['A', 'H', 'J', 'Y', 'AA', 'BA']
    """
    letters = ""
    while row > 0:
        row, place = divmod(row - 1, len(ROW_LETTERS))
        letters = ROW_LETTERS[place] + letters
    return letters


def ball_name(row: int, col: int) -> str:
    """Name of a ball; rows and columns are counted from 1, from the top left of the image.

    Examples
    --------
    >>> ball_name(9, 12)
    'J12'
    """
    return f"{row_letters(row)}{col}"


@renamed(q="aspect_ratio", flat_um="flat_top_depth_um")
@dataclass(frozen=True)
class Ball:
    """A solder ball: a spheroid with a vertical axis, cut off by the board and perhaps by a flat top.

    Attributes
    ----------
    x_um, y_um : float
        Centre.
    radius_um : float
        Horizontal semi-axis.
    centre_z_um : float
        Height of the centre above the board under it, ``aspect_ratio radius_um`` at most: the ball touches its board.
    aspect_ratio : float
        Vertical over horizontal semi-axis; 1 = sphere.
    flat_top_depth_um : float
        Height cut off the top by a horizontal plane.
    name : str
        Such as "B3".
    row, col : int
        Counted from 1, from the top left of the image.
    x_nominal_um, y_nominal_um : float or None
        Where it should be; its own place by default.
    present : bool
        False for a missing ball.
    defect : str
        "none", "missing", "offset", "undersized", "oversized", "flattened", "clipped", "bridged".

    Raises
    ------
    InputError
        A size out of range, a ball that floats above its board or is buried in it.

    Examples
    --------
    >>> Ball(0.0, 0.0, radius_um=300.0, centre_z_um=200.0).top_um
    500.0
    """

    x_um: float
    y_um: float
    radius_um: float
    centre_z_um: float
    aspect_ratio: float = 1.0
    flat_top_depth_um: float = 0.0
    name: str = "A1"
    row: int = 1
    col: int = 1
    x_nominal_um: float | None = None
    y_nominal_um: float | None = None
    present: bool = True
    defect: str = "none"

    def __post_init__(self) -> None:
        field = f"ball {self.name}: "
        for name in ("x_um", "y_um", "centre_z_um"):
            number(field + name, getattr(self, name))
        positive(field + "radius_um", self.radius_um)
        positive(field + "aspect_ratio", self.aspect_ratio)
        at_least(field + "flat_top_depth_um", self.flat_top_depth_um, 0.0)
        for name in ("x_nominal_um", "y_nominal_um"):
            if getattr(self, name) is not None:
                number(field + name, getattr(self, name))
        semi_axis_um = self.aspect_ratio * self.radius_um
        require(
            self.centre_z_um <= semi_axis_um * (1.0 + TOUCH_TOLERANCE),
            field + "centre_z_um",
            f"must not be above its vertical semi-axis ({semi_axis_um:g}), or the ball floats above the board",
            float(self.centre_z_um),
        )
        require(
            self.flat_top_depth_um < semi_axis_um,
            field + "flat_top_depth_um",
            f"must be below {semi_axis_um:g} (the equator)",
            self.flat_top_depth_um,
        )
        require(self.top_um > 0, field + "centre_z_um", "must leave the top above the board; the top is", self.top_um)

    @property
    def top_um(self) -> float:
        """Height of the top above the board under it."""
        return self.centre_z_um + self.aspect_ratio * self.radius_um - self.flat_top_depth_um


@dataclass(frozen=True)
class Bridge:
    """Solder that joins two balls: a cylinder between their centres.

    Attributes
    ----------
    first, second : str
        Names of the balls.
    radius_um : float
        Radius of the cylinder; its ends must lie inside the balls.
    z_um : float or None
        Height of its axis above the board; the balls' mean centre height by default.

    Raises
    ------
    InputError
        A radius out of range, or a ball joined to itself.
    """

    first: str
    second: str
    radius_um: float = 150.0
    z_um: float | None = None

    def __post_init__(self) -> None:
        positive("bridge.radius_um", self.radius_um)
        require(self.first != self.second, "bridge", "must join two different balls", f"{self.first} twice")
        if self.z_um is not None:
            positive("bridge.z_um", self.z_um)
