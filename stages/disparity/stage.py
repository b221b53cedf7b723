"""The step `disparity`: check the eyes, match every pair, write the sequence again with the depth that follows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from scenewright.schemas.disparity import Disparity, DisparityFile, FrameDisparity, RowReport
from scenewright.schemas.sequence import Sequence, SequenceFile
from scenewright.stages.disparity import semi_global
from scenewright.stages.disparity.consistency import deviation_of
from scenewright.stages.disparity.eyes import check_eyes, is_blank, stereo_cameras
from scenewright.stages.disparity.parameters import DisparityParameters
from scenewright.stages.disparity.rectification import straightened
from scenewright.stages.disparity.search_range import search_range
from scenewright.stages.kit.formats.disparity_file import DisparityWriter
from scenewright.stages.kit.formats.foxglove import nanoseconds
from scenewright.stages.kit.formats.frames import Frame, FrameReader, FrameWriter
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.stage import Context
from scenewright.stages.kit.stereo.disparity_map import DisparityMap, depth_deviation, depth_of

Matcher = Callable[[np.ndarray, np.ndarray, tuple[int, int]], DisparityMap]
"""Left and right (H, W, 3) uint8 RGB, and the limits of the search -> map."""
NO_RIGHT_EYE, BLANK_EYE, NOTHING_MATCHES = "no_right_eye", "blank_eye", "nothing_matches"


@dataclass
class _Written:
    frames: list[FrameDisparity] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    cameras: Counter[str] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)


def run(sequence: Sequence, weights: Path | None, *, parameters: DisparityParameters, context: Context) -> Disparity:
    """Write frames.mcap with depth, disparity.mcap, disparity.json, sequence.json and trajectory.tum.

    The outcome is `not_rectified` when a camera's rows differ and were not put right, `empty` when no frame could be
    matched. Raises BadInput for a sequence with one eye, without a baseline, with swapped eyes.
    """
    with FrameReader(sequence.path("frames.mcap")) as reader:
        baselines = stereo_cameras(reader, sequence)
        with context.progress.step("check rows"):
            rows = {name: check_eyes(reader, name, sequence, parameters, context.logger) for name in sorted(baselines)}
        matcher, detail = open_matcher(parameters, weights, context)
        with context.progress.step("match"):
            written = _match_all(reader, sequence, baselines, rows, matcher, parameters, context)
    return _finish(sequence, written, rows, detail, parameters, context)


def open_matcher(parameters: DisparityParameters, weights: Path | None, context: Context) -> tuple[Matcher, str]:
    """Return the matcher of the options and what it is, for people. Raises BadInput for weights that do not fit."""
    return MATCHERS[parameters.method](parameters, weights, context)


def _semi_global(parameters: DisparityParameters, weights: Path | None, context: Context) -> tuple[Matcher, str]:
    settings = semi_global.SemiGlobalSettings(
        effort=parameters.effort,
        block_size=parameters.block_size,
        agreement=parameters.agreement,
        refine=parameters.refine,
    )
    return (
        lambda left, right, limits: semi_global.match(left, right, settings, limits),
        f"semi-global matching, effort {settings.effort}, blocks of {settings.block_size} px, both directions",
    )


def _raft_stereo(parameters: DisparityParameters, weights: Path | None, context: Context) -> tuple[Matcher, str]:
    assert weights is not None  # the declaration asks for them
    from scenewright.stages.disparity.raft.matching import open_raft

    return open_raft(weights, parameters.iterations, parameters.agreement, context.device)


MATCHERS: dict[str, Callable[[DisparityParameters, Path | None, Context], tuple[Matcher, str]]] = {
    "semi-global": _semi_global,
    "raft-stereo": _raft_stereo,
}


def _match_all(
    reader: FrameReader,
    sequence: Sequence,
    baselines: dict[str, float],
    rows: dict[str, RowReport],
    matcher: Matcher,
    parameters: DisparityParameters,
    context: Context,
) -> _Written:
    info, written = sequence.info, _Written()
    main = info.camera
    has_labels = "labels" in reader.streams
    cameras = {name: reader.cameras[name] for name in sorted(baselines)}
    with (
        FrameWriter(
            context.output / "frames.mcap",
            main,
            labels=has_labels,
            world_up=_world_up(reader),
            registered=True,
            label_table=reader.label_table,
            cameras=cameras,
            deviation=True,
        ) as frames,
        DisparityWriter(context.output / "disparity.mcap", cameras) as maps,
    ):
        for index in context.progress.track(range(len(reader)), total=len(reader), description="matching"):
            frame = reader.read(index, ("color", "right", "labels") if has_labels else ("color", "right"))
            if frame.color is None or frame.right is None:
                written.left_out[NO_RIGHT_EYE] += 1
                continue
            if is_blank(frame.color) != is_blank(frame.right):
                written.left_out[BLANK_EYE] += 1
                continue
            camera, baseline = cameras[frame.camera_name], baselines[frame.camera_name]
            left, right = frame.color, _straightened_right(frame, rows[frame.camera_name], reader)
            limits = _limits(left, right, parameters)
            matched = matcher(left, right, limits)
            depth = depth_of(matched.disparity, camera, baseline)
            depth[(matched.confidence < parameters.minimum_confidence) | (depth > parameters.maximum_depth)] = 0.0
            if not (depth > 0).any():
                written.left_out[NOTHING_MATCHES] += 1
                continue
            stamp = nanoseconds(frame.time)
            encoded = reader.encoded(index)
            frames.write(
                frame.time,
                encoded,
                depth,
                frame.world_from_camera,
                frame.labels,
                deviation=depth_deviation(depth, deviation_of(matched.confidence), camera, baseline),
                camera_name=frame.camera_name,
            )
            maps.write(stamp, frame.camera_name, matched)
            _note(written, index, frame, matched, depth, limits)
    return written


def _world_up(reader: FrameReader) -> Literal["z", "unknown"]:
    return "z" if reader.world_up == "z" else "unknown"


def _straightened_right(frame: Frame, report: RowReport, reader: FrameReader) -> np.ndarray:
    assert frame.right is not None
    if report.verdict != "corrected":
        return frame.right
    return straightened(frame.right, report.pitch or 0.0, report.roll or 0.0, reader.cameras[frame.camera_name])


def _limits(left: np.ndarray, right: np.ndarray, parameters: DisparityParameters) -> tuple[int, int]:
    if parameters.lowest_disparity is not None and parameters.levels is not None:
        return parameters.lowest_disparity, parameters.levels
    return search_range(semi_global.gray_of(left), semi_global.gray_of(right))


def _note(
    written: _Written, index: int, frame: Frame, matched: DisparityMap, depth: np.ndarray, limits: tuple[int, int]
) -> None:
    written.frames.append(
        FrameDisparity(
            frame=len(written.frames),
            input_frame=index,
            lowest=limits[0],
            levels=limits[1],
            known=round(float(matched.known.mean()), 4),
            trusted=round(float((depth > 0).mean()), 4),
            median_disparity=round(float(np.nanmedian(matched.disparity)), 3),
            median_depth=round(float(np.median(depth[depth > 0])), 4),
        )
    )
    written.cameras[frame.camera_name] += 1
    if frame.world_from_camera is not None:
        written.times.append(frame.time)
        written.poses.append(frame.world_from_camera)


def _finish(
    sequence: Sequence,
    written: _Written,
    rows: dict[str, RowReport],
    detail: str,
    parameters: DisparityParameters,
    context: Context,
) -> Disparity:
    info = sequence.info
    write_tum(context.output / "trajectory.tum", np.array(written.times), np.array(written.poses).reshape(-1, 4, 4))
    has = {*info.streams, "depth", "deviation"}
    SequenceFile.model_validate(
        info.model_dump()
        | {
            "notes": (*info.notes, f"depth from stereo: {detail}"),
            "camera": next(each.camera for each in info.cameras if each.name in rows),
            "cameras": tuple(
                each.model_dump() | {"frame_count": written.cameras[each.name], "baseline": None}
                for each in info.cameras
                if each.name in rows
            ),
            "streams": tuple(s for s in ("color", "depth", "labels", "pose", "deviation") if s in has),
            "frame_count": len(written.frames),
            "drops": dict(sorted((Counter(info.drops) + written.left_out).items())),
            "color_depth_registered": True,
        }
    ).write(context.output / "sequence.json")
    if sequence.sources is not None:
        sequence.sources.of_frames(each.input_frame for each in written.frames).write(context.output / "sources.json")
    DisparityFile(
        method=parameters.method,
        detail=detail,
        minimum_confidence=parameters.minimum_confidence,
        rows=tuple(rows[name] for name in sorted(rows)),
        frames=tuple(written.frames),
        left_out=dict(sorted(written.left_out.items())),
    ).write(context.output / "disparity.json")
    return Disparity(context.output, outcome=_outcome(written, rows), summary=_summary(written, rows))


def _outcome(written: _Written, rows: dict[str, RowReport]) -> str:
    if not written.frames:
        return "empty"
    return "not_rectified" if any(row.verdict == "not_rectified" for row in rows.values()) else "ok"


def _summary(written: _Written, rows: dict[str, RowReport]) -> dict[str, object]:
    summary: dict[str, object] = {
        "frames": len(written.frames),
        "left_out": sum(written.left_out.values()),
        "rows": "; ".join(f"{row.verdict}" for row in rows.values()),
    }
    errors = [row.row_error for row in rows.values() if row.row_error is not None]
    if errors:
        summary["row_error"] = max(errors)
    if written.frames:
        summary["known"] = round(float(np.mean([frame.known for frame in written.frames])), 3)
        summary["trusted"] = round(float(np.mean([frame.trusted for frame in written.frames])), 3)
    else:
        reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(written.left_out.items()))
        summary["reason"] = f"no frame could be matched ({reasons})"
    return summary
