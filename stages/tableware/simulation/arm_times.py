"""What actions cost the arm in physics: the time model by which our policy plans there.

The file is written by `python -m benchmarks.tidy.physics_times` from trials on tuning seeds; it says which.
"""

from __future__ import annotations

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.places import data_file
from scenewright.stages.tableware.options import PHYSICS_TIMES
from scenewright.stages.tableware.planning.time_model import TimeModel

FILE = data_file(PHYSICS_TIMES)


class ArmTimes(Model):
    """Least squares over trials: seconds = trips x trip + stackings x stack + pulls x pull."""

    trip: float = Field(gt=0.0)
    stack: float = Field(ge=0.0)
    pull: float = Field(ge=0.0)
    residual: float
    """Standard deviation of a trial's seconds about the fit."""
    trials: int
    date: str
    commit: str
    command: str
    conditions: str


def arm_times(delay: float = 0.0) -> TimeModel:
    """Return the arm's time model with a bin that is `delay` [s] farther each way."""
    times = ArmTimes.read(FILE)
    return TimeModel(times.trip, times.stack, times.pull, delay)
