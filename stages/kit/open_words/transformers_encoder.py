"""CLIP and SigLIP folders through transformers, from this disk alone."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.transformers_folder import (
    load_model,
    load_processor,
    load_tokenizer,
    processor_class,
    read_config,
    short_name,
)
from scenewright.stages.kit.open_words.encoder import unit

FAMILIES = {
    "clip": ("CLIPModel", "clip", "CLIPImageProcessorPil"),
    "siglip": ("SiglipModel", "siglip", "SiglipImageProcessorPil"),
}
"""Model type -> class of the model, package and class of its image processor."""
SIDE = 224
"""Crops are handed over so large where the model says nothing else [px]."""
BATCH = 32
"""Crops that pass the network at a time, which bounds the memory."""
PADDED = {"siglip": 64}
"""SigLIP was trained on texts of 64 tokens, padding included."""


class TransformersEncoder:
    """A CLIP or SigLIP. Raises BadInput for another kind of model or a damaged folder, MissingDependency."""

    def __init__(self, folder: Path, device: str = "cpu") -> None:
        self._kind = str(read_config(folder)["model_type"])
        if self._kind not in FAMILIES:
            raise BadInput(
                f"{short_name(folder)}: a model of type {self._kind!r:.60}", hint=f"types: {', '.join(FAMILIES)}"
            )
        model_class, package, processor = FAMILIES[self._kind]
        self._model = load_model(model_class, folder, device)
        self._processor = load_processor(processor_class(package, processor), folder)
        self._tokenizer = load_tokenizer(folder)
        self._device, self._torch = device, importlib.import_module("torch")
        self.side = int(getattr(self._model.config.vision_config, "image_size", SIDE))
        self.label = f"huggingface {short_name(folder)}"
        self.width = int(self.texts(("object",)).shape[1])

    def pictures(self, crops: np.ndarray) -> np.ndarray:
        """Return (N, width) float32 unit vectors of crops (N, side, side, 3) uint8 RGB."""
        batches = [np.zeros((0, self.width), np.float32)]
        for start in range(0, len(crops), BATCH):
            inputs = self._processor(images=list(crops[start : start + BATCH]), return_tensors="pt")
            batches.append(self._vectors(self._model.get_image_features, inputs))
        return np.concatenate(batches)

    def texts(self, texts: Sequence[str]) -> np.ndarray:
        """Return (M, width) float32 unit vectors of texts."""
        padded = PADDED.get(self._kind)
        padding: Any = "max_length" if padded else True
        inputs = self._tokenizer(list(texts), padding=padding, truncation=True, max_length=padded, return_tensors="pt")
        return self._vectors(self._model.get_text_features, inputs)

    def unread(self, text: str) -> tuple[str, ...]:
        """Return nothing: what such a model has read is not known."""
        return ()

    def _vectors(self, function: Any, inputs: Any) -> np.ndarray:
        with self._torch.inference_mode():
            output = function(**{name: value.to(self._device) for name, value in inputs.items()})
        pooled = getattr(output, "pooler_output", output)  # newer versions wrap the vectors
        return unit(pooled.float().cpu().numpy())
