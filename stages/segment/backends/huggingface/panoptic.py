"""Panoptic networks of transformers: Mask2Former, MaskFormer, OneFormer, DETR."""

from __future__ import annotations

import importlib
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.transformers_folder import (
    load_model,
    load_processor,
    load_tokenizer,
    processor_class,
    short_name,
    transformers_library,
)
from scenewright.stages.kit.labels import LabelSet, match_labels
from scenewright.stages.segment.naming import NamedSegment

OVERLAP_SHARE = 0.8
"""A segment of which others leave less than this is dropped (the value of the published models)."""

logger = logging.getLogger("scenewright")


@dataclass(frozen=True)
class Family:
    """Where transformers keeps a kind of network."""

    model: str
    processor: str


FAMILIES = {
    "mask2former": Family("Mask2FormerForUniversalSegmentation", "Mask2FormerImageProcessorPil"),
    "maskformer": Family("MaskFormerForInstanceSegmentation", "MaskFormerImageProcessorPil"),
    "oneformer": Family("OneFormerForUniversalSegmentation", "OneFormerImageProcessorPil"),
    "detr": Family("DetrForSegmentation", "DetrImageProcessorPil"),
}
"""`model_type` of config.json -> family."""


class PanopticSegmenter:
    """A panoptic network. Raises BadInput or MissingDependency when it cannot be loaded or none of its labels is known.

    The processors scale and normalise as the model's own preprocessor_config.json says, and put the masks together.
    """

    def __init__(
        self, folder: Path, model_type: str, labels: LabelSet | None, *, score_threshold: float, device: str
    ) -> None:
        family = FAMILIES[model_type]
        self._torch = importlib.import_module("torch")
        self._device, self._threshold = device, score_threshold
        self._is_oneformer = model_type == "oneformer"
        # OneFormer's processor would fetch a list of classes that only training needs.
        changes: dict[str, Any] = {"class_info_file": None} if self._is_oneformer else {}
        self._images = load_processor(processor_class(model_type, family.processor), folder, **changes)
        self._model = load_model(family.model, folder, device)
        names = {int(number): str(name) for number, name in self._model.config.id2label.items()}
        self._labels = match_labels(names, labels, where=short_name(folder))
        if self._labels.unknown:
            logger.warning(
                "%s: %d of its labels are in no table and stay void: %s",
                short_name(folder),
                len(self._labels.unknown),
                ", ".join(self._labels.unknown[:10]),
            )
        self._task = self._task_tokens(folder) if self._is_oneformer else None

    def __call__(self, color: np.ndarray) -> tuple[np.ndarray, dict[int, NamedSegment]]:
        """Return ids (H, W) int32 and what each is, of an image (H, W, 3) uint8 RGB; 0 is void."""
        size = (color.shape[0], color.shape[1])
        inputs = dict(
            self._images(
                images=color, return_tensors="pt", **({"task_inputs": ["panoptic"]} if self._is_oneformer else {})
            )
        )
        if self._task is not None:
            inputs["task_inputs"] = self._task
        with self._torch.inference_mode():
            outputs = self._model(**{name: tensor.to(self._device) for name, tensor in inputs.items()})
            target: list[tuple[int, int]] | None = [size]
            if self._is_oneformer:
                # Its processor scales masks with torchvision. Scaled here, the same way, they already have their size.
                outputs.masks_queries_logits = self._torch.nn.functional.interpolate(
                    outputs.masks_queries_logits, size=size, mode="bilinear", align_corners=False
                )
                target = None
            segmented = self._images.post_process_panoptic_segmentation(
                outputs,
                threshold=self._threshold,
                overlap_mask_area_threshold=OVERLAP_SHARE,
                label_ids_to_fuse=self._labels.stuff(),
                target_sizes=target,
            )[0]
        # Some processors number segments from 0, and write -1 where there is none.
        ids = segmented["segmentation"].to("cpu").numpy().astype(np.int32) + 1
        if ids.shape != size:
            raise BadInput(
                f"the network gave masks of {ids.shape}, not of {size}", hint="check preprocessor_config.json"
            )
        segments = {}
        for row in segmented["segments_info"]:
            label = self._labels.labels.get(int(row["label_id"]))
            if label is not None:
                segments[int(row["id"]) + 1] = NamedSegment(label, float(row["score"]))
        ids[~np.isin(ids, list(segments))] = 0
        return ids, segments

    def _task_tokens(self, folder: Path) -> Any:
        tokenizer = load_tokenizer(folder)
        processor = transformers_library().OneFormerProcessor(
            image_processor=self._images, tokenizer=tokenizer, max_seq_length=77, task_seq_length=77
        )
        blank = np.zeros((32, 32, 3), dtype=np.uint8)
        return processor(images=blank, task_inputs=["panoptic"], return_tensors="pt")["task_inputs"]
