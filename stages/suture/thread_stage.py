"""The step `suture thread`: the thread's masks in both eyes to a curve in space, with pictures."""

from __future__ import annotations

import textwrap
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.suture_needle import SutureNeedle, SutureThread, SutureThreadFile, ThreadFrame
from scenewright.stages.kit.stage import Context
from scenewright.stages.suture.masks import EyeMasks, open_masks
from scenewright.stages.suture.needle.drawing import VIOLET, WHITE
from scenewright.stages.suture.needle.radius import swage_of
from scenewright.stages.suture.needle.records import as_estimate
from scenewright.stages.suture.pairs import Pair, StereoPairs
from scenewright.stages.suture.parameters import ThreadParameters
from scenewright.stages.suture.rig import StereoRig
from scenewright.stages.suture.thread.reconstruct import reconstruct_thread

WIDTH = 720
"""Width of each eye's picture [px]."""


def run(
    sequence: Sequence,
    needle: SutureNeedle | None,
    masks: Path | None,
    segmenter: Path | None,
    *,
    parameters: ThreadParameters,
    context: Context,
) -> SutureThread:
    """Trace the thread of every pair; the needle's swage, where it is known, says where the thread begins. Where no
    thread is seen there it begins anywhere, and a remark says so.

    The outcome is `not_traced` when no frame has a curve.
    """
    starts = _starts(needle)
    frames: list[ThreadFrame] = []
    curves: dict[str, np.ndarray] = {}
    with StereoPairs(sequence) as pairs:
        make, source, words = open_masks(
            sequence, masks, segmenter, parameters, (pairs.camera.height, pairs.camera.width)
        )
        for pair in context.progress.track(pairs, total=len(pairs), description="threads"):
            eye_masks = make(pair)
            start = starts.get(pair.index)
            curve = reconstruct_thread(*eye_masks.thread, pairs.rig, start=start)
            remarks = tuple(str(remark) for remark in curve.remarks)
            if start is not None and not len(curve.points):
                curve = reconstruct_thread(*eye_masks.thread, pairs.rig, start=None)
                remarks = (*remarks, *(str(remark) for remark in curve.remarks))
            points = np.asarray(curve.points, dtype=float).reshape(-1, 3)
            if len(points):
                curves[f"points_{pair.index:06d}"] = points
                curves[f"deviation_{pair.index:06d}"] = np.broadcast_to(
                    np.asarray(curve.standard_deviation, dtype=float), (len(points),)
                ).copy()
            frames.append(
                ThreadFrame(
                    frame=pair.index,
                    time=pair.time,
                    points=len(points),
                    length=float(curve.length_m) if len(points) else 0.0,
                    status=str(curve.status),
                    remarks=remarks,
                    mask_pixels=(int(eye_masks.thread[0].sum()), int(eye_masks.thread[1].sum())),
                )
            )
            if len(frames) <= parameters.pictures:
                _draw(context.output / "pictures", pair, eye_masks, pairs.rig, points, frames[-1])
        record = pairs.record
    if not frames:
        raise BadInput(f"{sequence.root}: no frame has both eyes", hint="ingest both eyes")
    np.savez_compressed(context.output / "threads.npz", allow_pickle=False, **curves)
    statement = _statement(frames)
    SutureThreadFile(
        statement=statement,
        masks=source,
        masks_from=words,
        rig=record,
        started_at_needle=bool(starts),
        frames=tuple(frames),
    ).write(context.output / "thread.json")
    traced = sum(frame.points > 0 for frame in frames)
    summary: dict[str, object] = {"frames": len(frames), "traced": traced, "masks": source}
    if not traced:
        summary["reason"] = statement
    return SutureThread(root=context.output, outcome="ok" if traced else "not_traced", summary=summary)


def _starts(needle: SutureNeedle | None) -> dict[int, np.ndarray]:
    """Return frame -> the swage (3,) [m] of the frames whose needle is known."""
    if needle is None:
        return {}
    starts = {}
    for frame in needle.info.frames:
        answer = as_estimate(frame.estimate)
        if answer.pose is not None and not answer.abstained:
            starts[frame.frame] = swage_of(answer.pose, needle.info.needle_radius)
    return starts


def _statement(frames: list[ThreadFrame]) -> str:
    traced = [frame for frame in frames if frame.points]
    if not traced:
        return f"no thread in {len(frames)} frames: {' '.join(frames[-1].remarks) or frames[-1].status}"
    lengths = ", ".join(f"{1000 * frame.length:.0f}" for frame in traced[:6])
    return f"thread of {lengths} mm in {len(traced)} of {len(frames)} frames"


def _draw(folder: Path, pair: Pair, seen: EyeMasks, rig: StereoRig, points: np.ndarray, frame: ThreadFrame) -> None:
    """Draw both eyes with the mask's outline (violet) and the curve (white), a line of text below."""
    folder.mkdir(exist_ok=True)
    panels = []
    for eye, picture in enumerate((pair.left, pair.right)):
        panel = picture.copy()
        outlines = cv2.findContours(seen.thread[eye].astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
        cv2.drawContours(panel, outlines, -1, VIOLET, 1)
        pixels = (rig.right if eye else rig.left)(points) if len(points) else np.zeros((0, 2))
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        line = np.clip(np.round(pixels), -10_000, 10_000).astype(np.int32).reshape(-1, 1, 2)
        if len(line) > 1:
            cv2.polylines(panel, [line], False, WHITE, 2, cv2.LINE_AA)
        scale = WIDTH / panel.shape[1]
        panels.append(cv2.resize(panel, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))
    row = np.hstack(panels)
    foot = np.full((40, row.shape[1], 3), 25, np.uint8)
    text = " ".join([f"{1000 * frame.length:.0f} mm; {frame.status}." if frame.points else "", *frame.remarks]).strip()
    cv2.putText(
        foot,
        textwrap.shorten(text, 118, placeholder=" ..."),
        (14, 27),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.6,
        WHITE,
        1,
        cv2.LINE_AA,
    )
    path = folder / f"{frame.frame:06d}.png"
    if not cv2.imwrite(str(path), np.vstack([row, foot])[..., ::-1]):
        raise OSError(f"{path} could not be written")
