"""The constants of the grouping, chosen on the validation frames: PQ with and without colour for a grid of them.

    python -m benchmarks.training.thresholds --data FOLDER --weights FILE [--every N]

The network runs once per frame; only the grouping is repeated.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import Field
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, panoptic_quality
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.backends.network.backend import load_predictor
from scenewright.stages.segment.backends.network.features import STRIDE, Mount, features
from scenewright.stages.segment.backends.network.grouping import GroupingSettings, group

from benchmarks.options import asked
from benchmarks.training.samples import FrameSet
from benchmarks.training.validation import KNOWN, STUFF

GRID = {
    "centre_threshold": (0.1, 0.15, 0.2),
    "peak_window": (7, 9, 13),
    "score_threshold": (0.2, 0.3, 0.4, 0.5),
    "minimum_pixels": (12, 24, 40),
}


class Options(Parameters):
    """Options."""

    data: Path = Field(description="Folder of benchmarks.training.data")
    weights: Path = Field(description="Of the network")
    every: int = Field(2, description="Every so many frames")


def main() -> None:
    """Print the settings, best first."""
    arguments = asked(Options)
    vocabulary = load_vocabulary()
    names = {entry.id: entry.name for entry in vocabulary.classes}
    predictor = load_predictor(arguments.weights, vocabulary)
    frames = FrameSet(arguments.data / "validation")
    choices: list[dict[str, Any]] = [dict(zip(GRID, values, strict=True)) for values in product(*GRID.values())]
    sums: list[dict[str, ClassQuality]] = [{} for _ in choices]
    for index in range(0, len(frames), arguments.every):
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
                quality = panoptic_quality(truth, ids, dict(enumerate(frame.classes, start=1)), named, STUFF)
                for name, entry in quality.items():
                    into[name] = into.get(name, ClassQuality()) + entry
    ranked = sorted(
        ((average_quality(into.values()).pq or 0.0, choice) for choice, into in zip(choices, sums, strict=True)),
        key=lambda entry: -entry[0],
    )
    for quality_of_choice, choice in ranked:
        print(f"{100 * quality_of_choice:.2f}  {choice}")


if __name__ == "__main__":
    main()
