"""Backend `objects`: whole things from geometry and colour, class-agnostic. Each is one instance of class `object`.

Support surfaces (table, floor, walls: any large plane) are no object, and neither is what is larger than a thing to
be handled: the fusion keeps those as segments of the depth, which nobody has named.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.schemas.places import data_file
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.backends.objects import ObjectsParameters
from scenewright.stages.segment.backends.objects.boosting import read_trees
from scenewright.stages.segment.backends.objects.cuts import pixels_by_label
from scenewright.stages.segment.backends.objects.grouping import PairScorer, by_trees
from scenewright.stages.segment.backends.objects.pairs import FEATURES
from scenewright.stages.segment.backends.objects.segmentation import BY_SET_RULES, segment_objects
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

BUNDLED = data_file("networks/tabletop_pairs.safetensors")
GREY = 128
"""Colour of everything in a log without colour."""

SCORERS: dict[str, Callable[[], PairScorer]] = {
    "learned": lambda: by_trees(read_trees(BUNDLED, FEATURES)),
    "rules": lambda: BY_SET_RULES,
}
"""Scorers of pairs by the name that `--grouping` gives. The trees raise BadInput when they cannot be read."""


class ObjectsBackend:
    """Masks that are the objects over the support surfaces."""

    name = "objects"
    label = "objects from geometry and colour, class-agnostic"
    streams: tuple[str, ...] = ("color", "depth")

    def __init__(self, vocabulary: Vocabulary, camera: Camera, *, scorer: PairScorer, largest: float) -> None:
        """`scorer` decides what is one object (`SCORERS`); `largest` diameter of an object [m]."""
        self._camera = camera
        self._scorer = scorer
        self._largest = largest
        semantic = vocabulary.by_name("object")
        self._mask = PanopticMask(semantic.id, semantic.kind == "thing")

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return a mask per object. The frame must have depth; without colour only geometry counts."""
        assert frame.depth is not None
        color = frame.color if frame.color is not None else np.full((*frame.depth.shape, 3), GREY, dtype=np.uint8)
        objects = segment_objects(color, frame.depth, self._camera, self._scorer)
        count = int(objects.labels.max(initial=0))
        rows, columns, starts = pixels_by_label(objects.labels[objects.patches.window], count)
        number_of = np.arange(count + 1, dtype=np.int32)
        for k in range(1, count + 1):
            of_object = slice(starts[k], starts[k + 1])
            low, high = np.quantile(objects.patches.points[rows[of_object], columns[of_object]], (0.02, 0.98), axis=0)
            if np.linalg.norm(high - low) > self._largest:
                number_of[k] = 0
        ids = number_of[objects.labels]
        return PanopticFrame(ids=ids, masks=dict.fromkeys(np.unique(ids[ids > 0]).tolist(), self._mask))


def open_backend(request: BackendRequest) -> ObjectsBackend:
    """Return the backend that the request asks for. Raises UsageError without a log, BadInput as the class does."""
    _, reader = request.log()
    options = request.own(ObjectsParameters)
    return ObjectsBackend(
        load_vocabulary(), reader.camera, scorer=SCORERS[options.grouping](), largest=options.largest_object
    )
