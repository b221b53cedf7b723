"""What the left camera sees of a trial of `ours`, with every estimate drawn in.

A picture for every state that was looked at (the needle or a driver has moved), six seconds each.
"""

from __future__ import annotations

from contextlib import suppress

import cv2
import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.suture import (
    ARC_POINTS,
    PICTURED_FROM_TRIAL,
    POLICIES,
    TWO_CAMERAS,
    LookingEyes,
    Seen,
    perception_model,
    run_trial,
)
from scenewright.stages.suture.trials.perception import FOLDER

ACROSS, STATES, SHOWN = 3, 9, (640, 480)
YELLOW, WHITE = (60, 220, 250), (255, 255, 255)
NEAR = 150
"""The needle's surroundings are shown twice as large beside it: so many pixels of the picture each way."""


class EnoughError(Exception):
    """As many states as were asked for have been seen."""


class DrawingEyes(LookingEyes):
    """Keeps the first look at each state as a picture (480, 640, 3) uint8 BGR."""

    def __init__(self, seed: int, states: int) -> None:
        super().__init__(perception_model(FOLDER / "perception_ours.toml"), seed, pictures=True)
        self.states = states
        self.drawn: list[np.ndarray] = []
        self._last: object = None

    def look(self, needle: np.ndarray, place: str) -> Seen | None:
        """Look, and draw what is seen where it is seen for the first time. Raises EnoughError."""
        seen = super().look(needle, place)
        if self._view is not self._last and self._view is not None:
            self._last = self._view
            assert self._view.left.image is not None
            self.drawn.append(self._draw(self._view.left.image, seen, needle, place))
        if len(self.drawn) >= self.states:
            raise EnoughError
        return seen

    def _draw(self, image: np.ndarray, seen: Seen | None, needle: np.ndarray, place: str) -> np.ndarray:
        picture = np.ascontiguousarray(image[:, :, ::-1])
        camera_from_trial = self._world.camera_from_world @ PICTURED_FROM_TRIAL
        middle = TWO_CAMERAS.left(apply(camera_from_trial @ needle, np.zeros((1, 3))))[0]
        if seen is not None:
            arc = TWO_CAMERAS.left(apply(camera_from_trial @ seen.pose, ARC_POINTS))
            cv2.polylines(picture, [np.round(8 * arc).astype(np.int32)], False, YELLOW, 1, cv2.LINE_AA, 3)
            tip = TWO_CAMERAS.left(apply(camera_from_trial, seen.tip[None]))[0]
            cv2.circle(picture, np.round(8 * tip).astype(int).tolist(), 8 * 5, YELLOW, 1, cv2.LINE_AA, 3)
        column = int(np.clip(middle[0] - NEAR, 0, picture.shape[1] - 2 * NEAR))
        row = int(np.clip(middle[1] - NEAR // 2, 0, picture.shape[0] - NEAR))
        near = cv2.resize(picture[row : row + NEAR, column : column + 2 * NEAR], (SHOWN[0] // 2, SHOWN[0] // 4))
        small = cv2.resize(picture, SHOWN, interpolation=cv2.INTER_AREA)
        small[: near.shape[0], : near.shape[1]] = near
        cv2.rectangle(small, (0, 0), (near.shape[1], near.shape[0]), WHITE, 1)
        told = place.replace("_", " ") + ("" if seen is not None else ": abstained")
        cv2.putText(small, told, (10, SHOWN[1] - 14), cv2.FONT_HERSHEY_SIMPLEX, 0.6, WHITE, 1, cv2.LINE_AA)
        return small


def drawn_looks(seed: int) -> np.ndarray:
    """Return the first looks of a trial of ours (480 a row, 640 a column, 3) uint8 BGR."""
    eyes = DrawingEyes(seed, STATES)
    with suppress(EnoughError):
        run_trial(POLICIES["ours"], seed, eyes=eyes)
    blank = [np.zeros_like(eyes.drawn[0])] * (-len(eyes.drawn) % ACROSS)
    cells = [*eyes.drawn, *blank]
    return np.vstack([np.hstack(cells[start : start + ACROSS]) for start in range(0, len(cells), ACROSS)])
