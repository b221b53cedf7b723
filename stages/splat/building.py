"""A splat out of views that arrive by their stamps; the core of `splat build`, without its files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stages.kit.geometry.transforms import inverse
from stages.splat.training import Trainer
from stages.splat.views import PosedView

LAST = 100
"""Steps over which the loss is told."""


@dataclass(frozen=True)
class Arrival:
    """A view and the step of training before which it arrives."""

    step: int
    view: PosedView


def arrivals(views: Sequence[PosedView], steps_per_second: float) -> list[Arrival]:
    """Return when the views, ascending in time, arrive."""
    return [Arrival(int((view.time - views[0].time) * steps_per_second), view) for view in views]


def train(trainer: Trainer, arriving: Sequence[Arrival], steps: int) -> Iterator[float]:
    """Train while views arrive and `steps` steps after the last; yield the loss of every step. A trainer that has views
    goes on with those that follow."""
    waiting = list(arriving[len(trainer.views) :])
    end = (arriving[-1].step if arriving else 0) + steps
    while trainer.steps < end or waiting:
        while waiting and waiting[0].step <= trainer.steps:
            trainer.add_view(waiting.pop(0).view)
        if trainer.steps >= end:
            break
        yield trainer.step()


def carried_poses(trainer: Trainer, given: Sequence[tuple[int, np.ndarray]]) -> list[tuple[int, np.ndarray]]:
    """Return (frame, world_from_camera) of the frames given with their poses, each moved in the world as the learned
    view nearest in the sequence was moved."""
    learned = sorted(trainer.views, key=lambda each: each.view.frame)
    frames = np.array([each.view.frame for each in learned])
    result = []
    for frame, pose in given:
        nearest = learned[int(np.abs(frames - frame).argmin())]
        change = inverse(nearest.camera_from_world) @ nearest.view.camera_from_world
        result.append((frame, change @ pose))
    return result
