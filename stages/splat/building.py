"""A splat out of views that arrive by their stamps; the core of `splat build`, without its files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.rigid_motion import fraction
from scenewright.stages.splat.trainer import Trainer
from scenewright.stages.splat.views import PosedView

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
            trainer.add_view(waiting.pop(0).view, last=not waiting)
        if trainer.steps >= end:
            break
        yield trainer.step()


def carried_poses(trainer: Trainer, given: Sequence[tuple[int, np.ndarray]]) -> list[tuple[int, np.ndarray]]:
    """Return (frame, world_from_camera) of the frames given with their poses, each moved in the world as the learned
    views before and after it in the sequence were moved, by its share of the way between them."""
    learned = sorted(trainer.views, key=lambda each: each.view.frame)
    frames = np.array([each.view.frame for each in learned])
    changes = [inverse(each.camera_from_world) @ each.view.camera_from_world for each in learned]
    result = []
    for frame, pose in given:
        after = int(np.clip(np.searchsorted(frames, frame), 1, max(len(frames) - 1, 1)))
        before = after - 1
        change = changes[before]
        if len(frames) > 1:
            share = np.clip((frame - frames[before]) / (frames[after] - frames[before]), 0.0, 1.0)
            # The motion of the camera itself from where the change before it alone would have put it.
            remaining_motion = inverse(change @ pose) @ changes[after] @ pose
            result.append((frame, change @ pose @ fraction(remaining_motion, float(share))))
        else:
            result.append((frame, change @ pose))
    return result


def placed_poses(trainer: Trainer, views: Sequence[PosedView]) -> list[tuple[int, np.ndarray]]:
    """Return (frame, world_from_camera) of pictures that were not learned: where the learned ones carry them, and,
    where poses are adjusted, aligned with these by depth and colour, never with what the Gaussians show."""
    carried = carried_poses(trainer, [(view.frame, inverse(view.camera_from_world)) for view in views])
    if not trainer.adjust_every:
        return carried
    learned = [each.view for each in trainer.views]
    poses = np.array([inverse(each.camera_from_world) for each in trainer.views])
    return [
        (frame, trainer.adjustment.placed(view, guess, learned, poses))
        for view, (frame, guess) in zip(views, carried, strict=True)
    ]
