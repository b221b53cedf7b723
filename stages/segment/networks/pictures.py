"""Backends `tflite` and `onnx`: the masks of networks on pictures, with classes of the vocabulary."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.segments import Witness
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.labels import LabelMap, LabelSet, read_label_file
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame, pixels_at
from scenewright.stages.segment.naming import InstanceMask, NamedSegment, name_instances, name_segments
from scenewright.stages.segment.networks import decoding
from scenewright.stages.segment.networks.labelling import label_map
from scenewright.stages.segment.networks.opening import Network, open_network
from scenewright.stages.segment.networks.semantic import SemanticSegmenter, fill, open_segmenter
from scenewright.stages.segment.networks.sidecar import Sidecar, read_sidecar
from scenewright.stages.segment.networks.tiles import Run, grid_windows, one_answer
from scenewright.stages.segment.panoptic import PanopticFrame
from scenewright.stages.segment.registry import all_backends

HEARD_IN_TILES = 0.5
"""With tiles, detections down to this share of the score threshold count towards the mean of all runs."""


class InstanceSegmenter:
    """A network of instances or of a panoptic layout, and what its numbers stand for."""

    def __init__(
        self,
        network: Network,
        labels: LabelMap,
        vocabulary: Vocabulary,
        *,
        score_threshold: float,
        suppression_overlap: float,
        minimum_pixels: int,
        tiles: int,
    ) -> None:
        self.network, self.labels, self._vocabulary = network, labels, vocabulary
        self._threshold, self._overlap, self._minimum = score_threshold, suppression_overlap, minimum_pixels
        self._tiles = tiles
        parts = [network.sidecar.layout, labels.set_name, *([f"{tiles}x{tiles} tiles"] if tiles > 1 else [])]
        self.name = f"{network.path.stem} ({', '.join(parts)})"

    def masks(self, color: np.ndarray) -> PanopticFrame:
        """Return the masks of an image (H, W, 3) uint8 RGB. Raises BadInput when the network fails."""
        shape = (color.shape[0], color.shape[1])
        least = pixels_at(self._minimum, shape)
        if self.network.sidecar.layout == "panoptic":
            return self._panoptic(color, shape, least)
        found: list[tuple[int, decoding.Found]] = []
        runs: list[Run] = []
        threshold = self._threshold * (HEARD_IN_TILES if self._tiles > 1 else 1)
        for number, (x0, y0, x1, y1) in enumerate(grid_windows(shape[1], shape[0], self._tiles)):
            fitted = self.network.fit(np.ascontiguousarray(color[y0:y1, x0:x1]))
            things = decoding.instances_of(
                self.network.sidecar.layout,
                self.network(fitted),
                fitted,
                (y1 - y0, x1 - x0),
                score_threshold=threshold,
                suppression_overlap=self._overlap,
            )
            runs.append(Run((x0, y0, x1, y1), fitted.scale_x * fitted.scale_y, number == 0))
            for thing in things:
                if thing.number in self.labels.labels:
                    mask = np.zeros(shape, dtype=bool)
                    mask[y0:y1, x0:x1] = thing.mask
                    found.append((number, replace(thing, mask=mask)))
        instances = [
            InstanceMask(thing.mask, self.labels.labels[thing.number], thing.score)
            for thing in one_answer(found, runs, shape, score_threshold=self._threshold)
        ]
        return name_instances(instances, shape, self._vocabulary, minimum_pixels=least)

    def _panoptic(self, color: np.ndarray, shape: tuple[int, int], least: int) -> PanopticFrame:
        fitted = self.network.fit(color)
        outputs = self.network(fitted)
        ids, segments = decoding.panoptic(
            outputs["classes"],
            outputs["masks"],
            fitted,
            shape,
            score_threshold=self._threshold,
            stuff=self.labels.stuff(),
        )
        named = {
            segment: NamedSegment(self.labels.labels[number], score)
            for segment, (number, score) in segments.items()
            if number in self.labels.labels
        }
        return name_segments(ids, named, self._vocabulary, minimum_pixels=least)


class PictureBackend:
    """Instances of one network, and under them what a semantic one names; either of the two may be absent.
    `minimum_pixels` holds at 640x480."""

    streams: tuple[str, ...] = ("color", "depth")

    def __init__(
        self,
        name: str,
        instances: InstanceSegmenter | None,
        semantic: SemanticSegmenter | None,
        vocabulary: Vocabulary,
        *,
        minimum_pixels: int,
    ) -> None:
        self.name = name
        self._instances, self._semantic, self._vocabulary = instances, semantic, vocabulary
        self._minimum = minimum_pixels
        self.networks = tuple(network.name for network in (instances, semantic) if network is not None)
        self.label = f"{name} {' over '.join(self.networks)}"

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; a frame without colour has none. Raises BadInput when a network fails."""
        masks = PanopticFrame(np.zeros(geometric.labels.shape, dtype=np.int32))
        if frame.color is None:
            return masks
        if self._instances is not None:
            masks = self._instances.masks(frame.color)
        if self._semantic is not None:
            least = pixels_at(self._minimum, frame.color.shape)
            below = self._semantic.masks(frame.color, self._vocabulary, minimum_pixels=least)
            several = self._instances is not None
            masks = fill(_testified(masks, 0), _testified(below, 1)) if several else below
        return masks


def _testified(frame: PanopticFrame, network: int) -> PanopticFrame:
    """Return a frame whose masks say which network gave them."""
    masks = {
        number: replace(mask, witnesses=(Witness(network=network, class_id=mask.class_id, score=mask.score),))
        for number, mask in frame.masks.items()
    }
    return PanopticFrame(frame.ids, masks)


def open_pictures(name: str, request: BackendRequest) -> PictureBackend:
    """Return the backend of this name that a request asks for.

    Raises MissingDependency without a network or what runs it, BadInput when a network's layout or labels are unknown,
    UsageError for tiles where no network gives instances.
    """
    parameters = request.parameters
    vocabulary = load_vocabulary()
    labels = read_label_file(request.labels) if request.labels else None
    if request.weights is None and request.semantic_weights is None:
        raise MissingDependency(
            f"--backend {name} needs a network", hint=f"give a .{name} file with --weights (docs/SEGMENTATION.md)"
        )
    semantic = open_segmenter(request.semantic_weights, labels, request.device) if request.semantic_weights else None
    instances = None
    if request.weights is not None:
        network = open_network(_own_file(name, request.weights), _sidecar_of(request), request.device)
        if network.sidecar.layout == "semantic" and semantic is None:
            semantic = SemanticSegmenter(network, labels)
        else:
            instances = _instances_of(network, labels, vocabulary, request)
    if (parameters.tiles or 0) > 1 and (instances is None or instances.network.sidecar.layout == "panoptic"):
        raise UsageError("--tiles is for networks that give instances", hint="leave --tiles out")
    return PictureBackend(name, instances, semantic, vocabulary, minimum_pixels=parameters.small_object_pixels)


def _own_file(name: str, weights: Path) -> Path:
    """Return the file. Raises BadInput when its name ends as those of another backend do."""
    if weights.suffix != f".{name}":
        others = [one.name for one in all_backends() if weights.suffix in one.endings]
        raise BadInput(
            f"{weights.name}: --backend {name} takes .{name} files",
            hint=f"give --backend {' or '.join(others)}" if others else f"export it as .{name}",
        )
    return weights


def _sidecar_of(request: BackendRequest) -> Sidecar | None:
    return read_sidecar(request.sidecar) if request.sidecar else None


def _instances_of(
    network: Network, labels: LabelSet | None, vocabulary: Vocabulary, request: BackendRequest
) -> InstanceSegmenter:
    if network.sidecar.layout == "semantic":
        raise BadInput(
            f"{network.path.name}: gives the class of every pixel, and --semantic-weights does so too",
            hint="give one of them, and a network that gives instances with --weights",
        )
    parameters = request.parameters
    return InstanceSegmenter(
        network,
        label_map(network, labels),
        vocabulary,
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        minimum_pixels=parameters.small_object_pixels,
        tiles=parameters.tiles or 0,
    )
