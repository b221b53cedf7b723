"""Train the trees that tell backend `objects` which patches are one object.

    scenewright train tabletop-pairs --data FOLDER --out FOLDER [--quick] [--ship]

Pairs of patches come from generated tabletops (tabletops.py, seeds 0 up) and from the `learn`
frames of the mOSD tabletops below `--data`; never from `test`. First trees are grown on the pairs that grouping by the
truth meets; the second ones on those and on the pairs that the first trees meet when they group themselves, so that
they know their own mistakes. Real pairs weigh more. Five-fold cross-validation over the `learn` frames follows.
Writes `tabletop_pairs.safetensors` and `cross_validation.json`; `--ship` copies the trees to data/networks. About 15
minutes on one core; generated frames are kept below `--out`. The seed is fixed: the same libraries give the same bytes.
"""

from __future__ import annotations

import json
import logging
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.mosd_frames import CAMERA, FOLDER, LabelledFrame, read_frames
from scenewright.stages.kit.measurement.object_masks import score_object_masks
from scenewright.stages.segment.backends.objects.backend import BUNDLED
from scenewright.stages.segment.backends.objects.boosting import Trees, write_trees
from scenewright.stages.segment.backends.objects.grouping import PairScorer, by_trees
from scenewright.stages.segment.backends.objects.pairs import FEATURES
from scenewright.stages.segment.backends.objects.segmentation import BY_SET_RULES, segment_objects
from scenewright.stages.segment.training.tabletop_pairs import PairsTraining
from scenewright.stages.segment.training.tabletop_pairs.pair_recording import pairs_of_frame
from scenewright.stages.segment.training.tabletop_pairs.tabletops import make_tabletop
from scenewright.stages.segment.training.tabletop_pairs.tree_growing import grow_trees

_LOGGER = logging.getLogger("scenewright")
GENERATED, GENERATED_QUICK = 160, 10
FIRST_TREES, LAST_TREES = 120, 240
REAL_WEIGHT = 4.0
"""A real pair weighs as much as so many generated ones."""
BY_TRUTH = 0.3
"""Share of the joints in the second recording that follow the truth."""
FOLDS = 5
"""Folds of the cross-validation over frames."""
SEED = 0
"""Seed of the pairs that are drawn and of the trees."""


@dataclass(frozen=True)
class Pairs:
    """Features (N, F) float32 and answers (N,) float 0/1 of the pairs of one frame."""

    features: np.ndarray
    answers: np.ndarray


def generated_frames(count: int, folder: Path) -> Iterable[LabelledFrame]:
    """Yield generated tabletops, made once and kept in `folder` as .npz."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(count):
        path = folder / f"{seed}.npz"
        if not path.is_file():
            made = make_tabletop(seed)
            np.savez(path, color=made.color, depth=made.depth, labels=made.labels)
        with np.load(path, allow_pickle=False) as kept:
            yield LabelledFrame(str(seed), kept["color"], kept["depth"], kept["labels"], kept["labels"])


def record_pairs(frames: Iterable[LabelledFrame], scorer: PairScorer, by_truth: float) -> list[Pairs]:
    """Return the pairs that grouping meets in every frame."""
    result = []
    for k, frame in enumerate(frames):
        recording = pairs_of_frame(frame, scorer, by_truth, np.random.default_rng([SEED, k]))
        known = recording.answers >= 0
        result.append(Pairs(recording.features[known], recording.answers[known].astype(float)))
    return result


def grown(generated: list[Pairs], real: list[Pairs], trees: int) -> Trees:
    """Return trees grown on the pairs of generated and of real frames."""
    features = np.concatenate([pairs.features for pairs in [*generated, *real]])
    answers = np.concatenate([pairs.answers for pairs in [*generated, *real]])
    weights = np.ones(len(answers))
    weights[sum(len(pairs.answers) for pairs in generated) :] = REAL_WEIGHT
    return grow_trees(features, answers, weights, np.random.default_rng(SEED), trees=trees)


def cross_validate(generated: list[Pairs], real: list[list[Pairs]], frames: list[LabelledFrame]) -> dict[str, float]:
    """Return mean measures over the real frames, each scored by trees that did not see its fold.

    `real` holds, for every recording, the pairs of every frame. Neighbours in the numbering show the same things from
    other sides, so that a fold is a run of consecutive frames.
    """
    scores = []
    for fold in np.array_split(np.arange(len(frames)), FOLDS):
        seen = [pairs for recording in real for k, pairs in enumerate(recording) if k not in fold]
        trees = grown(generated, seen, LAST_TREES)
        for k in fold:
            found = segment_objects(frames[k].color, frames[k].depth, CAMERA, by_trees(trees)).labels
            scores.append(score_object_masks(frames[k].objects, found))
    return {
        "overlap_f": float(np.mean([score.overlap.f for score in scores])),
        "boundary_f": float(np.mean([score.boundary.f for score in scores])),
        "right_count": float(np.mean([score.right_count for score in scores])),
    }


def train(options: PairsTraining, out: Path) -> None:
    """Record, train, validate, write."""
    real_frames = read_frames(options.data / FOLDER / "learn")
    folder, count = out / "tabletops", GENERATED_QUICK if options.quick else GENERATED
    generated = record_pairs(generated_frames(count, folder), BY_SET_RULES, 1.0)
    real = [record_pairs(real_frames, BY_SET_RULES, 1.0)]
    first = grown(generated, real[0], FIRST_TREES)
    generated += record_pairs(generated_frames(count, folder), by_trees(first), BY_TRUTH)
    real.append(record_pairs(real_frames, by_trees(first), BY_TRUTH))
    trees = grown(generated, [pairs for recording in real for pairs in recording], LAST_TREES)
    weights = out / BUNDLED.name
    write_trees(weights, trees, FEATURES, f"{count} generated tabletops and mOSD learn, seed {SEED}")
    if options.ship:
        BUNDLED.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(weights, BUNDLED)
    measures = cross_validate(generated, real, real_frames)
    measures["generated_pairs"] = float(sum(len(pairs.answers) for pairs in generated))
    measures["real_pairs"] = float(sum(len(pairs.answers) for recording in real for pairs in recording))
    (out / "cross_validation.json").write_text(json.dumps(measures, indent=2) + "\n")
    _LOGGER.info("%s", measures)
