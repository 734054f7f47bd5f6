"""What a record shows of itself: one line, a thumbnail in a notebook, a plot."""

from __future__ import annotations

import io
import math
from base64 import b64encode
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.records.plain_arrays import plain
from bgars.records.short import Short, facts_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray
    from PIL import Image

    from bgars.records.ball_result import BallResult

__all__ = ["ABSENT", "VERDICT_COLORS", "ShownCapture", "ShownField", "ShownHeight", "ShownPart", "counted"]

VERDICT_COLORS = {"pass": "#56B4E9", "fail": "#D55E00", "undecided": "#E69F00"}
"""Okabe and Ito, Color universal design, 2008: told apart by colour-blind readers."""
ABSENT = {"fail": "missing", "undecided": "place not clear"}
"""What a place without a ball is, by its verdict: seen to be empty, or not."""
THUMBNAIL_PX = 320


def counted(balls: Sequence[BallResult]) -> list[str]:
    """How many balls pass, fail, ..., in words; nothing of what there is none of."""
    states = [ball.verdict if ball.present else ABSENT[ball.verdict] for ball in balls]
    known = [(name, states.count(name)) for name in (*VERDICT_COLORS, *ABSENT.values()) if name in states]
    return [f"{count} {name if count == 1 else name.replace('place', 'places')}" for name, count in known]


class Shown(Short):
    """A record that is shown by a few facts and a picture."""

    def _picture(self) -> Image.Image:
        raise NotImplementedError

    def _repr_html_(self) -> str:
        """A table of the facts beside a thumbnail, for notebooks."""
        file = io.BytesIO()
        self._picture().save(file, "png")
        source = f"data:image/png;base64,{b64encode(file.getvalue()).decode('ascii')}"
        table = facts_table(type(self).__name__, self._facts())
        return f"<div style='display:flex;gap:1em;align-items:center'><img src='{source}' alt=''>{table}</div>"


class ShownCapture(Shown):
    """A capture shows one of its images."""

    def _facts(self) -> dict[str, object]:
        capture: Any = self
        lights, height, width = capture.images.shape[:3]
        return {
            "name": repr(capture.name),
            "lights": lights,
            "size": f"{width} x {height} px",
            "dtype": capture.images.dtype,
            "pitch": _pitch(capture.pixel_pitch_um),
            "rig": "near" if capture.rig.is_near else "distant",
        }

    def _picture(self) -> Image.Image:
        capture: Any = self
        return _grey(_thinned(capture.images[0]))

    def plot(self, light: int = 0, *, axes: Axes | None = None) -> Axes:
        """Draw the image of a light (from 0; -1 is the last); returns matplotlib's axes."""
        capture: Any = self
        lights = len(capture.images)
        if isinstance(light, bool) or not isinstance(light, (int, np.integer)) or not -lights <= light < lights:
            msg = f"light: must be a whole number from 0 to {lights - 1}, got {light!r}"
            raise InputError(msg)
        return _plot(axes, capture.images[light], f"{capture.name}, light {light}", cmap="gray")


class ShownField(Shown):
    """Normals show as colours: red = x right, green = y up, blue = z to the camera."""

    def _facts(self) -> dict[str, object]:
        field: Any = self
        height, width = field.mask.shape
        valid = int(np.count_nonzero(field.mask))
        measured = int(np.count_nonzero(field.is_measured & field.mask))
        return {
            "size": f"{width} x {height} px",
            "method": repr(field.method),
            "valid": f"{_percent(valid, field.mask.size)}",
            "measured": f"{_percent(measured, valid)} of them",
        }

    def _colors(self, step: int = 1) -> NDArray[np.float32]:
        field: Any = self
        normals = field.normals[::step, ::step]
        colors: NDArray[np.float32] = np.where(np.isfinite(normals), (normals + 1.0) / 2.0, 1.0).astype(np.float32)
        return colors

    def _picture(self) -> Image.Image:
        field: Any = self
        return _image(self._colors(_step(field.mask.shape)))

    def relight(self, direction: ArrayLike) -> NDArray[np.float32]:
        """Return the surface as a matt one looks under a distant light: albedo times the cosine, 0 in the dark.

        Parameters
        ----------
        direction : (3,) floating
            To the light; x right, y up, z toward the camera; of any length.

        Returns
        -------
        (H, W) float32
            1 = full scale of the camera under a light of the rig's mean strength; NaN where there is no normal. The
            surface casts no shadows and mirrors nothing.

        Raises
        ------
        InputError
            Not three finite numbers, or all 0.

        Examples
        --------
        >>> import bgars, numpy as np
        >>> images = np.full((3, 2, 2), 100, np.uint8)
        >>> field = bgars.estimate_normals(images, bgars.LightRig.ring(3).directions, method="lambertian")
        >>> bool(np.allclose(field.relight([0, 0, 2]), field.albedo))
        True
        """
        field: Any = self
        to_light = plain("direction", direction, np.float64)
        length = float(np.linalg.norm(to_light)) if to_light.shape == (3,) else 0.0
        if not (math.isfinite(length) and length > 0):
            msg = f"direction: must be three finite numbers, not all 0; got {direction!r}"
            raise InputError(msg)
        cosine = field.normals @ (to_light / length).astype(np.float32)
        lit: NDArray[np.float32] = field.albedo * np.maximum(cosine, np.float32(0.0))
        return lit

    def plot(self, *, axes: Axes | None = None) -> Axes:
        """Draw the normals as colours; returns matplotlib's axes."""
        return _plot(axes, self._colors(), "normals: red = x right, green = y up, blue = z")


class ShownHeight(Shown):
    """A height map shows as colours of its heights."""

    def _facts(self) -> dict[str, object]:
        height: Any = self
        rows, cols = height.mask.shape
        known = height.height[height.mask]
        span = f"{known.min():.4g} to {known.max():.4g} {height.unit}" if known.size else "nothing known"
        return {
            "size": f"{cols} x {rows} px",
            "pitch": _pitch(height.pixel_pitch_um),
            "height": span,
            "components": len(height.components),
        }

    def _picture(self) -> Image.Image:
        height: Any = self
        values = _thinned(height.height)
        known = values[np.isfinite(values)]
        low, high = np.percentile(known, (0.5, 99.5)) if known.size else (0.0, 1.0)
        level = np.clip((values - low) / max(float(high - low), 1e-12), 0.0, 1.0)[..., None]
        dark, bright = np.array([0.0, 0.13, 0.31]), np.array([1.0, 0.91, 0.22])
        return _image(np.where(np.isfinite(level), dark + (bright - dark) * np.nan_to_num(level), 1.0))

    def plot(self, *, axes: Axes | None = None) -> Axes:
        """Draw the heights with a colour bar; returns matplotlib's axes."""
        height: Any = self
        rows, cols = (side * (height.pixel_pitch_um or 1.0) / 2 for side in height.mask.shape)
        unit = "µm" if height.unit == "um" else "px"
        extent = (-cols, cols, -rows, rows)
        drawn = _plot(axes, height.height, f"height ({unit})", cmap="cividis", extent=extent)
        drawn.set_xlabel(f"x ({unit})")
        drawn.set_ylabel(f"y ({unit})")
        drawn.figure.colorbar(drawn.images[-1], ax=drawn)
        return drawn


class ShownPart(Shown):
    """A judged part shows its balls in the colours of their verdicts."""

    def _facts(self) -> dict[str, object]:
        part: Any = self
        counts = counted(part.balls)
        coplanarity = part.seating_coplanarity_um
        return {
            "name": repr(part.name),
            "verdict": part.verdict,
            "balls": f"{len(part.balls)} ({', '.join(counts)})" if counts else 0,
            "seating_coplanarity": f"{coplanarity:.2f} um" if math.isfinite(coplanarity) else "not measured",
        }

    def _discs(self) -> list[tuple[float, float, float, Any]]:
        """Place, radius and ball of every ball that has a place; um."""
        part: Any = self
        known = [ball.diameter_um for ball in part.balls if math.isfinite(ball.diameter_um)]
        typical = float(np.median(known)) if known else 10.0 * part.pixel_pitch_um
        found = []
        for ball in part.balls:
            at = (ball.x_um, ball.y_um) if math.isfinite(ball.x_um) else (ball.x_nominal_um, ball.y_nominal_um)
            if all(map(math.isfinite, at)):
                diameter = ball.diameter_um if math.isfinite(ball.diameter_um) else typical
                found.append((*at, diameter / 2, ball))
        return found

    def _picture(self) -> Image.Image:
        from PIL import Image, ImageDraw  # noqa: PLC0415 - where something is shown

        discs = self._discs()
        if not discs:
            return Image.new("RGB", (THUMBNAIL_PX // 4,) * 2, "white")
        x, y, radius = (np.array([disc[at] for disc in discs]) for at in range(3))
        low_x, top_y = (x - 1.5 * radius).min(), (y + 1.5 * radius).max()
        wide, tall = (x + 1.5 * radius).max() - low_x, top_y - (y - 1.5 * radius).min()
        scale = 2 * THUMBNAIL_PX / max(wide, tall)
        image = Image.new("RGB", (max(2, int(wide * scale)), max(2, int(tall * scale))), "white")
        draw = ImageDraw.Draw(image)
        for at_x, at_y, r, ball in discs:
            box = [(at_x - r - low_x) * scale, (top_y - at_y - r) * scale, (at_x + r - low_x) * scale]
            color = VERDICT_COLORS[ball.verdict]
            draw.ellipse(
                (*box, (top_y - at_y + r) * scale), fill=color if ball.present else None, outline=color, width=4
            )
        return image.reduce(2)

    def plot(self, *, axes: Axes | None = None) -> Axes:
        """Draw every ball in the colour of its verdict, open where there is none; returns matplotlib's axes."""
        from matplotlib.patches import Circle  # noqa: PLC0415 - the extra "report"

        drawn = _axes(axes)
        for x, y, radius, ball in self._discs():
            look = {"edgecolor": VERDICT_COLORS[ball.verdict], "linewidth": 2.0}
            face = VERDICT_COLORS[ball.verdict] if ball.present else "none"
            drawn.add_patch(Circle((x, y), radius, facecolor=face, alpha=0.8, **look))
            drawn.text(x, y, ball.name, ha="center", va="center", fontsize=8)
        drawn.autoscale_view()
        part: Any = self
        drawn.set(aspect="equal", title=f"{part.name}: {part.verdict}", xlabel="x (µm)", ylabel="y (µm)")
        return drawn


def _pitch(pixel_pitch_um: float | None) -> str:
    return "unknown" if pixel_pitch_um is None else f"{pixel_pitch_um:g} um"


def _percent(part: int, whole: int) -> str:
    return f"{100.0 * part / max(whole, 1):.1f} %"


def _step(shape: tuple[int, ...]) -> int:
    return max(1, math.ceil(max(shape[:2]) / THUMBNAIL_PX))


def _thinned(values: NDArray[Any]) -> NDArray[np.float32]:
    step = _step(values.shape)
    return values[::step, ::step].astype(np.float32)


def _image(colors: NDArray[np.floating]) -> Image.Image:
    from PIL import Image  # noqa: PLC0415 - where something is shown

    return Image.fromarray(np.rint(255.0 * np.clip(colors, 0.0, 1.0)).astype(np.uint8))


def _grey(values: NDArray[np.float32]) -> Image.Image:
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, (0.5, 99.5)) if known.size else (0.0, 1.0)
    return _image(np.sqrt(np.clip(np.nan_to_num((values - low) / max(float(high - low), 1e-12)), 0.0, 1.0)))


def _axes(axes: Axes | None) -> Axes:
    if axes is not None:
        return axes
    from matplotlib import pyplot as plt  # noqa: PLC0415 - the extra "report"

    return plt.subplots()[1]


def _plot(axes: Axes | None, values: NDArray[Any], title: str, **look: Any) -> Axes:  # noqa: ANN401
    drawn = _axes(axes)
    drawn.imshow(values, **look)
    drawn.set_title(title)
    return drawn
