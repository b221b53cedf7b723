"""A segmentation backend out of the true instances of a rendered picture, with the kit's persistent errors."""

from __future__ import annotations

import numpy as np

from stages.agent.world.physics.eyes import Mask
from stages.agent.world.physics.room import Room
from stages.kit.rendering.object_views import LEAST_PIXELS, Picture
from stages.kit.rendering.segmenter_errors import SegmenterErrors


class NoisyOracle:
    """Things of a picture, missed or taken for others for good from a region of views."""

    def __init__(self, room: Room, errors: SegmenterErrors) -> None:
        self._room, self._errors = room, errors
        self.missed: set[str] = set()
        """Things that were in a picture and are not among its masks."""

    def furniture(self, picture: Picture, map_from_camera: np.ndarray) -> list[Mask]:
        """Return the masks of furniture, without errors."""
        names = {int(number): self._room.named.get(int(number), "") for number in np.unique(picture.instance)}
        return [
            Mask(self._room.furniture[name].label, picture.instance == number)
            for number, name in names.items()
            if name in self._room.furniture
        ]

    def masks(self, picture: Picture, map_from_camera: np.ndarray, view: tuple[object, ...]) -> list[Mask]:
        """Return the masks of things. `view`: ("hand", number), or (quarter turn, near)."""
        found = []
        for number in np.unique(picture.instance):
            name = self._room.named.get(int(number), "")
            mask = picture.instance == number
            if name not in self._room.things or mask.sum() < LEAST_PIXELS:
                continue
            if view[0] != "hand" and self._errors.misses(
                name, self._room.moved[name], int(str(view[0])), bool(view[1])
            ):
                self.missed.add(name)
                continue
            found.append(Mask(self._errors.class_of(name, self._room.things[name].label, *view), mask))
        return found
