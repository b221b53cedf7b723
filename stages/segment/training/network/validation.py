"""How good a checkpoint is on the validation frames: PQ per class, with and without colour and gravity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, panoptic_quality
from scenewright.stages.segment.backends.network.backend import Predictor
from scenewright.stages.segment.backends.network.features import Mount
from scenewright.stages.segment.training.network.samples import FrameSet


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


def qualities(predictor: Predictor, frames: FrameSet) -> dict[str, dict[str, float]]:
    """Return what is shown -> PQ, SQ and RQ, means over the classes (`classes` of them), and `PQ of` each."""
    found: dict[str, dict[str, float]] = {}
    for shown, known in KNOWN.items():
        sums = quality_of(predictor, frames, range(len(frames)), color=known.color, gravity=known.gravity)
        mean = average_quality(sums.values())
        found[shown] = {"pq": mean.pq or 0.0, "sq": mean.sq or 0.0, "rq": mean.rq or 0.0, "classes": mean.classes}
        found[shown] |= {f"PQ of {name}": entry.pq or 0.0 for name, entry in sums.items()}
    return found
