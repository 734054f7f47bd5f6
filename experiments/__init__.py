"""The paper's experiments: every figure a command, a picture and a table.

Simulates, estimates, integrates and compares. ``python -m experiments`` at the top of the repository runs it,
docs/experiments.md shows it.
"""

from experiments.outcome import Experiment, Outcome, Picture, Run
from experiments.registry import EXPERIMENTS
from experiments.write import write_experiments

__all__ = ["EXPERIMENTS", "Experiment", "Outcome", "Picture", "Run", "write_experiments"]
