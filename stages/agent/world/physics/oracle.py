"""A segmentation backend out of the true instances of a rendered picture, with the kit's persistent errors."""

from __future__ import annotations

import numpy as np
from scenewright.stages.agent.world.physics.eyes import Mask
from scenewright.stages.agent.world.physics.room import Room
from scenewright.stages.kit.rendering.object_views import LEAST_PIXELS, Picture
from scenewright.stages.kit.rendering.segmenter_errors import SegmenterErrors


class NoisyOracle:
    """Things of a picture, missed or taken for others for good from a region of views."""

    def __init__(self, room: Room, errors: SegmenterErrors) -> None:
        self._room, self._errors = room, errors
        self.missed: set[str] = set()
        """What was in a picture and is not among its masks."""

    def furniture(self, picture: Picture, map_from_camera: np.ndarray) -> list[Mask]:
        """Return the masks of furniture, without errors."""
        names = {int(number): self._room.named.get(int(number), "") for number in np.unique(picture.instance)}
        owners = {number: self._room.owner(name) for number, name in names.items()}
        return [
            Mask(piece.label, np.isin(picture.instance, [number for number, owner in owners.items() if owner == name]))
            for name, piece in self._room.furniture.items()
            if name in owners.values()
        ]

    def masks(self, picture: Picture, map_from_camera: np.ndarray, view: tuple[object, ...]) -> list[Mask]:
        """Return the masks of things, handles, doors, drawers and fixtures. `view`: ("hand", number), or (quarter turn,
        near)."""
        noisy_masks = []
        for number in np.unique(picture.instance):
            name = self._room.named.get(int(number), "")
            mask = picture.instance == number
            label = self._room.label(name)
            if not label or mask.sum() < LEAST_PIXELS:
                continue
            if view[0] != "hand" and self._errors.misses(
                name, self._room.moved.get(name, 0), int(str(view[0])), bool(view[1])
            ):
                self.missed.add(name)
                continue
            noisy_masks.append(Mask(self._errors.class_of(name, label, *view), mask))
        return noisy_masks
