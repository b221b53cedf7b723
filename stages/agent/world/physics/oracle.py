"""A simulated segmenter for rooms of the agent: things and parts of furniture with errors, furniture without."""

from __future__ import annotations

import numpy as np
from scenewright.stages.agent.world.physics.room import Room
from scenewright.stages.kit.acting.errors import SegmenterErrors
from scenewright.stages.kit.acting.eyes.masks import Mask
from scenewright.stages.kit.acting.eyes.simulated import Shown, SimulatedSegmenter
from scenewright.stages.kit.rendering.object_views import Picture


class RoomSegmenter(SimulatedSegmenter):
    """Things of a picture, handles, doors and drawers, and furniture, with its doors."""

    def __init__(self, room: Room, errors: SegmenterErrors) -> None:
        super().__init__(errors, lambda: shown_in(room))
        self._room = room

    def masks(self, picture: Picture, map_from_camera: np.ndarray, region: object) -> list[Mask]:
        """Return the masks of a picture."""
        names = {int(number): self._room.named.get(int(number), "") for number in np.unique(picture.instance)}
        owners = {number: self._room.owner(name) for number, name in names.items()}
        furniture = [
            Mask(piece.label, np.isin(picture.instance, [number for number, owner in owners.items() if owner == name]))
            for name, piece in self._room.furniture.items()
            if name in owners.values()
        ]
        return [*furniture, *super().masks(picture, map_from_camera, region)]


def shown_in(room: Room) -> dict[int, Shown]:
    """Return the things, fixtures and parts of furniture of a room by their instance numbers."""
    return {
        number: Shown(name, room.label(name), room.moved.get(name, 0))
        for number, name in room.named.items()
        if room.label(name)
    }
