"""Units as pages and pictures write them: µm, where plain text, CSV and JSON say um."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["with_micro"]

MICROMETRES = re.compile(r"(?<=[0-9)] )um\b")


def with_micro(value: Any) -> Any:  # noqa: ANN401 - whatever a result holds
    """The same with µm after every number in reasons, warnings and other texts; keys stay.

    Examples
    --------
    >>> with_micro({"reason": "warpage 12.0 um (at most 10 um)", "warpage_um": 12.0})
    {'reason': 'warpage 12.0 µm (at most 10 µm)', 'warpage_um': 12.0}
    """
    if isinstance(value, str):
        return MICROMETRES.sub("µm", value)
    if isinstance(value, dict):
        return {key: with_micro(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(with_micro(entry) for entry in value)
    return value
