"""What a header may claim."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.errors import FileFormatError

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["check_size"]


def check_size(path: Path, rows: int, columns: int, max_megapixels: float) -> None:
    """Raise FileFormatError for an image without pixels, or with more than `max_megapixels`."""
    if rows <= 0 or columns <= 0:
        msg = f"{path}: cannot be decoded as an image ({columns} x {rows} pixels)"
        raise FileFormatError(msg)
    megapixels = rows * columns / 1e6
    if megapixels > max_megapixels:
        msg = (
            f"{path}: the header claims {columns} x {rows} pixels = {megapixels:.0f} megapixels, "
            f"more than the limit of {max_megapixels:g} (max_megapixels)"
        )
        raise FileFormatError(msg)
