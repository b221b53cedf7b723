"""Backend `huggingface`: which model a folder holds, and its masks with classes of the vocabulary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.formats.transformers_folder import read_config, short_name
from scenewright.stages.kit.labels import LabelSet, parse_words, read_label_file
from scenewright.stages.segment.backends.huggingface import HuggingFaceParameters
from scenewright.stages.segment.backends.huggingface.open_vocabulary import OpenVocabularySegmenter
from scenewright.stages.segment.backends.huggingface.panoptic import FAMILIES, PanopticSegmenter
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame, pixels_at
from scenewright.stages.segment.naming import name_instances, name_segments
from scenewright.stages.segment.panoptic import PanopticFrame

GROUNDING = "grounding-dino"
MASKS = "sam"


class HuggingFaceBackend:
    """A model of transformers. `make_frame` turns an image (H, W, 3) uint8 RGB into named masks."""

    name = "huggingface"
    streams: tuple[str, ...] = ("color", "depth")

    def __init__(self, label: str, make_frame: Callable[[np.ndarray], PanopticFrame]) -> None:
        self.label = label
        self._make_frame = make_frame

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; a frame without colour has none."""
        if frame.color is None:
            return PanopticFrame(np.zeros(geometric.labels.shape, dtype=np.int32))
        return self._make_frame(frame.color)


@dataclass(frozen=True)
class HuggingFaceSettings:
    """What a model is used with."""

    mask_weights: Path | None = None
    """Model that makes masks of the boxes of an open-vocabulary model."""
    labels: LabelSet | None = None
    words: str = ""
    score_threshold: float = 0.3
    suppression_overlap: float = 0.5
    minimum_pixels: int = 60
    """At 640x480."""
    device: str = "cpu"


def open_backend(request: BackendRequest) -> HuggingFaceBackend:
    """Return the backend that the request asks for. Raises as `make_backend` does, and BadInput for damaged labels."""
    parameters = request.parameters
    settings = HuggingFaceSettings(
        mask_weights=request.mask_weights,
        labels=read_label_file(request.labels) if request.labels else None,
        words=request.own(HuggingFaceParameters).words,
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        minimum_pixels=parameters.small_object_pixels,
        device=request.device,
    )
    return make_backend(request.weights, settings, load_vocabulary())


def make_backend(weights: Path | None, settings: HuggingFaceSettings, vocabulary: Vocabulary) -> HuggingFaceBackend:
    """Return the backend for a model folder.

    Raises MissingDependency without a model, UsageError without the words that an open-vocabulary model needs,
    BadInput for a model of another kind.
    """
    if weights is None:
        raise MissingDependency(
            "--backend huggingface needs a model",
            hint="give a folder or hub id with --weights, for example facebook/mask2former-swin-tiny-coco-panoptic",
        )
    kind = str(read_config(weights)["model_type"])
    if kind == GROUNDING:
        return _open_vocabulary(weights, settings, vocabulary)
    if kind not in FAMILIES:
        raise BadInput(
            f"{short_name(weights)}: a model of type {kind!r:.60}", hint=f"types: {', '.join((*FAMILIES, GROUNDING))}"
        )
    if settings.words or settings.mask_weights is not None:
        raise UsageError(
            f"--words and --mask-weights are for open-vocabulary models; {short_name(weights)} is a {kind}",
            hint="leave them out",
        )
    segmenter = PanopticSegmenter(
        weights, kind, settings.labels, score_threshold=settings.score_threshold, device=settings.device
    )

    def panoptic(color: np.ndarray) -> PanopticFrame:
        ids, segments = segmenter(color)
        return name_segments(ids, segments, vocabulary, minimum_pixels=pixels_at(settings.minimum_pixels, ids.shape))

    return HuggingFaceBackend(f"huggingface {short_name(weights)}", panoptic)


def _open_vocabulary(weights: Path, settings: HuggingFaceSettings, vocabulary: Vocabulary) -> HuggingFaceBackend:
    mask_weights, labels = settings.mask_weights, settings.labels
    if mask_weights is None:
        raise MissingDependency(
            f"{short_name(weights)} gives boxes and needs a model that makes masks of them",
            hint="give a Segment Anything folder or hub id with --mask-weights, for example facebook/sam-vit-base",
        )
    kind = str(read_config(mask_weights)["model_type"])
    if kind != MASKS:
        raise BadInput(f"{short_name(mask_weights)}: a model of type {kind!r:.60}", hint=f"give one of type {MASKS}")
    if bool(settings.words) == bool(labels):
        raise UsageError(
            f"{short_name(weights)} looks for words", hint='give either --words "cup, table" or a list: --labels FILE'
        )
    names = labels.labels if labels else parse_words(settings.words.split(","), "--words")
    segmenter = OpenVocabularySegmenter(
        weights,
        mask_weights,
        names,
        score_threshold=settings.score_threshold,
        suppression_overlap=settings.suppression_overlap,
        device=settings.device,
    )

    def instances(color: np.ndarray) -> PanopticFrame:
        shape = (color.shape[0], color.shape[1])
        least = pixels_at(settings.minimum_pixels, shape)
        return name_instances(segmenter(color), shape, vocabulary, minimum_pixels=least)

    return HuggingFaceBackend(f"huggingface {short_name(weights)} + {short_name(mask_weights)}", instances)
