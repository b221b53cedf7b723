"""The step `suture needle`: every pair's masks to a pose or an abstention, the frames filtered to one, and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.disparity import Disparity
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.suture_needle import NeedleFrame, SutureNeedle, SutureNeedleFile
from scenewright.schemas.suture_scene import SutureScene, SutureView
from scenewright.stages.kit.formats.disparity_file import DisparityReader
from scenewright.stages.kit.stage import Context
from scenewright.stages.suture.masks import EyeMasks, MaskMaker, open_masks
from scenewright.stages.suture.motion_reports import motions_to_last
from scenewright.stages.suture.needle.drawing import draw_eyes, estimate_text
from scenewright.stages.suture.needle.estimators import ESTIMATORS
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.needle.radius import as_if_usual, in_metres
from scenewright.stages.suture.needle.radius_fit import Radius, estimate_without_radius, together, with_radius_unknown
from scenewright.stages.suture.needle.records import as_estimate_record
from scenewright.stages.suture.pairs import Pair, StereoPairs
from scenewright.stages.suture.parameters import NeedleParameters
from scenewright.stages.suture.rig import NeedlePose, StereoRig

RADIUS_FRAMES = 20
"""Number of first frames from which a radius is fitted; by eye."""


def run(
    sequence: Sequence,
    disparity: Disparity | None,
    masks: Path | None,
    segmenter: Path | None,
    *,
    parameters: NeedleParameters,
    context: Context,
) -> SutureNeedle:
    """Estimate the needle in every pair. The outcome is `abstained` when no pose can be given."""
    views = sequence.truth.views if isinstance(sequence, SutureScene) else ()
    with StereoPairs(sequence) as pairs:
        size = (pairs.camera.height, pairs.camera.width)
        make, source, masks_from = open_masks(sequence, masks, segmenter, parameters, size)
        motion = _motion(sequence, parameters, len(pairs))
        fitted = _fit_radius(pairs, make, context) if parameters.fit_radius else None
        maps = _disparity_maps(disparity)
        try:
            looked = Looked(fitted or Radius(parameters.needle_radius, 0.0), motion != "none")
            frames, answers = _estimates(pairs, make, maps, views, looked, parameters, context)
        finally:
            if maps is not None:
                maps.close()
        record = pairs.record
    if not frames:
        raise BadInput(f"{sequence.root}: no frame has both eyes", hint="ingest both eyes")
    fused = _filter_frames(answers, motion, views, parameters.estimator)
    statement = _statement(answers, fused)
    if parameters.fit_radius:
        statement += (
            "; no radius could be fitted, as no frame shows a needle for sure: the one that was told is used"
            if fitted is None
            else f"; its radius is {1000 * fitted.metres:.2f} mm, known to {1000 * fitted.deviation:.2f} mm"
        )
    SutureNeedleFile(
        statement=statement,
        estimator=parameters.estimator,
        masks=source,
        masks_from=masks_from,
        disparity="" if disparity is None else disparity.matching.detail,
        rig=record,
        needle_radius=looked.radius.metres,
        needle_radius_deviation=None if fitted is None else fitted.deviation,
        frames=tuple(frames),
        filtered=None if fused is None else as_estimate_record(fused),
        filter=motion,  # type: ignore[arg-type]
    ).write(context.output / "needle.json")
    answered = sum(not answer.abstained for answer in answers)
    is_known = answered > 0 if fused is None else not fused.abstained
    summary: dict[str, object] = {"frames": len(frames), "answered": answered, "masks": source, "filter": motion}
    if not is_known:
        summary["reason"] = statement
    return SutureNeedle(root=context.output, outcome="ok" if is_known else "abstained", summary=summary)


@dataclass(frozen=True)
class Looked:
    """How frames are looked at: for a needle of which radius (deviation 0: it was told), and whether each frame's pose
    is a start of the next one's."""

    radius: Radius
    follows: bool


def _fit_radius(pairs: StereoPairs, make: MaskMaker, context: Context) -> Radius | None:
    """Return the radius that the first frames say together; None where none of them shows a needle for sure."""
    first = islice(pairs, RADIUS_FRAMES)
    tracked = context.progress.track(first, total=min(RADIUS_FRAMES, len(pairs)), description="radius")
    seen = (make(pair).observation(pairs.rig, None, pair.pictures) for pair in tracked)
    radii = [radius for _, radius in (estimate_without_radius(one, context.seed) for one in seen) if radius is not None]
    return together(radii) if radii else None


class _Maps:
    """The disparities of a `disparity` artifact by stamp."""

    def __init__(self, disparity: Disparity) -> None:
        self._root = disparity.root
        self._reader = DisparityReader(disparity.path("disparity.mcap"))
        self._stamps = set(self._reader.stamps)

    def close(self) -> None:
        """Close the file."""
        self._reader.__exit__(None, None, None)

    def of(self, pair: Pair) -> np.ndarray | None:
        """Return a pair's disparity (H, W) float32, NaN unknown; None where the step left the frame out. Raises
        BadInput for a map of another size."""
        if pair.stamp not in self._stamps:
            return None
        disparity = self._reader.read(pair.stamp).disparity
        if disparity.shape != pair.left.shape[:2]:
            raise BadInput(
                f"{self._root}: the disparity of frame {pair.index} is {disparity.shape[1]} x {disparity.shape[0]}, "
                f"the images are {pair.left.shape[1]} x {pair.left.shape[0]}",
                hint="make the disparity of this sequence",
            )
        return disparity


def _disparity_maps(disparity: Disparity | None) -> _Maps | None:
    return None if disparity is None else _Maps(disparity)


def _motion(sequence: Sequence, parameters: NeedleParameters, frames: int) -> str:
    """Return how the needle is carried from frame to frame. Raises BadInput where kinematics are asked for and are not
    there."""
    scene = sequence.truth if isinstance(sequence, SutureScene) else None
    reported = scene is not None and scene.arrangement == "motion" and frames > 1
    if parameters.filter == "auto":
        return "kinematics" if reported else "none"
    if parameters.filter == "kinematics" and not reported:
        raise BadInput(
            f"{sequence.root}: it reports no motion of the needle between frames",
            hint="--filter still for a needle at rest, else --filter none",
        )
    return parameters.filter


def _estimates(
    pairs: StereoPairs,
    make: MaskMaker,
    maps: _Maps | None,
    views: tuple[SutureView, ...],
    looked: Looked,
    parameters: NeedleParameters,
    context: Context,
) -> tuple[list[NeedleFrame], list[NeedleEstimate]]:
    """Return every frame's record and estimate, and draw the first few."""
    frames: list[NeedleFrame] = []
    answers: list[NeedleEstimate] = []
    of_view = ESTIMATORS[parameters.estimator].of_view
    guess: NeedlePose | None = None
    matched = 0
    radius = looked.radius.metres
    rig = as_if_usual(pairs.rig, radius)
    for pair in context.progress.track(pairs, total=len(pairs), description="needles"):
        disparity = None if maps is None else maps.of(pair)
        matched += disparity is not None
        eye_masks = make(pair)
        observation = eye_masks.observation(rig, disparity, pair.pictures)
        answer = of_view(observation, context.seed, guess if looked.follows else None)
        guess = answer.pose if not answer.abstained else None
        estimate_in_metres = in_metres(answer, radius)
        if looked.radius.deviation > 0.0:
            estimate_in_metres = with_radius_unknown(estimate_in_metres, answer, observation, looked.radius)
        answers.append(estimate_in_metres)
        pixels = (int(eye_masks.needle[0].sum()), int(eye_masks.needle[1].sum()))
        frames.append(
            NeedleFrame(
                frame=pair.index, time=pair.time, estimate=as_estimate_record(estimate_in_metres), mask_pixels=pixels
            )
        )
        if len(frames) <= parameters.pictures:
            _draw(context.output / "pictures", pair, eye_masks, rig, answer, views)
    if maps is not None and frames and not matched:
        raise BadInput("the disparity has none of the sequence's frames", hint="make the disparity of this sequence")
    return frames, answers


def _draw(
    folder: Path, pair: Pair, seen: EyeMasks, rig: StereoRig, answer: NeedleEstimate, views: tuple[SutureView, ...]
) -> None:
    folder.mkdir(exist_ok=True)
    truth = NeedlePose(np.array(views[pair.index].camera_from_needle)) if pair.index < len(views) else None
    picture = draw_eyes((pair.left, pair.right), seen.needle, rig, answer, truth)
    path = folder / f"{pair.index:06d}.png"
    if not cv2.imwrite(str(path), picture[..., ::-1]):
        raise OSError(f"{path} could not be written")


def _filter_frames(
    answers: list[NeedleEstimate], motion: str, views: tuple[SutureView, ...], estimator: str
) -> NeedleEstimate | None:
    """Return one estimate in the last frame from all frames, None where they are not filtered."""
    if motion == "none":
        return None
    steps = [np.eye(4)] * (len(answers) - 1)
    if motion == "kinematics":
        reports: Mapping[int, object] = {view.frame: view.reported_motion for view in views}
        steps = [np.array(reports[index]) for index in range(1, len(answers))]
    return ESTIMATORS[estimator].of_frames(answers, motions_to_last(steps))


def _statement(answers: list[NeedleEstimate], fused: NeedleEstimate | None) -> str:
    if fused is not None:
        return f"filtered over {len(answers)} frames: {estimate_text(fused)}"
    if len(answers) == 1:
        return estimate_text(answers[0])
    answered = [answer for answer in answers if not answer.abstained]
    if answered:
        return f"the needle is known in {len(answered)} of {len(answers)} frames"
    return f"the needle is known in none of {len(answers)} frames; in the last: {answers[-1].abstained}"
