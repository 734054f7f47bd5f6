"""The experiments, in the order of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.errors import InputError

from experiments.input_images import FIG3
from experiments.kept import KEPT
from experiments.meshes import FIG4, FIG6
from experiments.profiles import FIG10, FIG11, FIG12
from experiments.rank_plot import FIG5
from experiments.reference import REFERENCE
from experiments.strips import FIG7, FIG8, FIG9
from experiments.sweeps import ELEVATION, LIGHTS, NOISE
from experiments.threshold import THRESHOLD

if TYPE_CHECKING:
    from experiments.outcome import Experiment

__all__ = ["ALL", "EXPERIMENTS", "chosen"]

ALL = "all"
EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        REFERENCE,
        FIG3,
        FIG4,
        FIG5,
        FIG6,
        FIG7,
        FIG8,
        FIG9,
        FIG10,
        FIG11,
        FIG12,
        KEPT,
        THRESHOLD,
        LIGHTS,
        ELEVATION,
        NOISE,
    )
}


def chosen(name: str) -> list[Experiment]:
    """The experiment of a name, or all of them.

    Raises
    ------
    InputError
        An unknown name; the message lists those there are.

    Examples
    --------
    >>> [experiment.name for experiment in chosen("fig5")]
    ['fig5']
    """
    if name == ALL:
        return list(EXPERIMENTS.values())
    if name not in EXPERIMENTS:
        msg = f"experiment: must be one of {ALL}, {', '.join(EXPERIMENTS)}; got {name!r}"
        raise InputError(msg)
    return [EXPERIMENTS[name]]
