"""The constants of the grouping, chosen on the validation frames: PQ with and without colour for a grid of them.

    scenewright train network-thresholds --frames FOLDER --weights FILE --out FOLDER

The network runs once per frame; only the grouping is repeated.
"""

from __future__ import annotations

import json
import logging
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, panoptic_quality
from scenewright.stages.segment.backends.network.backend import load_predictor
from scenewright.stages.segment.backends.network.features import STRIDE, Mount, features
from scenewright.stages.segment.backends.network.grouping import GroupingSettings, group
from scenewright.stages.segment.training.network.samples import FrameSet
from scenewright.stages.segment.training.network.validation import KNOWN, STUFF
from scenewright.stages.segment.training.network_thresholds import ThresholdsTraining

_LOGGER = logging.getLogger("scenewright")
GRID = {
    "centre_threshold": (0.1, 0.15, 0.2),
    "peak_window": (7, 9, 13),
    "score_threshold": (0.2, 0.3, 0.4, 0.5),
    "minimum_pixels": (12, 24, 40),
}


def train(options: ThresholdsTraining, out: Path) -> None:
    """Write the settings, best first."""
    vocabulary = load_vocabulary()
    names = {entry.id: entry.name for entry in vocabulary.classes}
    predictor = load_predictor(options.weights, vocabulary)
    frames = FrameSet(options.frames / "validation")
    choices: list[dict[str, Any]] = [dict(zip(GRID, values, strict=True)) for values in product(*GRID.values())]
    sums: list[dict[str, ClassQuality]] = [{} for _ in choices]
    for index in range(0, len(frames), 40 if options.quick else options.every):
        frame = frames[index]
        truth = frame.labels[::STRIDE, ::STRIDE].ravel().astype(np.int64)
        for known in (KNOWN["all"], KNOWN["no_colour"]):
            inputs = features(
                frame.depth, frame.color if known.color else None, frame.camera, Mount(frame.up, frame.height)
            )
            with torch.inference_mode():
                logits, heat, offsets = (
                    output[0].contiguous().numpy()
                    for output in predictor.checkpoint.network(torch.from_numpy(inputs)[None])
                )
            for choice, into in zip(choices, sums, strict=True):
                found = group(
                    logits, heat[0], offsets, predictor.classes, GroupingSettings(**choice), predictor.unnamed
                )
                named = {number: names[mask.class_id] for number, mask in found.masks.items()}
                ids = found.ids.ravel().astype(np.int64)
                found_quality = panoptic_quality(truth, ids, dict(enumerate(frame.classes, start=1)), named, STUFF)
                for name, entry in found_quality.items():
                    into[name] = into.get(name, ClassQuality()) + entry
    ranked = sorted(
        ((average_quality(into.values()).pq or 0.0, choice) for choice, into in zip(choices, sums, strict=True)),
        key=lambda entry: -entry[0],
    )
    (out / "thresholds.json").write_text(
        json.dumps([{"pq": quality, **choice} for quality, choice in ranked], indent=1)
    )
    for quality, choice in ranked[:5]:
        _LOGGER.info("%.2f  %s", 100 * quality, choice)
