"""Masks for words: Grounding DINO boxes (Liu et al. 2023) made masks by Segment Anything (Kirillov et al. 2023)."""

from __future__ import annotations

import importlib
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
)
from scenewright.stages.kit.labels import Label
from scenewright.stages.segment.naming import InstanceMask
from scenewright.stages.segment.suppression import suppress

MOST_TOKENS = 200
"""Tokens of one prompt; published models read 256. Longer lists of words are asked in several goes."""
WORD_END = ". "
"""What Grounding DINO separates the words of a prompt with."""


@dataclass(frozen=True)
class Prompt:
    """Words that are asked for in one go."""

    text: str
    words: tuple[int, ...]
    """Indices into the list of words."""
    spans: tuple[tuple[int, int], ...]
    """Begin and end of each word in the text [characters]."""


@dataclass(frozen=True)
class WordBoxes:
    """Boxes of words in one image."""

    boxes: np.ndarray
    """(N, 4) x0, y0, x1, y1 [pixels]."""
    scores: np.ndarray
    """(N,) 0..1."""
    words: np.ndarray
    """(N,) indices into the list of words."""


def make_prompts(words: list[str], token_counts: list[int]) -> list[Prompt]:
    """Return the prompts `cup. blue mug. ` that hold all words in small letters, at most MOST_TOKENS tokens each."""
    prompts: list[Prompt] = []
    group: list[int] = []
    used = 0
    for index, count in enumerate(token_counts):
        if group and used + count + 1 > MOST_TOKENS:
            prompts.append(_prompt(words, group))
            group, used = [], 0
        group.append(index)
        used += count + 1
    return [*prompts, _prompt(words, group)]


def _prompt(words: list[str], group: list[int]) -> Prompt:
    text, spans = "", []
    for index in group:
        word = words[index].lower().replace(".", " ")
        spans.append((len(text), len(text) + len(word)))
        text += word + WORD_END
    return Prompt(text.rstrip(), tuple(group), tuple(spans))


def word_scores(token_scores: np.ndarray, offsets: np.ndarray, prompt: Prompt) -> np.ndarray:
    """Return the score (N, words of the prompt) of every box for every word: that of the word's best token.

    `token_scores` (N, T) 0..1; `offsets` (T, 2) characters that a token stands for (begin = end: none).
    """
    scores = np.zeros((len(token_scores), len(prompt.words)))
    for column, (begin, end) in enumerate(prompt.spans):
        of_word = (offsets[:, 0] >= begin) & (offsets[:, 1] <= end) & (offsets[:, 1] > offsets[:, 0])
        if of_word.any():
            scores[:, column] = token_scores[:, of_word].max(axis=1)
    return scores


class OpenVocabularySegmenter:
    """Finds what a list of words names. Raises BadInput or MissingDependency when a model cannot be loaded."""

    def __init__(
        self,
        folder: Path,
        mask_folder: Path,
        labels: tuple[Label, ...],
        *,
        score_threshold: float,
        suppression_overlap: float,
        device: str,
    ) -> None:
        self._torch = importlib.import_module("torch")
        self._device, self._labels = device, labels
        self._threshold, self._overlap = score_threshold, suppression_overlap
        self._images = load_processor(processor_class("grounding_dino", "GroundingDinoImageProcessorPil"), folder)
        self._tokenizer = load_tokenizer(folder)
        if not self._tokenizer.is_fast:
            raise BadInput(f"{short_name(folder)}: has no tokenizer.json", hint="fetch it again")
        self._detector = load_model("GroundingDinoForObjectDetection", folder, device)
        self._mask_images = load_processor(processor_class("sam", "SamImageProcessorPil"), mask_folder)
        self._sam = load_model("SamModel", mask_folder, device)
        words = [label.name for label in labels]
        counts = [len(ids) for ids in self._tokenizer(words, add_special_tokens=False)["input_ids"]]
        self._prompts = make_prompts(words, counts)

    def __call__(self, color: np.ndarray) -> list[InstanceMask]:
        """Return what is found in an image (H, W, 3) uint8 RGB; masks may overlap."""
        boxes = self._boxes(color)
        masks = self._masks(color, boxes.boxes)
        return [
            InstanceMask(mask, self._labels[word], float(score))
            for mask, word, score in zip(masks, boxes.words, boxes.scores, strict=True)
        ]

    def _boxes(self, color: np.ndarray) -> WordBoxes:
        """Return boxes over the threshold; of those that overlap more than `suppression_overlap` the best one."""
        height, width = color.shape[:2]
        images = self._images(images=color, return_tensors="pt").to(self._device)
        by_prompt = []
        for prompt in self._prompts:
            tokens = self._tokenizer(prompt.text, return_tensors="pt", return_offsets_mapping=True)
            offsets = tokens.pop("offset_mapping")[0].numpy()
            with self._torch.inference_mode():
                outputs = self._detector(**images, **tokens.to(self._device))
            logits = outputs.logits[0, :, : len(offsets)].float().sigmoid().cpu().numpy()
            scores = word_scores(logits, offsets, prompt)
            best = scores.argmax(axis=1)
            score = scores[np.arange(len(best)), best]
            keep = score >= self._threshold
            centre, size = np.split(outputs.pred_boxes[0].float().cpu().numpy()[keep], 2, axis=1)
            boxes = np.concatenate([centre - size / 2, centre + size / 2], axis=1) * [width, height, width, height]
            by_prompt.append((np.clip(boxes, 0, [width, height] * 2), score[keep], np.array(prompt.words)[best[keep]]))
        boxes, scores, words = (np.concatenate([part[k] for part in by_prompt]) for k in range(3))
        unsuppressed = suppress(boxes, scores, np.zeros(len(words), dtype=int), self._overlap)
        return WordBoxes(boxes[unsuppressed], scores[unsuppressed], words[unsuppressed].astype(int))

    def _masks(self, color: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        """Return a mask (N, H, W) bool for every box."""
        if not len(boxes):
            return np.zeros((0, *color.shape[:2]), dtype=bool)
        images = self._mask_images(images=color, return_tensors="pt")
        sizes = images["reshaped_input_sizes"][0].tolist()
        scale = np.array([sizes[1] / color.shape[1], sizes[0] / color.shape[0]] * 2)
        scaled = self._torch.tensor((boxes * scale)[None], dtype=self._torch.float32)
        with self._torch.inference_mode():
            outputs = self._sam(
                pixel_values=images["pixel_values"].to(self._device),
                input_boxes=scaled.to(self._device),
                multimask_output=False,
            )
        masks: Any = self._mask_images.post_process_masks(
            outputs.pred_masks.cpu(), images["original_sizes"], images["reshaped_input_sizes"]
        )
        return np.asarray(masks[0])[:, 0].astype(bool)
