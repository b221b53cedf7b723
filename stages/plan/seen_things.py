"""Small things as looks from near by show them: the planned shape in the size that fits, with what sticks out of it."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.simulation.shapes import body_surface
from scenewright.stages.plan.scaled_body import scaled_text, shifted_text, with_boxes
from scenewright.stages.plan.sticking_out import sticking_out
from scenewright.stages.plan.thing_fit import fit_thing

POINTS = 3000
"""Points on a shape that is fitted."""


class SeenThings:
    """What looks have told of the shapes of things."""

    def __init__(self) -> None:
        self._planned: dict[str, str] = {}
        """Thing -> URDF text of the shape that it was planned with."""
        self._learned: dict[str, str] = {}
        """Thing -> the same with what stuck out of it when that was seen last, in the planned size."""
        self._middles: dict[str, np.ndarray] = {}
        """Thing -> origin of the frame that it is believed in, frame of its planned shape (3,) [m]."""

    def fitted(
        self, name: str, text: str, pose: np.ndarray, points: np.ndarray, eyes: np.ndarray
    ) -> tuple[np.ndarray, str]:
        """Return pose (4, 4) and URDF text of a thing by points (N, 3) of it that cameras at `eyes` (K, 3) saw.

        `text` and `pose` are believed of it now. Where something sticks out, the frame's origin is under the middle of
        all of it, as places and radii of feet are counted from there.
        """
        planned = self._planned.setdefault(name, text)
        believed = _moved_pose(pose, -self._middles.get(name, np.zeros(3)))
        best, shape, surface = None, planned, None
        for candidate in [planned, *([self._learned[name]] if name in self._learned else [])]:
            candidate_surface = body_surface(candidate, POINTS)
            fit = fit_thing(points, eyes, candidate_surface, believed)
            if best is None or fit.misfit < best.misfit:
                best, shape, surface = fit, candidate, candidate_surface
        assert best is not None and surface is not None
        if shape == planned:
            boxes = sticking_out(apply(inverse(best.pose), points), best.scale * surface[0])
            if boxes:
                shape = with_boxes(planned, [(center / best.scale, size / best.scale) for center, size in boxes])
                self._learned[name] = shape
        middle = np.zeros(3)
        if shape != planned:
            own_points = best.scale * body_surface(shape, POINTS)[0]
            middle[:2] = (own_points.min(axis=0) + own_points.max(axis=0))[:2] / 2
        self._middles[name] = middle
        return _moved_pose(best.pose, middle), shifted_text(scaled_text(shape, best.scale), -middle)


def _moved_pose(pose: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Return a pose (4, 4) moved by a shift (3,) of its own frame."""
    moved = pose.copy()
    moved[:3, 3] += pose[:3, :3] @ shift
    return moved
