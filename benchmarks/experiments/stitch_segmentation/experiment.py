"""The network's masks of needle and thread on held-out rendered views, and the needle's pose from them.

Estimators run on spoiled true masks and on learned
ones. Times are CPU times of one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import torch
from scenewright.stages.suture import (
    CALIBRATION_ERROR,
    NEEDLE,
    NEEDLE_RADIUS,
    THREAD,
    TWO_CAMERAS,
    Estimate,
    Eye,
    Masks,
    NeedleScene,
    Segmenter,
    estimate,
    estimate_without_radius,
    judged,
    kept_view,
    learned_masks,
    read_eye,
    seen_scene,
    thesis_estimate,
)
from scenewright.stages.suture.training.network.views import EYES

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.stitch_needle.experiment import MEASURES as POSES
from benchmarks.experiments.stitch_needle.views import CASES, observe
from benchmarks.stitch.kept_views import ViewParameters, views_of

TUNING, SEEDS = range(450, 550), range(4200, 4300)
"""The second were measured before: they are not fresh."""
VIEWS, NETWORK = "views", "network"
ESTIMATORS = {"thesis": thesis_estimate, "ours": estimate}
MASKS = ("spoiled", "learned")
FITTED = "fitted_learned"
"""Ours that is not told the needle's radius, from the network's masks."""
HOLDERS, LIGHTS = ("air", "left", "right", "both", "tissue"), ("dim", "ordinary", "bright")
CLOSE = 3.0
"""An end is close to the mask within so many pixels."""
PICTURED, HALF_WIDTH, HALF_HEIGHT = 6, 100, 75
COLOURS = {
    NEEDLE: ((60, 220, 60), (255, 30, 30), (40, 70, 255)),
    THREAD: ((250, 230, 60), (255, 140, 0), (60, 240, 255)),
}
AT_AN_END = 3
"""An eye sees an end if it sees one of so many samples of the arc next to it (1.5 degrees each)."""


@dataclass(frozen=True)
class MaskRecord:
    """Counts of pixels of one eye's picture: found and true, and found or true; of thread also those found that lie
    within a pixel of true thread, and true ones within a pixel of found thread. `tip`, `swage`: the distance [px] from
    the projected end to the found needle, -1 where this eye does not see the end. `two_mm`: 2 mm at the needle, [px].
    """

    holder: str
    light: str
    needle_both: int
    needle_either: int
    needle_true: int
    thread_both: int
    thread_either: int
    thread_true: int
    thread_true_near: int
    thread_found: int
    thread_found_near: int
    tip: float
    swage: float
    two_mm: float
    seconds: float


Masked = tuple[MaskRecord, ...]
"""Of both eyes."""


class Fitted(Estimate):
    """An estimate whose radius was fitted: the radius and its standard deviation [mm], -1 where none was."""

    radius_mm: float
    radius_deviation_mm: float


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
    scene: NeedleScene, name: str, eye: Eye, bodies: np.ndarray, found: Masks, seconds: float
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


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Masked | Fitted | Estimate]]:
    """Yield the masks of both eyes of one view, and the estimates of its needle from spoiled and learned masks."""
    torch.set_num_threads(1)
    seed, segmenter = int(trials[0].seed), Segmenter.load(bench.parameters.checkpoint)
    stem = kept_view(views_of(bench), TWO_CAMERAS, seed)
    scene, view = seen_scene(seed, TWO_CAMERAS, calibration_error=CALIBRATION_ERROR)
    records, found, eyes = [], [], []
    for name, eye in zip(EYES, (view.left, view.right), strict=True):
        picture, bodies = read_eye(stem, name)
        started = time.process_time()
        masks = segmenter.masks(picture)
        seconds = time.process_time() - started
        records.append(mask_record(scene, name, eye, bodies, masks, seconds))
        found.append(masks)
        eyes.append(replace(eye, image=picture))
    spoiled = observe(replace(view, left=eyes[0], right=eyes[1]), CASES["rendered"].disparity_noise, seed)
    pictures = read_eye(stem, EYES[0])[0], read_eye(stem, EYES[1])[0]
    learned = learned_masks(*found).observation(TWO_CAMERAS, spoiled.disparity, pictures)
    given = {"spoiled": spoiled, "learned": learned}
    for trial in trials:
        if trial.arm == NETWORK:
            yield trial, tuple(records)
            continue
        arm, masks_are = trial.arm.split("_")
        started = time.process_time()
        if trial.arm == FITTED:
            answer, radius = estimate_without_radius(given[masks_are], seed)
            record = judged(arm, masks_are, seed, view, answer, time.process_time() - started)
            told = (-1.0, -1.0) if radius is None else (1000.0 * radius.metres, 1000.0 * radius.deviation)
            yield trial, Fitted(**record.model_dump(), radius_mm=told[0], radius_deviation_mm=told[1])
            continue
        answer = ESTIMATORS[arm](given[masks_are])
        yield trial, judged(arm, masks_are, seed, view, answer, time.process_time() - started)


def of_masks(which: Callable[[MaskRecord], bool]) -> tuple[str, Callable[[Masked | Estimate], Masked | None]]:
    """The pictures of some views."""
    return VIEWS, lambda record: record if isinstance(record, tuple) and which(record[0]) else None


def of_poses(which: Callable[[Estimate], bool]) -> tuple[str, Callable[[Masked | Estimate], Estimate | None]]:
    """The estimates in some views."""
    return VIEWS, lambda record: record if isinstance(record, Estimate) and which(record) else None


def pictured(figure: Callable[[list[MaskRecord]], float | None], interval: bool = False) -> Measure:
    """Return a measure over single pictures; None where the records are estimates."""

    def of(records: Sequence[Any]) -> float | None:
        return figure([eye for record in records for eye in record]) if isinstance(records[0], tuple) else None

    return Measure(of, interval=interval)


def share(part: str, whole: str) -> Measure:
    """Return a share of pixels, pooled over pictures."""
    return pictured(
        lambda eyes: sum(getattr(e, part) for e in eyes) / max(sum(getattr(e, whole) for e in eyes), 1), True
    )


def ends(which: str, near: Callable[[MaskRecord], float]) -> Measure:
    """Return the share of the ends that are seen which lie this near [px] to the mask."""

    def figure(eyes: list[MaskRecord]) -> float | None:
        hits = [getattr(eye, which) <= near(eye) for eye in eyes if getattr(eye, which) >= 0]
        return float(np.mean(hits)) if hits else None

    return pictured(figure)


def seen(which: str) -> Measure:
    """Count the ends that are seen."""
    return pictured(lambda eyes: float(sum(getattr(eye, which) >= 0 for eye in eyes)))


def middle(part: str, whole: str) -> Measure:
    """Return the median over pictures of a share of pixels."""
    return pictured(lambda eyes: float(np.median([getattr(e, part) / max(getattr(e, whole), 1) for e in eyes])))


def of_radius(figure: Callable[[np.ndarray, np.ndarray], float]) -> Measure:
    """Return a figure of the radii's errors and their standard deviations [mm], of answers alone."""

    def of(records: Sequence[Any]) -> float | None:
        said = [r for r in records if isinstance(r, Fitted) and r.answered and r.radius_mm > 0.0]
        if not said:
            return None
        errors = np.array([r.radius_mm for r in said]) - 1000.0 * NEEDLE_RADIUS
        return figure(errors, np.array([r.radius_deviation_mm for r in said]))

    return Measure(of)


RADII = {
    "radius_error_mm": of_radius(lambda errors, _: float(np.median(np.abs(errors)))),
    "radius_bias_mm": of_radius(lambda errors, _: float(np.mean(errors))),
    "radius_within_two_deviations": of_radius(lambda errors, sigmas: float(np.mean(np.abs(errors) <= 2.0 * sigmas))),
}
MEASURES = {
    "pictures": pictured(lambda eyes: float(len(eyes))),
    "needle_iou": share("needle_both", "needle_either"),
    "needle_iou_median": middle("needle_both", "needle_either"),
    "thread_iou": share("thread_both", "thread_either"),
    "thread_iou_median": middle("thread_both", "thread_either"),
    "thread_recall_1px": share("thread_true_near", "thread_true"),
    "thread_precision_1px": share("thread_found_near", "thread_found"),
    "tips_seen": seen("tip"),
    "tip_recall_2mm": ends("tip", lambda eye: eye.two_mm),
    "tip_recall_3px": ends("tip", lambda eye: CLOSE),
    "swages_seen": seen("swage"),
    "swage_recall_2mm": ends("swage", lambda eye: eye.two_mm),
    "swage_recall_3px": ends("swage", lambda eye: CLOSE),
    "cpu_seconds": pictured(lambda eyes: float(np.median([eye.seconds for eye in eyes]))),
}


def either(name: str) -> Measure:
    """Return the measure of this name, of masks or of poses, whichever the records are."""
    masks, poses = MEASURES.get(name), POSES.get(name)

    def of(records: Sequence[Any]) -> float | None:
        measure = masks if isinstance(records[0], tuple) else poses
        return measure.of(records) if measure else None

    return Measure(of, interval=any(m is not None and m.interval for m in (masks, poses)))


def pictures(results: Results) -> None:
    """Draw learned masks about the needle in masks.png, beside what they are made of. Green: needle found rightly, red:
    taken for needle, blue: missed; yellow: thread found rightly, orange: taken for thread, cyan: missed."""
    bench, pairs = results.bench, []
    for seed in map(int, results.seeds("all")[:PICTURED]):
        picture, bodies = read_eye(kept_view(views_of(bench), TWO_CAMERAS, seed), "left")
        found = Segmenter.load(bench.parameters.checkpoint).masks(picture)
        rows, columns = np.nonzero(bodies == NEEDLE)
        top = int(np.clip(rows.mean() - HALF_HEIGHT, 0, bodies.shape[0] - 2 * HALF_HEIGHT))
        left = int(np.clip(columns.mean() - HALF_WIDTH, 0, bodies.shape[1] - 2 * HALF_WIDTH))
        window = np.s_[top : top + 2 * HALF_HEIGHT, left : left + 2 * HALF_WIDTH]
        painted = picture[window].copy()
        for body, mask in ((THREAD, found.thread), (NEEDLE, found.needle)):
            true, there = bodies[window] == body, mask[window]
            for where, colour in zip((true & there, there & ~true, true & ~there), COLOURS[body], strict=True):
                painted[where] = colour
        pairs.append(np.hstack([picture[window], painted]))
    if pairs:
        image = np.vstack(pairs)[..., ::-1]
        cv2.imwrite(str(bench.out / "masks.png"), cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST))


EXPERIMENT = Experiment(
    name="stitch_segmentation",
    title="Needle and thread in a picture",
    simulated="Pairs of the one rendered world the network was trained on; disparity is true with noise.",
    knows="The picture; for the pose the needle's taper, and its radius but for the arm that fits it.",
    does_not_show=(
        "Real pictures: the network has seen one rendered world, one pad, one needle, one kind of driver, and "
        "was trained once. Disparity is no matcher's. Needles of another radius: the fitted radius is the "
        "usual needle's. The aim for needles not near edge-on is missed by far."
    ),
    arms={name: name for name in (NETWORK, *(f"{arm}_{masks}" for masks in MASKS for arm in ESTIMATORS), FITTED)},
    cases=(VIEWS,),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, SEEDS)),
    together=lambda trial: trial.seed,
    measure=measure,
    record=Masked | Fitted | Estimate,
    subcases={
        "all": of_masks(lambda record: True),
        **{f"holder_{h}": of_masks(lambda record, h=h: record.holder == h) for h in HOLDERS},  # type: ignore[misc]
        **{f"light_{name}": of_masks(lambda record, n=name: record.light == n) for name in LIGHTS},  # type: ignore[misc]
        "needle_visible": of_poses(lambda record: record.visible),
        "needle_all": of_poses(lambda record: True),
    },
    measures={name: either(name) for name in dict.fromkeys((*MEASURES, *POSES))} | RADII,
    parameters=ViewParameters,
    places=frozenset({"views", "checkpoint"}),
    inputs=lambda bench, trial: [bench.parameters.checkpoint],
    pairs=tuple((f"ours_{masks}", f"thesis_{masks}") for masks in MASKS),
    compared=("within_tolerance",),
    quick_seeds=4,
    pictures=pictures,
)
