"""A semantic segmenter: a network that names every pixel, and the masks of what it names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.kit.labels import Label, LabelSet
from scenewright.stages.segment.naming import KEPT_SHARE, NamedSegment, name_segments
from scenewright.stages.segment.networks.fitting import Fitted
from scenewright.stages.segment.networks.labelling import class_count, label_map
from scenewright.stages.segment.networks.opening import Network, open_network
from scenewright.stages.segment.networks.sidecar import HINT, channels_axis
from scenewright.stages.segment.panoptic import PanopticFrame

PIXEL_SCORE = 0.5
"""Score of a mask of a semantic network, which gives none that can be compared."""


class SemanticSegmenter:
    """A semantic network and what its numbers stand for.

    Raises BadInput when the network is of another layout or nothing says what its classes are.
    """

    def __init__(self, network: Network, labels: LabelSet | None = None) -> None:
        if network.sidecar.layout != "semantic":
            raise BadInput(
                f"{network.path.name}: gives instances, not the class of every pixel",
                hint="give it with --weights, and a semantic network with --semantic-weights",
            )
        self._network = network
        matched = label_map(network, labels)
        self.labels: Mapping[int, Label] = matched.labels
        """Number of a class -> its label; others stand for nothing."""
        self.name = f"{network.path.stem} (semantic, {matched.set_name})"
        self._count = class_count(network) or max(matched.labels) + 1

    def classify(self, color: np.ndarray) -> np.ndarray:
        """Return the number of the class (H, W) uint16 of every pixel of an image (H, W, 3) uint8 RGB.

        Raises BadInput when the network fails or gives out classes beyond its own.
        """
        fitted = self._network.fit(color)
        numbers = pixel_classes(self._network(fitted)["classes"], fitted, (color.shape[0], color.shape[1]))
        if numbers.min() < 0 or numbers.max() >= self._count:
            raise BadInput(
                f"{self._network.path.name}: gives out a class beyond its {self._count}",
                hint=f"{HINT}: `labels` has too few",
            )
        return numbers.astype(np.uint16)

    def masks(self, color: np.ndarray, vocabulary: Vocabulary, *, minimum_pixels: int) -> PanopticFrame:
        """Return the masks of what it names: a stuff class is one, each connected region of a thing is one."""
        numbers = self.classify(color)
        segments = {
            number + 1: NamedSegment(label.model_copy(update={"kind": "stuff"}), PIXEL_SCORE)
            for number, label in self.labels.items()
        }
        return name_segments(numbers.astype(np.int32) + 1, segments, vocabulary, minimum_pixels=minimum_pixels)


def pixel_classes(classes: np.ndarray, fitted: Fitted, shape: tuple[int, int]) -> np.ndarray:
    """Return the number of the class (H, W) int32 of every pixel of an image of `shape`.

    `classes` of the fitted image: scores (1, C, h, w) or (1, h, w, C), or numbers (1, h, w), (1, 1, h, w) or
    (1, h, w, 1). Of equal scores the first class goes first; scores that are not finite are none.
    """
    high, wide = fitted.tensor.shape[-2:]
    if classes.ndim == 4 and min(classes.shape[1], classes.shape[3]) > 1:
        scores = np.nan_to_num(classes[0], nan=-np.inf, posinf=np.inf, neginf=-np.inf)
        numbers = scores.argmax(axis=channels_axis(classes.shape, (wide, high), 1) - 1)
    else:
        numbers = classes.reshape([side for side in classes.shape[1:] if side > 1] or [1, 1])
    rows = max(1, round(shape[0] * fitted.scale_y * numbers.shape[0] / high))
    columns = max(1, round(shape[1] * fitted.scale_x * numbers.shape[1] / wide))
    inner = np.clip(numbers[:rows, :columns], -1, np.iinfo(np.int16).max).astype(np.int16)
    return cv2.resize(inner, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST).astype(np.int32)


def fill(above: PanopticFrame, below: PanopticFrame) -> PanopticFrame:
    """Return the masks of `above`, and those of `below` where none of them lies.

    A thing of `below` of which less than KEPT_SHARE is left says nothing of its own; a class of stuff stays one mask.
    """
    ids, masks = above.ids.copy(), dict(above.masks)
    free = ids == 0
    stuff = {mask.class_id: number for number, mask in masks.items() if not mask.is_thing}
    whole = np.bincount(below.ids.ravel(), minlength=max(below.masks, default=0) + 1)
    left = np.bincount(below.ids[free], minlength=len(whole))
    for number, mask in sorted(below.masks.items()):
        if not left[number] or (mask.is_thing and left[number] < KEPT_SHARE * whole[number]):
            continue
        target = max(masks, default=0) + 1
        if not mask.is_thing:
            target = stuff.setdefault(mask.class_id, target)
        masks.setdefault(target, mask)
        ids[free & (below.ids == number)] = target
    return PanopticFrame(ids, masks)


def open_segmenter(weights: Path, labels: LabelSet | None = None, device: str = "cpu") -> SemanticSegmenter:
    """Return the segmenter of a file. Raises MissingDependency and BadInput as network and segmenter do."""
    return SemanticSegmenter(open_network(weights, device=device), labels)
