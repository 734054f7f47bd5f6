"""A scene: a board, balls on it, bridges between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.records.short import Short
from bgars.simulate.array import Jitter, array_balls
from bgars.simulate.balls import Ball, Bridge
from bgars.simulate.board import Board
from bgars.simulate.checks import positive, require

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from bgars.simulate.defects import Defect

__all__ = ["Scene"]

MAX_BALLS = 32_767


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Short):
    """What the camera looks at; make one with :meth:`plane`, :meth:`hemisphere`, :meth:`ball` or :meth:`ball_array`.

    Attributes
    ----------
    balls : tuple of Ball
        In reading order.
    bridges : tuple of Bridge
        Solder between balls.
    board : Board
        What they stand on.
    size_um : (float, float)
        Width and height that a camera without a shape of its own frames, centred on the origin.

    Raises
    ------
    InputError
        Balls of the same name, balls whose silhouettes overlap without a bridge, a bridge whose ends stick out.
    """

    balls: tuple[Ball, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    board: Board = field(default_factory=Board)
    size_um: tuple[float, float] = (2000.0, 2000.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "balls", tuple(self.balls))
        object.__setattr__(self, "bridges", tuple(self.bridges))
        positive("scene.size_um[0]", self.size_um[0])
        positive("scene.size_um[1]", self.size_um[1])
        count = len(self.balls)
        require(count <= MAX_BALLS, "scene.balls", f"must be {MAX_BALLS} or fewer (labels are int16)", count)
        names = [ball.name for ball in self.balls]
        twice = sorted({name for name in names if names.count(name) > 1}) if len(set(names)) < len(names) else []
        require(not twice, "scene.balls", "must have different names", ", ".join(twice))
        _check_bridges(self.balls, self.bridges)
        _check_overlaps(self.balls, self.bridges)

    @classmethod
    def plane(cls, *, size_um: tuple[float, float] = (2000.0, 2000.0), board: Board | None = None) -> Scene:
        """An empty board."""
        return cls(board=board or Board(), size_um=size_um)

    @classmethod
    def hemisphere(
        cls, radius_um: float = 300.0, *, x_um: float = 0.0, y_um: float = 0.0, board: Board | None = None
    ) -> Scene:
        """A ball cut at its equator by the board; the shape of the paper's sweeps.

        Examples
        --------
        >>> Scene.hemisphere(900.0).balls[0].top_um
        900.0
        """
        ball = Ball(x_um, y_um, radius_um=radius_um, centre_z_um=0.0)
        return cls((ball,), board=board or Board(), size_um=_frame_um([ball]))

    @classmethod
    def ball(
        cls,
        diameter_um: float = 600.0,
        *,
        height_um: float = 500.0,
        x_um: float = 0.0,
        y_um: float = 0.0,
        defect: Defect | None = None,
        board: Board | None = None,
    ) -> Scene:
        """One truncated ball: its top is `height_um` above the board, at most its diameter.

        Raises
        ------
        InputError
            A ball that floats (height above diameter) or that is buried.

        Examples
        --------
        >>> Scene.ball(600.0, height_um=500.0).balls[0].centre_z_um
        200.0
        """
        positive("diameter_um", diameter_um)
        positive("height_um", height_um)
        ball = Ball(x_um, y_um, radius_um=diameter_um / 2, centre_z_um=height_um - diameter_um / 2)
        ball = ball if defect is None else defect.applied(ball)
        return cls((ball,), board=board or Board(), size_um=_frame_um([ball]))

    @classmethod
    def ball_array(
        cls,
        rows: int,
        cols: int,
        *,
        pitch_um: float = 1000.0,
        diameter_um: float = 600.0,
        height_um: float = 500.0,
        centre_um: tuple[float, float] = (0.0, 0.0),
        rotation_deg: float = 0.0,
        jitter: Jitter | None = None,
        defects: Mapping[str, Defect] | None = None,
        bridges: Sequence[Bridge] = (),
        seed: int = 0,
        board: Board | None = None,
    ) -> Scene:
        """A grid of truncated balls, row A at the top of the image, column 1 at the left.

        Parameters
        ----------
        rows, cols : int
            Size of the grid.
        pitch_um : float
            Distance of neighbours.
        diameter_um, height_um : float
            Of a nominal ball; height = top above the board.
        centre_um : (float, float)
            Centre of the grid.
        rotation_deg : float
            Counter-clockwise as seen in the image.
        jitter : Jitter, optional
            Random spread of heights, radii and positions.
        defects : mapping, optional
            Name to :class:`bgars.Defect`, applied after the jitter.
        bridges : sequence of Bridge
            Bridged balls may overlap each other.
        seed : int
            Of the jitter.
        board : Board, optional
            Flat, matte and dark by default.

        Raises
        ------
        InputError
            An impossible size, an unknown name, balls that overlap, float or are buried.

        Examples
        --------
        >>> import bgars
        >>> scene = Scene.ball_array(4, 4, defects={"B2": bgars.Defect.missing()})
        >>> [ball.name for ball in scene.balls if not ball.present]
        ['B2']
        """
        balls = array_balls(
            rows,
            cols,
            pitch_um=pitch_um,
            diameter_um=diameter_um,
            height_um=height_um,
            centre_um=centre_um,
            rotation_deg=rotation_deg,
            jitter=jitter or Jitter(),
            seed=seed,
        )
        for name, defect in (defects or {}).items():
            places = [index for index, ball in enumerate(balls) if ball.name == name]
            require(bool(places), "scene.defects", f"must name balls of the {rows} x {cols} array", repr(name))
            balls[places[0]] = defect.applied(balls[places[0]])
        joined = {name for bridge in bridges for name in (bridge.first, bridge.second)}
        balls = [
            replace(ball, defect="bridged") if ball.name in joined and ball.defect == "none" else ball for ball in balls
        ]
        return cls(tuple(balls), tuple(bridges), board or Board(), _frame_um(balls))


def _frame_um(balls: Sequence[Ball]) -> tuple[float, float]:
    """Width and height around the origin that hold the balls and the shadows of a light at 45 degrees."""
    margins = [1.5 * ball.radius_um + max(ball.centre_z_um, 0.0) for ball in balls]
    reach_x = max(abs(ball.x_um) + margin for ball, margin in zip(balls, margins, strict=True))
    reach_y = max(abs(ball.y_um) + margin for ball, margin in zip(balls, margins, strict=True))
    return 2.0 * reach_x, 2.0 * reach_y


def _check_bridges(balls: tuple[Ball, ...], bridges: tuple[Bridge, ...]) -> None:
    by_name = {ball.name: ball for ball in balls if ball.present}
    for bridge in bridges:
        pair = f"bridge {bridge.first}-{bridge.second}"
        for name in (bridge.first, bridge.second):
            require(name in by_name, pair, "must join balls that are present", name)
        ends = [by_name[bridge.first], by_name[bridge.second]]
        length_um = math.dist(*((ball.x_um, ball.y_um) for ball in ends))
        require(length_um > 0, pair, "must join balls at different places; their distance is", length_um)
        z_um = bridge.z_um if bridge.z_um is not None else (ends[0].centre_z_um + ends[1].centre_z_um) / 2
        for ball in ends:
            room_um = min(ball.radius_um, ball.aspect_ratio * ball.radius_um) - abs(z_um - ball.centre_z_um)
            room_um = min(room_um, ball.top_um - z_um)
            rule = f"must end inside ball {ball.name}, where its radius may be {room_um:g}"
            require(bridge.radius_um <= room_um, f"{pair}.radius_um", rule, bridge.radius_um)


def _check_overlaps(balls: tuple[Ball, ...], bridges: tuple[Bridge, ...]) -> None:
    present = [ball for ball in balls if ball.present]
    joined = {frozenset((bridge.first, bridge.second)) for bridge in bridges}
    places = np.array([(ball.x_um, ball.y_um) for ball in present]).reshape(-1, 2)
    radii = np.array([ball.radius_um for ball in present])
    for index, ball in enumerate(present):
        distances = np.hypot(*(places[index + 1 :] - places[index]).T)
        for near in np.flatnonzero(distances < (radii[index + 1 :] + radii[index]) * (1.0 - 1e-12)):
            other = present[index + 1 + int(near)]
            if frozenset((ball.name, other.name)) not in joined:
                rule = (
                    f"balls {ball.name} and {other.name} overlap: without a bridge their distance must be at least "
                    f"{ball.radius_um + other.radius_um:g} um"
                )
                require(False, "scene.balls", rule, float(distances[near]))
