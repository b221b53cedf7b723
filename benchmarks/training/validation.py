"""How good a checkpoint is on the validation frames: PQ per class, with and without colour and gravity.

python -m benchmarks.training.validation --data FOLDER --weights FILE [--every N]
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, panoptic_quality
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.backends.network.backend import Predictor, load_predictor
from scenewright.stages.segment.backends.network.features import Mount

from benchmarks.options import asked
from benchmarks.training.samples import FrameSet


@dataclass(frozen=True)
class Known:
    """What of a frame the network is shown beside its depth."""

    color: bool
    gravity: bool


KNOWN = {"all": Known(True, True), "no_colour": Known(False, True), "depth_alone": Known(False, False)}
STUFF = frozenset(entry.name for entry in load_vocabulary().classes if entry.kind == "stuff")


def quality_of(
    predictor: Predictor, frames: FrameSet, indices: range, *, color: bool, gravity: bool
) -> dict[str, ClassQuality]:
    """Return the sums of PQ per class over the frames with these numbers."""
    vocabulary = load_vocabulary()
    names = {entry.id: entry.name for entry in vocabulary.classes}
    sums: dict[str, ClassQuality] = {}
    for index in indices:
        frame = frames[index]
        mount = Mount(frame.up, frame.height) if gravity else Mount()
        found = predictor.predict(frame.depth, frame.color if color else None, frame.camera, mount)
        frame_sums = panoptic_quality(
            frame.labels.ravel().astype(np.int64),
            found.ids.ravel().astype(np.int64),
            dict(enumerate(frame.classes, start=1)),
            {number: names[mask.class_id] for number, mask in found.masks.items()},
            STUFF,
        )
        for name, entry in frame_sums.items():
            sums[name] = sums.get(name, ClassQuality()) + entry
    return sums


class Options(Parameters):
    """Options."""

    data: Path = Field(description="Folder of benchmarks.training.data")
    weights: Path = Field(description="Of the network")
    every: int = Field(1, description="Every so many frames")


def main() -> None:
    """Print PQ per class and its mean."""
    arguments = asked(Options)
    predictor = load_predictor(arguments.weights, load_vocabulary())
    frames = FrameSet(arguments.data / "validation")
    indices = range(0, len(frames), arguments.every)
    for shown, known in KNOWN.items():
        sums = quality_of(predictor, frames, indices, color=known.color, gravity=known.gravity)
        mean = average_quality(sums.values())
        print(f"{shown}, {len(indices)} frames:")
        print(f"  PQ {mean.pq:.3f}, SQ {mean.sq:.3f}, RQ {mean.rq:.3f} over {mean.classes} classes")
        print("  " + ", ".join(f"{name} {entry.pq:.2f}" for name, entry in sums.items()), flush=True)


if __name__ == "__main__":
    main()
