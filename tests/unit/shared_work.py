"""Work that tests on several workers need, done by the first of them."""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Callable
from typing import TypeVar

import pytest

Made = TypeVar("Made")
FAILED = "failed"


def shared(factory: pytest.TempPathFactory, name: str, make: Callable[[], Made]) -> Made:
    """Return what `make()` returns: of the workers of a run one makes it, the others wait for it and read it.

    The time limit of their tests ends the wait, should that worker be killed.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return make()
    place = factory.getbasetemp().parent / f"{name}.pickle"
    claim = place.with_suffix(".claim")
    try:
        claim.touch(exist_ok=False)
    except FileExistsError:
        while not place.exists():
            if claim.read_text(encoding="utf-8") == FAILED:
                return make()  # it fails here, too, and says why
            time.sleep(0.1)
        return pickle.loads(place.read_bytes())  # type: ignore[no-any-return]
    try:
        made = make()
    except BaseException:
        claim.write_text(FAILED, encoding="utf-8")
        raise
    partial = place.with_suffix(".partial")
    partial.write_bytes(pickle.dumps(made))
    partial.rename(place)
    return made
