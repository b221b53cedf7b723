"""The network's masks of needle and thread on held-out rendered views, and the needle's pose from them.

    python -m benchmarks.stitch.segmentation --out FOLDER [--views FOLDER] [--checkpoint FILE] [--quick] [--tuning]
        [--count N] [--seconds S]

Reporting seeds begin at 1300 (those from 1000 on were seen with an earlier estimator), tuning seeds (`--tuning`) at
450. Writes segmentation.jsonl (a picture a line), needle.jsonl (the estimators on spoiled true masks and on learned
ones), metrics.json and table.md. A stopped run goes on; `--seconds` stops early, between two views. Times are CPU times
of one thread.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import torch

from benchmarks.stitch.needle_records import Estimate, read_estimates
from benchmarks.stitch.needle_trials import TWO_CAMERAS_NOISE, judged, observe
from benchmarks.stitch.segmentation_records import MaskRecord, read_masks
from benchmarks.stitch.segmentation_tables import metrics, table
from benchmarks.stitch.segmentation_views import CALIBRATION_ERROR, EYES, kept_view, read_eye
from stages.suture.masks import learned_masks
from stages.suture.needle.estimate import estimate
from stages.suture.needle.thesis import thesis_estimate
from stages.suture.rig import TWO_CAMERAS, StereoRig
from stages.suture.segmentation.checkpoint import BUNDLED
from stages.suture.segmentation.infer import Masks, Segmenter
from stages.suture.world.render import Eye, StereoView
from stages.suture.world.sampling import seen_scene
from stages.suture.world.scene import NeedleScene
from stages.suture.world.tubes import NEEDLE, THREAD

REPORTING, TUNING, COUNT, QUICK = 1300, 450, 100, 4
AT_AN_END = 3
"""An eye sees an end if it sees one of so many samples of the arc next to it (1.5 degrees each)."""


def light_of(scene: NeedleScene) -> str:
    """Return whether the scene is dim, ordinary or bright: the lamps' strength times the exposure."""
    strength = float(scene.light.lamps[:, 3].sum()) * scene.light.exposure
    return "dim" if strength < 0.8 else "bright" if strength > 1.1 else "ordinary"


def _near(mask: np.ndarray) -> np.ndarray:
    """Return the mask grown by a pixel to each side."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0


def _to_mask(mask: np.ndarray, pixel: np.ndarray) -> float:
    """Return the distance [px] from a pixel (column, row) to the mask; the picture's width where there is none."""
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return float(mask.shape[1])
    return float(np.hypot(columns - pixel[0], rows - pixel[1]).min())


def mask_record(
    scene: NeedleScene, seed: int, name: str, eye: Eye, bodies: np.ndarray, found: Masks, seconds: float
) -> MaskRecord:
    """Return the record of one eye; `bodies` (H, W) are the true ones, `eye` says which part of the arc is seen."""
    rig = scene.rig
    needle, thread = bodies == NEEDLE, bodies == THREAD
    ends = np.stack([scene.pose.tip, scene.pose.swage])
    pixels = rig.left(ends) if name == "left" else rig.right(ends)
    seen = (eye.sees[:AT_AN_END].any(), eye.sees[-AT_AN_END:].any())
    tip, swage = (
        _to_mask(found.needle, pixel) if visible else -1.0 for pixel, visible in zip(pixels, seen, strict=True)
    )
    return MaskRecord(
        rig="cameras",
        seed=seed,
        eye=name,
        holder=scene.holder,
        light=light_of(scene),
        needle_both=int((needle & found.needle).sum()),
        needle_either=int((needle | found.needle).sum()),
        needle_true=int(needle.sum()),
        thread_both=int((thread & found.thread).sum()),
        thread_either=int((thread | found.thread).sum()),
        thread_true=int(thread.sum()),
        thread_true_near=int((thread & _near(found.thread)).sum()),
        thread_found=int(found.thread.sum()),
        thread_found_near=int((found.thread & _near(thread)).sum()),
        tip=tip,
        swage=swage,
        two_mm=0.002 * rig.focal / float(scene.pose.centre[2]),
        seconds=seconds,
    )


def run(folder: Path, rig: StereoRig, seed: int, segmenter: Segmenter) -> tuple[list[MaskRecord], list[Estimate]]:
    """Return the mask records of both eyes of the view of `seed` and the four estimates of its needle."""
    stem = kept_view(folder, rig, seed)
    scene, view = seen_scene(seed, rig, calibration_error=CALIBRATION_ERROR)
    records, found, eyes = [], [], []
    for name, eye in zip(EYES, (view.left, view.right), strict=True):
        picture, bodies = read_eye(stem, name)
        started = time.process_time()
        masks = segmenter.masks(picture)
        seconds = time.process_time() - started
        records.append(mask_record(scene, seed, name, eye, bodies, masks, seconds))
        found.append(masks)
        eyes.append(replace(eye, image=picture))
    pictured: StereoView = replace(view, left=eyes[0], right=eyes[1])
    spoiled = observe(pictured, TWO_CAMERAS_NOISE, seed)
    learned = learned_masks(*found).observation(rig, spoiled.disparity)
    estimates = []
    for case, observation in (("spoiled", spoiled), ("learned", learned)):
        for arm, function in (("thesis", thesis_estimate), ("ours", estimate)):
            started = time.process_time()
            answer = function(observation)
            estimates.append(judged(arm, case, seed, view, answer, time.process_time() - started))
    return records, estimates


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.segmentation", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--views", type=Path, help="where rendered views are kept; OUT/views if not given")
    parser.add_argument("--checkpoint", type=Path, default=BUNDLED)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} views")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    first = TUNING if options.tuning else REPORTING
    count = QUICK if options.quick else options.count
    segmenter = Segmenter.load(options.checkpoint)
    logs = options.out / "segmentation.jsonl", options.out / "needle.jsonl"
    done = {record.seed for record in read_estimates(logs[1])}
    began = time.monotonic()
    for seed in range(first, first + count):
        if seed in done:
            continue
        if options.seconds is not None and time.monotonic() - began > options.seconds:
            break
        records, estimates = run(options.views or options.out / "views", TWO_CAMERAS, seed, segmenter)
        for log, lines in zip(logs, (records, estimates), strict=True):
            with log.open("a", encoding="utf-8") as stream:
                stream.writelines(line.model_dump_json() + "\n" for line in lines)
    seeds = range(first, first + count)
    estimates = [record for record in read_estimates(logs[1]) if record.seed in seeds]
    whole = {record.seed for record in estimates}
    masks = {(record.seed, record.eye): record for record in read_masks(logs[0]) if record.seed in whole}
    numbers = metrics(list(masks.values()), estimates)
    (options.out / "metrics.json").write_text(json.dumps(numbers, indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(list(masks.values()), estimates), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
