"""The weights by which outlines of a needle are held against each other, by conditional logistic regression.

    scenewright train needle-evidence --out FOLDER

Of every tuning view (needle world before two cameras and an endoscope, states of suture trials; none is a training view
of the network) the rivals that the estimator fits are kept, from spoiled masks and from the network's. The
right one is that within a robot's tolerance with its ends named rightly; views without it are left out. Says, by the
strength of the ridge, the constants of stages/suture/needle/evidence.py and how well they and those of now tell the
right one, left out by seed; the ridge of the least surprise in the mean over the groups of views is taken.
"""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.evaluation.judgement import judged
from scenewright.stages.suture.masks import learned_masks, spoiled_masks
from scenewright.stages.suture.needle.estimate import FEWEST_PIXELS, hypotheses
from scenewright.stages.suture.needle.evidence import WEIGHTS
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.needle.windows import needle_masks
from scenewright.stages.suture.rig import ENDOSCOPE, TWO_CAMERAS
from scenewright.stages.suture.segmentation.infer import Segmenter
from scenewright.stages.suture.training.needle_evidence import EvidenceTraining
from scenewright.stages.suture.training.network.trial_views import trial_scenes
from scenewright.stages.suture.training.network.views import CALIBRATION_ERROR
from scenewright.stages.suture.world.corruption import noisy_disparity
from scenewright.stages.suture.world.render import StereoView, render
from scenewright.stages.suture.world.sampling import seen_scene
from scipy.optimize import minimize

_LOGGER = logging.getLogger("scenewright")
CAMERAS, ENDOSCOPES, TRIALS = range(400, 424), range(400, 412), range(860, 872)
FOLDS, RIDGES = 10, (0.3, 0.1, 0.03, 0.01)
THREADS = slice(6, None)
"""Terms of thread. The others were fitted on 300 views of spoiled masks and stand."""
NOISE = 1.0
"""Standard deviation of the noise of a disparity [px]."""


def rendered(quick: bool) -> Iterator[tuple[str, StereoView]]:
    """Yield the views with their names; with `quick` those of every sixth seed."""
    some = slice(None, None, 6 if quick else None)
    for seed in CAMERAS[some]:
        yield f"cameras {seed}", render(seen_scene(seed, TWO_CAMERAS, calibration_error=CALIBRATION_ERROR)[0])
    for seed in TRIALS[some]:
        for scene in trial_scenes(seed):
            yield f"trial {seed} {scene.place}", render(scene)
    for seed in ENDOSCOPES[some]:
        yield f"endoscope {seed}", render(seen_scene(seed, ENDOSCOPE, calibration_error=CALIBRATION_ERROR)[0])


def rivals(view: StereoView, segmenter: Segmenter, name: str) -> list[dict[str, Any]]:
    """Return of either masks the terms (N, F) of the rivals of one view and which of them are right."""
    spoiled, random = spoiled_masks(view.left, view.right, int(name.split()[1]))
    disparity = noisy_disparity(view, NOISE, random)
    assert view.left.image is not None and view.right.image is not None
    learned = learned_masks(segmenter.masks(view.left.image), segmenter.masks(view.right.image))
    lines = []
    for kind, masks in (("spoiled", spoiled), ("learned", learned)):
        observation = masks.observation(view.rig, disparity)
        if min(int(mask.sum()) for mask in needle_masks(observation)) < FEWEST_PIXELS:
            continue
        found = hypotheses(observation)
        seen = [judged("", "", 0, view, NeedleEstimate(one.pose, np.eye(6), 1.0, "")) for one in found]
        right = [record.right and not record.swapped for record in seen]
        lines.append({"view": name, "masks": kind, "terms": [h.evidence.terms.tolist() for h in found], "right": right})
    return lines


@dataclass(frozen=True)
class Sample:
    """The terms (N, F) of a view's rivals, which (N,) are right, the view's seed, and its group: world and masks."""

    terms: np.ndarray
    right: np.ndarray
    seed: int
    group: str


def sample_of(line: dict[str, Any]) -> Sample:
    """Return the sample that a kept line is."""
    world, seed, *_ = line["view"].split()
    group = f"{'trials' if world == 'trial' else 'views'}, {line['masks']} masks"
    return Sample(np.array(line["terms"]), np.array(line["right"]), int(seed), group)


def fitted(samples: list[Sample], ridge: float) -> np.ndarray:
    """Return weights (F,) under which the right ones are likely, those of thread with a ridge about the ones of now;
    every group of views counts alike."""
    spread = np.concatenate([sample.terms - sample.terms.mean(axis=0) for sample in samples]).std(axis=0)[THREADS]
    counts = Counter(sample.group for sample in samples)

    def weights(step: np.ndarray) -> np.ndarray:
        moved = WEIGHTS.copy()
        moved[THREADS] += step / spread
        return moved

    def loss(step: np.ndarray) -> float:
        told = [surprise(weights(step), sample) / counts[sample.group] for sample in samples]
        return sum(told) / len(counts) + ridge * float(step @ step)

    return weights(minimize(loss, np.zeros(len(spread))).x)


def surprise(weights: np.ndarray, sample: Sample) -> float:
    """Return the negative logarithm of the probability that the right ones get together."""
    logs = sample.terms @ weights
    return float(np.logaddexp.reduce(logs) - np.logaddexp.reduce(logs[sample.right]))


def left_out(samples: list[Sample], ridge: float | None) -> np.ndarray:
    """Return the surprise (N,) of every sample by weights fitted without its fold of seeds; by those of now for
    None."""
    told = np.empty(len(samples))
    for fold in range(FOLDS):
        others = [sample for sample in samples if sample.seed % FOLDS != fold]
        weights = WEIGHTS if ridge is None else fitted(others, ridge)
        for index, sample in enumerate(samples):
            if sample.seed % FOLDS == fold:
                told[index] = surprise(weights, sample)
    return told


def train(options: EvidenceTraining, out: Path) -> None:
    """Keep what is missing, fit, and say how well."""
    kept = options.rivals or out / "rivals.jsonl"
    known = {json.loads(line)["view"] for line in kept.read_text().splitlines()} if kept.is_file() else set()
    segmenter = Segmenter.load()
    with kept.open("a") as stream:
        for name, view in rendered(options.quick):
            if name not in known:
                stream.writelines(json.dumps(line) + "\n" for line in rivals(view, segmenter, name))
                stream.flush()
    lines = [json.loads(line) for line in kept.read_text().splitlines()]
    samples = [sample_of(line) for line in lines if any(line["right"]) and not all(line["right"])]
    if not samples:
        raise BadInput(
            f"{kept}: no view in which some rivals are right and some wrong", hint="leave --quick out: more views"
        )
    told = []
    for ridge in (None, *RIDGES):
        surprises = left_out(samples, ridge)
        for group in sorted({sample.group for sample in samples}):
            of = np.array([sample.group == group for sample in samples])
            entry = {"ridge": ridge, "group": group, "views": int(of.sum())}
            entry |= {
                "surprise": round(float(surprises[of].mean()), 3),
                "likelier than all": round(float((surprises[of] < np.log(2.0)).mean()), 3),
            }
            told.append(entry)
            _LOGGER.info("%s", entry)
    weights = {str(ridge): np.round(fitted(samples, ridge), 3).tolist() for ridge in RIDGES}
    for name, values in weights.items():
        _LOGGER.info("ridge %s: WEIGHTS = %s", name, values)
    (out / "weights.json").write_text(json.dumps({"left_out": told, "weights": weights}, indent=1) + "\n")
