"""Backend `huggingface`: which model a folder holds, and its masks with classes of the vocabulary."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from schemas.errors import BadInput, MissingDependency, UsageError
from schemas.vocabulary import Vocabulary
from stages.kit.formats.frames import Frame
from stages.segment.backends.huggingface.loading import read_config, short_name
from stages.segment.backends.huggingface.open_vocabulary import OpenVocabularySegmenter
from stages.segment.backends.huggingface.panoptic import FAMILIES, PanopticSegmenter
from stages.segment.geometric import GeometricFrame, pixels_at
from stages.segment.labels import LabelSet, parse_words
from stages.segment.naming import name_instances, name_segments
from stages.segment.panoptic import PanopticFrame

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


def make_backend(
    weights: Path | None,
    mask_weights: Path | None,
    labels: LabelSet | None,
    words: str,
    vocabulary: Vocabulary,
    *,
    score_threshold: float,
    suppression_overlap: float,
    minimum_pixels: int,
    device: str,
) -> HuggingFaceBackend:
    """Return the backend for a model folder. `minimum_pixels` holds at 640x480.

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
        return _open_vocabulary(
            weights, mask_weights, labels, words, vocabulary,
            score_threshold=score_threshold, suppression_overlap=suppression_overlap,
            minimum_pixels=minimum_pixels, device=device,
        )  # fmt: skip
    if kind not in FAMILIES:
        raise BadInput(
            f"{short_name(weights)}: a model of type {kind!r:.60}", hint=f"types: {', '.join((*FAMILIES, GROUNDING))}"
        )
    if words or mask_weights is not None:
        raise UsageError(
            f"--words and --mask-weights are for open-vocabulary models; {short_name(weights)} is a {kind}",
            hint="leave them out",
        )
    segmenter = PanopticSegmenter(weights, kind, labels, score_threshold=score_threshold, device=device)

    def panoptic(color: np.ndarray) -> PanopticFrame:
        ids, segments = segmenter(color)
        return name_segments(ids, segments, vocabulary, minimum_pixels=pixels_at(minimum_pixels, ids.shape))

    return HuggingFaceBackend(f"huggingface {short_name(weights)}", panoptic)


def _open_vocabulary(
    weights: Path,
    mask_weights: Path | None,
    labels: LabelSet | None,
    words: str,
    vocabulary: Vocabulary,
    *,
    score_threshold: float,
    suppression_overlap: float,
    minimum_pixels: int,
    device: str,
) -> HuggingFaceBackend:
    if mask_weights is None:
        raise MissingDependency(
            f"{short_name(weights)} gives boxes and needs a model that makes masks of them",
            hint="give a Segment Anything folder or hub id with --mask-weights, for example facebook/sam-vit-base",
        )
    kind = str(read_config(mask_weights)["model_type"])
    if kind != MASKS:
        raise BadInput(f"{short_name(mask_weights)}: a model of type {kind!r:.60}", hint=f"give one of type {MASKS}")
    if bool(words) == bool(labels):
        raise UsageError(
            f"{short_name(weights)} looks for words", hint='give either --words "cup, table" or a list: --labels FILE'
        )
    wanted = labels.labels if labels else parse_words(words.split(","), "--words")
    segmenter = OpenVocabularySegmenter(
        weights, mask_weights, wanted,
        score_threshold=score_threshold, suppression_overlap=suppression_overlap, device=device,
    )  # fmt: skip

    def found(color: np.ndarray) -> PanopticFrame:
        shape = (color.shape[0], color.shape[1])
        least = pixels_at(minimum_pixels, shape)
        return name_instances(segmenter(color), shape, vocabulary, minimum_pixels=least)

    return HuggingFaceBackend(f"huggingface {short_name(weights)} + {short_name(mask_weights)}", found)
