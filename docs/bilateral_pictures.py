"""The pictures of bilateral integration: a cliff, and a row of balls on their board."""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np

from experiments.style import OKABE_ITO, TRUTH_STYLE, figure_style, new_figure, panels, save, tidy

SIZE = 80
SLOPE = 0.5
STYLES = {
    "least squares": (OKABE_ITO[1], "--"),
    "bilateral": (OKABE_ITO[2], ":"),
    "least squares, anchors": (OKABE_ITO[0], "-"),
}


def draw_cliff(path: Path) -> None:
    """Two planes that no continuous surface joins: truth, both integrators' errors, and the weights."""
    row, col = np.indices((SIZE, SIZE))
    raised = col >= SIZE // 2
    y = SIZE / 2 - row - 0.5
    height = np.where(raised, SLOPE * y, 0.0)
    slope = np.where(raised, SLOPE, 0.0)
    normals = np.stack([np.zeros(row.shape), -slope, np.ones(row.shape)], axis=-1)
    normals = (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32)
    plain = bgars.integrate_normals(normals)
    fit = bgars.integrate_normals(normals, method="bilateral", k=10.0)
    assert fit.bilateral is not None

    def error(found: bgars.HeightMap) -> np.ndarray:
        """The median of each side removed: the constants of two separate planes are not in their normals."""
        off = found.height_px - height
        return off - np.where(raised, np.median(off[raised]), np.median(off[~raised]))

    limit = float(np.abs(error(plain)).max())
    with figure_style():
        figure = new_figure(9.6, 2.5)
        shown = (
            ("truth:\nheight (px)", height, "viridis", None),
            ("least squares:\nerror (px)", error(plain), "RdBu_r", (-limit, limit)),
            ("bilateral, k = 10:\nerror (px)", error(fit), "RdBu_r", (-limit, limit)),
            ("bilateral, k = 10:\nshare of the right side", fit.bilateral.rightward, "PuOr", (0.0, 1.0)),
        )
        for axes, (title, values, colors, limits) in zip(panels(figure, 1, 4)[0], shown, strict=True):
            low, high = limits or (float(values.min()), float(values.max()))
            image = axes.imshow(values, cmap=colors, vmin=low, vmax=high, interpolation="nearest")
            axes.set_title(title, fontsize=9)
            axes.set_xticks([0, SIZE // 2, SIZE - 1])
            axes.set_yticks([0, SIZE // 2, SIZE - 1])
            axes.set_xlabel("column (px)")
            figure.colorbar(image, ax=axes, shrink=0.75)
        figure.axes[0].set_ylabel("row (px)")
        save(figure, path)


def draw_profile(found: dict[str, bgars.HeightMap], truth: bgars.Truth, path: Path) -> None:
    """A cut through the first row of balls: what each method makes of it."""
    assert truth.height_um is not None
    assert truth.ball_ids is not None
    rows = np.nonzero((truth.ball_ids == 1).any(axis=1))[0]
    row = int(rows.mean())
    board = truth.ball_ids == 0
    with figure_style():
        figure = new_figure(9.6, 3.4)
        axes = panels(figure, 1, 1)[0][0]
        pitch = next(iter(found.values())).pixel_pitch_um or 1.0
        x_mm = (np.arange(truth.height_um.shape[1]) + 0.5 - truth.height_um.shape[1] / 2) * pitch / 1000
        axes.plot(x_mm, truth.height_um[row], **TRUTH_STYLE)
        for name, (color, dashes) in STYLES.items():
            height_um = found[name].height_um
            assert height_um is not None
            shift = 0.0 if "anchors" in name else float(np.median((height_um - truth.height_um)[board]))
            axes.plot(x_mm, height_um[row] - shift, color=color, linestyle=dashes, linewidth=1.4, label=name)
        axes.set_xlabel("x (mm)")
        axes.set_ylabel("height above the board (um)")
        axes.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.16), frameon=False)
        tidy(axes)
        save(figure, path)
