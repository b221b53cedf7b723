"""Logs that state intrinsics frame by frame: which frames are of one camera, and what their common camera is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.undistortion import RecordedCamera

MOST_CAMERAS = 8
"""Different intrinsics in one log up to which each is a camera of its own. More mean one camera that refocused, or a
calibration of every picture: then all pictures of one size are brought to the median intrinsics."""


@dataclass(frozen=True)
class CameraGroup:
    """Frames that come out as one camera."""

    name: str
    camera: Camera
    """What frames are wanted in, without distortion."""
    members: tuple[int, ...]
    """Indices of the frames."""


def grouped(
    recorded: Sequence[RecordedCamera], labels: Sequence[str]
) -> tuple[tuple[CameraGroup, ...], tuple[str, ...]]:
    """Return the cameras of frames with intrinsics `recorded` (N,), and notes.

    `labels` (N,) name the cameras in the log; a single camera is called `camera`, others by their label, or
    `camera_<label>` where that is a number.
    """
    kinds = list(dict.fromkeys(zip(labels, recorded, strict=True)))
    if len(kinds) <= MOST_CAMERAS:
        names = {kind: "camera" if len(kinds) == 1 else _plain(kind[0]) for kind in kinds}
        if len(set(names.values())) < len(kinds):
            names = {kind: f"camera_{index}" for index, kind in enumerate(kinds, start=1)}
        members: dict[tuple[str, RecordedCamera], list[int]] = {}
        for index, kind in enumerate(zip(labels, recorded, strict=True)):
            members.setdefault(kind, []).append(index)
        return tuple(CameraGroup(names[kind], kind[1].camera, tuple(members[kind])) for kind in kinds), ()
    sizes = list(dict.fromkeys((each.camera.width, each.camera.height) for each in recorded))
    groups = []
    for number, size in enumerate(sizes, start=1):
        indices = [i for i, each in enumerate(recorded) if (each.camera.width, each.camera.height) == size]
        name = "camera" if len(sizes) == 1 else f"camera_{number}"
        groups.append(CameraGroup(name, median_camera([recorded[i].camera for i in indices]), tuple(indices)))
    note = f"{len(kinds)} different intrinsics: images are resampled to the median ones of their size"
    return tuple(groups), (note,)


def median_camera(cameras: Sequence[Camera]) -> Camera:
    """Return the camera of the median intrinsics of cameras of one size."""
    middle = np.median([[each.fx, each.fy, each.cx, each.cy] for each in cameras], axis=0)
    numbers = dict(zip(("fx", "fy", "cx", "cy"), map(float, middle), strict=True))
    return Camera(width=cameras[0].width, height=cameras[0].height, **numbers)


def _plain(label: str) -> str:
    name = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in label)
    return f"camera_{name}" if not name or name[0] in "0123456789" else name
