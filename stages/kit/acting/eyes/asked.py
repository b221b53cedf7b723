"""A segmentation service as the eyes of the robot: any backend of `segment` behind HTTP (docs/SEGMENTATION.md)."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.acting.eyes.masks import Mask
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.rendering.object_views import LEAST_PIXELS, Picture
from scenewright.stages.kit.services.segmentation_client import connect, read_info
from scenewright.stages.kit.services.segmentation_protocol import (
    SEGMENT_PATH,
    SegmentRequest,
    encode_request,
    parse_reply,
)

CAMERA = "robot"
ALIASES = ("coco", "nyu40", "scannet", "ade20k")
"""Other vocabularies whose names data/vocabulary.toml lists."""


def word_of(category: str, known: Collection[str]) -> str:
    """Return what the robot calls a category of a service: by its name, else by the vocabulary's class of which it is
    an alias; a name for which it knows no word stays as it is."""
    name = " ".join(category.replace("_", " ").lower().split())
    classes = (load_vocabulary().by_alias(name, source) for source in ALIASES)
    words = (name, *(entry.name for entry in classes if entry is not None))
    return next((word for word in words if word in known), name)


class AskedSegmenter:
    """The masks of the service at an address, of colour, depth and the believed pose alone: nothing true. `known`:
    words of the robot for categories.

    Raises MissingDependency when no service answers, BadInput for something else that answers, or a bad reply;
    MachineFailure when it stops answering.
    """

    def __init__(self, address: str, seed: int, known: Collection[str]) -> None:
        self._connection = connect(address)
        self.info = read_info(self._connection)
        self.missed: frozenset[str] = frozenset()
        """Nobody knows."""
        self._seed, self._asked = seed, 0
        self._categories = {category.id: category for category in self.info.categories}
        self._words = {category.id: word_of(category.name, known) for category in self.info.categories}

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def masks(self, picture: Picture, map_from_camera: np.ndarray, region: object) -> list[Mask]:
        """Return the masks of things of the service. Raises BadInput for a reply that can't be read, MachineFailure
        when it stops answering."""
        frame = Frame(self._asked, 0.0, picture.color, picture.depth, None, map_from_camera, CAMERA)
        self._asked += 1
        body, content_type = encode_request(SegmentRequest(frame, picture.camera, self._seed), self.info.streams)
        answer = self._connection.post(SEGMENT_PATH, body, content_type)
        shape = (picture.depth.shape[0], picture.depth.shape[1])
        try:
            reply = parse_reply(answer.body, answer.content_type, shape, self._categories)
        except BadInput as error:
            raise BadInput(f"{self._connection.address}: reply: {error.message}", hint="mend the service") from None
        masks = [
            Mask(self._words[segment.class_id], reply.ids == number)
            for number, segment in sorted(reply.segments.items())
            if segment.is_thing
        ]
        return [entry for entry in masks if entry.mask.sum() >= LEAST_PIXELS]
