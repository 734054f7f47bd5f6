"""Float TIFF files of bgars: each says in its description, as JSON, what it holds."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import tifffile

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.records.pixels import FloatArray

__all__ = ["OWN", "description_of", "write_described"]

OWN = "bgars "
"""What the content of every file of ours begins with."""


def write_described(path: Path, values: FloatArray, content: str, **fields: Any) -> None:  # noqa: ANN401 - JSON
    """Write a float32 image and what it is: `content`, without the name of bgars, and fields that JSON can hold."""
    description = json.dumps({"content": OWN + content, **fields})
    photometric = "rgb" if values.ndim == len(("row", "col", "channel")) else None
    image = np.ascontiguousarray(values, dtype=np.float32)
    tifffile.imwrite(path, image, description=description, metadata=None, photometric=photometric)


def description_of(tiff: tifffile.TiffFile) -> dict[str, Any]:
    """The fields of a description; empty where it is none of ours or of our like."""
    try:
        fields = json.loads(tiff.pages.first.description)
    except json.JSONDecodeError:
        return {}
    return fields if isinstance(fields, dict) else {}
