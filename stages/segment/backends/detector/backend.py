"""Backend `detector`: boxes of an object detector turned into masks by the depth."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import MissingDependency
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary, load_vocabulary
from scenewright.stages.kit.class_extents import extent_of, is_plausible
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.geometry.cameras import boxes_seen_by
from scenewright.stages.segment.backends.detector.agreement import HEARD, Thing, witnessed
from scenewright.stages.segment.backends.detector.box_masks import box_mask, frame_geometry
from scenewright.stages.segment.backends.detector.yolox import Detections, Detector
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.coco import COCO_NAMES
from scenewright.stages.segment.geometric import GeometricFrame, pixels_at
from scenewright.stages.segment.networks.semantic import SemanticSegmenter, open_segmenter
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

LARGE_FACED = frozenset({"table", "desk", "bed", "sofa", "bench", "monitor", "fridge"})
"""Classes of which a box around a part is still a detection of the whole: one face fills most of the box."""
FLAT_TOPPED = frozenset({"table", "desk"})
"""Classes whose upper side is a level top, over which nothing of them rises."""
LARGEST_UNNAMED = 0.8
"""A detection of impossible size still points at some item when that is small; at furniture size it says nothing, and
its votes would drown those of the frames in which the thing was recognised [m]."""
DUPLICATE_OVERLAP = 0.5
"""Two masks of one class that share this much of the smaller one are the same thing."""


class DetectorBackend:
    """Detector boxes combined with geometric segments. What bounds the room is for `fuse` to find."""

    name = "detector"
    streams: tuple[str, ...] = ("color", "depth", "picture")

    def __init__(
        self,
        reader: FrameReader,
        vocabulary: Vocabulary,
        detector: Detector,
        *,
        label: str,
        minimum_pixels: int,
        witness: SemanticSegmenter | None = None,
        threshold: float = 0.0,
    ) -> None:
        """`witness`: a segmenter that is asked what it calls the detected things; where it says nothing, detections
        under `threshold` do not count."""
        self.label = label
        self.minimum_pixels = minimum_pixels
        self._witness = witness
        self._threshold = threshold
        self._known = {
            number: vocabulary.by_name(label.class_name)
            for number, label in (witness.labels if witness else {}).items()
            if label.class_name
        }
        self._detector, self._reader = detector, reader
        self._classes = [vocabulary.by_alias(name, "coco") for name in COCO_NAMES]
        self._anything = vocabulary.by_name(UNNAMED)

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; one without colour has none."""
        things = self._things(frame, geometric) if frame.color is not None else []
        return paint(things, geometric.labels.shape)

    def _things(self, frame: Frame, geometric: GeometricFrame) -> list[Thing]:
        assert frame.color is not None
        geometry = frame_geometry(geometric.labels, geometric.points, geometric.normals, frame.world_from_camera)
        detections, boxes = self._detected(frame)
        things = []
        for box, score, number in zip(boxes, detections.scores, detections.classes, strict=True):
            semantic = self._classes[int(number)]
            if semantic is None:
                continue
            mask = box_mask(
                box, geometry, large_face=semantic.name in LARGE_FACED, flat_topped=semantic.name in FLAT_TOPPED
            )
            if mask.sum() < pixels_at(self.minimum_pixels, mask.shape):
                continue
            height, width = mask.shape
            cut_off = bool(box[0] < 4 or box[1] < 4 or box[2] > width - 4 or box[3] > height - 4)
            extent = extent_of(geometric.points[mask])
            if not is_plausible(semantic.name, extent, cut_off=cut_off):
                if extent > LARGEST_UNNAMED:
                    continue
                semantic = self._anything
            things.append(Thing(semantic, float(score), mask))
        if self._witness is not None:
            classes = self._witness.classify(frame.color)
            things = list(witnessed(things, classes, self._known, threshold=self._threshold, anything=self._anything))
        return merge_duplicates(things)

    def _detected(self, frame: Frame) -> tuple[Detections, np.ndarray]:
        """Return what is found in a frame's picture, in its colour where it has none, and the boxes (N, 4) in the
        frame."""
        if frame.picture is None:
            assert frame.color is not None
            found = self._detector.detect(frame.color)
            return found, found.boxes
        found = self._detector.detect(frame.picture)
        picture, camera = self._reader.picture_cameras[frame.camera_name], self._reader.cameras[frame.camera_name]
        return found, boxes_seen_by(found.boxes, picture, camera)


def merge_duplicates(things: list[Thing]) -> list[Thing]:
    """Return the things with those merged that are the same, best score first.

    Two masks that share half of the smaller one are one thing when they have the same class (a chair and its back,
    boxed twice): it gets the union. Of two classes for nearly the same mask the better scored stays, but any class
    goes before `object`, which is what is left of a detection of impossible size.
    """
    merged: list[Thing] = []
    for item in sorted(things, key=lambda thing: (thing.semantic.name == UNNAMED, -thing.score)):
        for index, larger in enumerate(merged):
            shared = int((item.mask & larger.mask).sum())
            smaller, union = min(item.mask.sum(), larger.mask.sum()), (item.mask | larger.mask).sum()
            if item.semantic.id == larger.semantic.id and shared > DUPLICATE_OVERLAP * smaller:
                merged[index] = Thing(larger.semantic, larger.score, larger.mask | item.mask)
                break
            if shared > 0.6 * union:
                break
        else:
            merged.append(item)
    return merged


def paint(things: list[Thing], shape: tuple[int, ...]) -> PanopticFrame:
    """Return one frame of masks: small things over large ones (they stand in front)."""
    ids = np.zeros(shape, dtype=np.int32)
    masks: dict[int, PanopticMask] = {}
    for thing in sorted(things, key=lambda item: (-int(item.mask.sum()), -item.score)):
        masks[len(masks) + 1] = PanopticMask(thing.semantic.id, thing.semantic.kind == "thing", thing.score)
        ids[thing.mask] = len(masks)
    present = set(np.unique(ids).tolist())
    return PanopticFrame(ids, {key: mask for key, mask in masks.items() if key in present})


def open_backend(request: BackendRequest) -> DetectorBackend:
    """Return the backend that the request asks for.

    Raises UsageError without a log, MissingDependency without weights, BadInput when they are no such detector.
    """
    parameters = request.parameters
    reader = request.log()[1]
    if request.weights is None:
        raise MissingDependency(
            "--backend detector needs the weights of a detector",
            hint="give an ONNX export of a YOLOX model (COCO-80) with --weights, or use --backend geometric",
        )
    label = f"detector {request.weights.stem} + geometric segments"
    witness, score_threshold = None, parameters.score_threshold
    if request.semantic_weights is not None:
        witness = open_segmenter(request.semantic_weights, device=request.device)
        score_threshold = HEARD * parameters.score_threshold
        label = f"detector {request.weights.stem}, witnessed by {request.semantic_weights.stem}, + geometric segments"
    seen = next(iter(reader.picture_cameras.values()), reader.camera)
    detector = Detector(
        request.weights,
        score_threshold=score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        tile_side=min(seen.width, seen.height) if parameters.tiles is None else 0,
        tiles=parameters.tiles or 0,
    )
    return DetectorBackend(
        reader,
        load_vocabulary(),
        detector,
        label=label,
        minimum_pixels=parameters.small_object_pixels,
        witness=witness,
        threshold=parameters.score_threshold,
    )
