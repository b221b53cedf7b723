"""Faults that are planted into a log in memory, and how the pre-flight has to name each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest import CameraReport, LoadedFrame, LogSource
from scenewright.stages.ingest.pose_conventions import BODY_FROM_OPTICAL, MIRROR_Y, OPENGL_AXES
from scenewright.stages.ingest.source import Entry
from scenewright.stages.kit.geometry.transforms import inverse, quaternion_of, transform_from_quaternion

Fault = Callable[[LogSource], LogSource]
Named = Callable[[CameraReport], bool]


def on_poses(change: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """A fault of every pose for itself."""

    def planted(source: LogSource) -> LogSource:
        return replace(source, entries=tuple(_posed(entry, change) for entry in source.entries))

    return planted


def _posed(entry: Entry, change: Callable[[np.ndarray], np.ndarray]) -> Entry:
    return (
        entry if entry.world_from_camera is None else replace(entry, world_from_camera=change(entry.world_from_camera))
    )


def reordered(order: tuple[int, int, int, int]) -> Callable[[np.ndarray], np.ndarray]:
    """Poses whose quaternion was written with one order and read with another."""
    return lambda pose: transform_from_quaternion(quaternion_of(pose)[list(order)], pose[:3, 3])


def stretched(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    """Poses with longer translations."""

    def change(pose: np.ndarray) -> np.ndarray:
        result = pose.copy()
        result[:3, 3] *= factor
        return result

    return change


def shifted_poses(frames: int) -> Fault:
    """Every frame has the pose of an earlier one."""

    def planted(source: LogSource) -> LogSource:
        poses = [entry.world_from_camera for entry in source.entries]
        entries = [replace(e, world_from_camera=poses[max(k - frames, 0)]) for k, e in enumerate(source.entries)]
        return replace(source, entries=tuple(entries))

    return planted


def frozen(source: LogSource) -> LogSource:
    """Every frame has the first pose."""
    first = source.entries[0].world_from_camera
    return replace(source, entries=tuple(replace(entry, world_from_camera=first) for entry in source.entries))


def shaken(source: LogSource) -> LogSource:
    """Poses with 10 cm of noise."""
    random = np.random.default_rng(0)

    def change(pose: np.ndarray) -> np.ndarray:
        result = pose.copy()
        result[:3, 3] += random.normal(0, 0.1, 3)
        return result

    return on_poses(change)(source)


def scaled_depth(factor: float) -> Fault:
    """Depth in another unit, as the 16-bit millimetres of ingest hold it."""

    def change(frame: LoadedFrame) -> LoadedFrame:
        assert frame.depth is not None
        values = np.rint(frame.depth * factor)
        return replace(frame, depth=np.where(values < 65535, values, 0).astype(np.uint16))

    def planted(source: LogSource) -> LogSource:
        entries = [replace(e, load=lambda e=e: change(e.load())) for e in source.entries]  # type: ignore[misc]
        return replace(source, entries=tuple(entries))

    return planted


def shifted_color(frames: int) -> Fault:
    """Every frame has the colour of an earlier one."""

    def planted(source: LogSource) -> LogSource:
        entries = list(source.entries)

        def load(index: int) -> LoadedFrame:
            other = entries[int(np.clip(index - frames, 0, len(entries) - 1))]
            return replace(entries[index].load(), color=other.load().color)

        shifted = [replace(entry, load=lambda k=k: load(k)) for k, entry in enumerate(entries)]  # type: ignore[misc]
        return replace(source, entries=tuple(shifted))

    return planted


def other_camera(change: Callable[[Camera], dict[str, float]]) -> Fault:
    """Intrinsics that are not those of the images."""

    def planted(source: LogSource) -> LogSource:
        cameras = [replace(c, camera=c.camera.model_copy(update=change(c.camera))) for c in source.cameras]
        return replace(source, cameras=tuple(cameras))

    return planted


def best_is(convention: str, scale: float = 1.0) -> Named:
    """Whether the pre-flight is decided about a reading of the poses."""

    def named(report: CameraReport) -> bool:
        best = report.poses.best
        return bool(
            best is not None
            and report.poses.decisive
            and best.convention == convention
            and abs(best.translation_scale / scale - 1) < 0.15
        )

    return named


def depth_times(factor: float) -> Named:
    """Whether the pre-flight says that depth must be multiplied by a factor."""
    return lambda report: (
        report.depth is not None and report.depth.factor is not None and abs(report.depth.factor / factor - 1) < 0.15
    )


def doubled(camera: Camera) -> dict[str, float]:
    """Intrinsics of the camera at twice its resolution."""
    return {"fx": 2 * camera.fx, "fy": 2 * camera.fy, "cx": 2 * camera.cx + 0.5, "cy": 2 * camera.cy + 0.5}


FAULTS: dict[str, tuple[Fault, Named]] = {
    "inverse poses": (on_poses(inverse), best_is("inverse")),
    "OpenGL axes": (on_poses(lambda pose: pose @ OPENGL_AXES), best_is("opengl")),
    "OpenGL view matrices": (on_poses(lambda pose: OPENGL_AXES @ inverse(pose)), best_is("inverse-opengl")),
    "ROS body axes": (on_poses(lambda pose: pose @ inverse(BODY_FROM_OPTICAL)), best_is("ros-body")),
    "left-handed": (on_poses(lambda pose: MIRROR_Y @ pose @ MIRROR_Y), best_is("left-handed")),
    "quaternion w first": (on_poses(reordered((3, 0, 1, 2))), best_is("quaternion-wxyz")),
    "translations x10": (on_poses(stretched(10)), best_is("as-is", 0.1)),
    "translations /10": (on_poses(stretched(0.1)), best_is("as-is", 10)),
    "translations x1000": (on_poses(stretched(1000)), best_is("as-is", 0.001)),
    "translations x0.37": (on_poses(stretched(0.37)), best_is("as-is", 1 / 0.37)),
    "OpenGL and mm": (on_poses(lambda pose: stretched(1000)(pose @ OPENGL_AXES)), best_is("opengl", 0.001)),
    "depth x5 (5000 as mm)": (scaled_depth(5.0), depth_times(0.2)),
    "depth /5 (mm as 5000)": (scaled_depth(0.2), depth_times(5.0)),
    "depth x10 (0.1 mm as mm)": (scaled_depth(10.0), depth_times(0.1)),
    "colour 3 frames late": (
        shifted_color(3),
        lambda r: r.registration.lag_decisive and abs((r.registration.lag_frames or 0) - 3) < 0.75,
    ),
    "poses 3 frames late": (
        shifted_poses(3),
        lambda r: r.poses.lag_frames is not None and r.poses.lag_frames in (2, 3, 4),
    ),
    "intrinsics of twice the size": (other_camera(doubled), lambda r: not r.calibration.plausible),
    "focal length x1.3": (
        other_camera(lambda c: {"fx": 1.3 * c.fx, "fy": 1.3 * c.fy}),
        lambda r: r.calibration.focal_fit is not None and 0.7 < r.calibration.focal_fit < 0.85,
    ),
    "poses frozen": (frozen, lambda r: r.poses.verdict == "contradict" and "camera moves" in r.poses.detail),
    "poses with 10 cm noise": (shaken, lambda r: r.poses.verdict in ("contradict", "doubtful")),
}
"""Name -> (what is planted, whether a report names it)."""
NOTHING = "nothing"
