"""Poses beside plain images: a file with a pose an image, a stamped trajectory, or a file of 4x4 numbers an image.

Poses are taken to be world_from_camera. What a row holds is told by its columns: 7 is tx ty tz qx qy qz qw, 8 has a
stamp before these (TUM), 12 is a 3x4 matrix row by row (KITTI), 16 a 4x4 matrix. One column more is the name of the
row's image, with or without folder and ending, or its number; such rows may stand in any order and leave images out.
Eight columns of numbers are named poses where half the first column or more names images, and stamped ones otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.ingest.folders.files import files_of, images_by_number
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses, read_stamped_poses
from scenewright.stages.kit.formats.trajectories import (
    named_rows,
    number_rows,
    read_matrix,
    read_open3d_log,
    read_text,
    transform_from_numbers,
)

FILES = ("pose.txt", "poses.txt", "groundtruth.txt", "trajectory.txt", "trajectory.tum", "traj.txt", "trajectory.log")
FOLDERS = ("pose", "poses")
WITHOUT_STAMP = (7, 12, 16)
"""Numbers a row without a stamp: position and quaternion, 3 x 4, 4 x 4."""
WHOLE_NUMBER = re.compile(r"[0-9]{1,18}")
COLUMNS = (8, *WITHOUT_STAMP)
"""Numbers a row that are read: with a stamp, as TUM writes them, or without."""
Pose = tuple[np.ndarray | None, str | None]
"""world_from_camera (4, 4), or the reason why there is none."""


def pose_file(root: Path) -> Path | None:
    """Return the file or folder of poses in a folder, None without any."""
    candidates = [root / name for name in FILES if (root / name).is_file()]
    candidates += [path for path in files_of(root, (".txt",)) if path.name.startswith("traj")]
    candidates += [root / name for name in FOLDERS if (root / name).is_dir()]
    return candidates[0] if candidates else None


def columns_of(path: Path) -> int:
    """Return the number of columns in the first row of a text file, 0 when it has none. Raises BadInput."""
    return len(_first_row(path))


def _first_row(path: Path) -> list[str]:
    with opened(path, hint="check its permissions") as file:
        start = file.read(4096).decode("utf-8", "replace")
    rows = (line.split("#", 1)[0].split() for line in start.splitlines())
    return next((row for row in rows if row), [])


def read_pose_list(path: Path, names: list[str], files: Sequence[str] = ()) -> list[Pose] | StampedPoses:
    """Return the pose of each image of `names` (in order), or a stamped trajectory when the file is one. `files` are
    the stems of the images' files, where these are other names.

    Raises BadInput when the numbers of poses and images differ, and for rows that are none.
    """
    if path.is_dir():
        return _folder(path, names)
    if path.suffix == ".log":
        matrices: list[Pose] = [(matrix, None) for matrix in read_open3d_log(path)]
        return _check_count(matrices, names, path)
    columns = columns_of(path)
    if columns - 1 in WITHOUT_STAMP:
        rows = named_rows(path, columns)
        images = _images([label for _, label, _ in rows], names, files)
        if columns != 8 or _are_names([label for _, label, _ in rows], images):
            return _poses_by_image(path, rows, images, names)
        return read_stamped_poses(path)
    if columns not in COLUMNS:
        read_text(path)
        raise BadInput(
            f"{path}: {columns} columns are no pose",
            hint="7, 8 (with a stamp), 12 or 16 numbers a line, after the image's name or not",
        )
    return _check_count([_pose(row, f"{path}: line {line}") for line, row in number_rows(path, columns)], names, path)


def _images(labels: list[str], names: list[str], files: Sequence[str]) -> list[str | None]:
    """Return the image of `names` (stems) that each label means, None where it means none.

    A label is a name with or without folder and ending; where no label is one, labels that are whole numbers mean the
    images whose names end in these numbers, if they differ.
    """
    images: list[str | None] = []
    image_of = dict(zip(files, names, strict=False)) | {name: name for name in names}
    for label in labels:
        path = PurePosixPath(label.replace("\\", "/"))
        stem = path.name if WHOLE_NUMBER.fullmatch(path.suffix[1:]) else path.stem  # decimals are no file's ending
        images.append(next((image_of[text] for text in (path.name, stem) if text in image_of), None))
    if any(image is not None for image in images) or not all(WHOLE_NUMBER.fullmatch(label) for label in labels):
        return images
    by_number = {_last_number(name): name for name in names}
    if None in by_number or len(by_number) < len(set(names)):
        return images
    return [by_number.get(int(label)) for label in labels]


def _are_names(labels: list[str], images: list[str | None]) -> bool:
    """Whether the first of eight columns names images: it holds what is no number, or half of it or more does.

    A stamp may by chance be an image's number (0, say); half of them are not.
    """
    return not all(_is_number(label) for label in labels[:1]) or 2 * sum(map(bool, images)) >= max(len(labels), 1)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _poses_by_image(
    path: Path, rows: list[tuple[int, str, np.ndarray]], images: list[str | None], names: list[str]
) -> list[Pose]:
    """Return the pose of each image by the image that a row is of; none for images without a row.

    Raises BadInput when no row is of an image, and when two are of one.
    """
    poses: dict[str, Pose] = {}
    for (line, label, row), image in zip(rows, images, strict=True):
        if image is not None and image in poses:
            raise BadInput(f"{path}: line {line}: a second pose for {label!r:.60}", hint="one pose an image")
        if image is not None:
            poses[image] = _pose(row, f"{path}: line {line}")
    if not poses:
        first = rows[0][1] if rows else ""
        raise BadInput(f"{path}: {first!r:.60} and the rest name no image of the log", hint="name the image files")
    return [poses.get(name, (None, None)) for name in names]


def _pose(row: np.ndarray, where: str) -> Pose:
    if not np.isfinite(row).all():
        return None, "non_finite_pose"
    if len(row) == 7:
        try:
            return transform_from_numbers(row, where), None
        except BadInput:
            return None, "non_rigid_pose"
    return np.vstack([row.reshape(-1, 4)[:3], [0, 0, 0, 1] if len(row) == 12 else row[12:]]), None


def _check_count(poses: list[Pose], names: list[str], path: Path) -> list[Pose]:
    if len(poses) != len(names):
        raise BadInput(f"{path}: {len(poses)} poses for {len(names)} images", hint="one pose an image, in order")
    return poses


def _folder(folder: Path, names: list[str]) -> list[Pose]:
    by_stem = {path.stem: path for path in files_of(folder, (".txt",))}
    if not by_stem.keys() & set(names):
        numbered = images_by_number(folder, (".txt",))
        keys = [_last_number(name) for name in names]
        by_stem = {name: numbered[key] for name, key in zip(names, keys, strict=True) if key in numbered}
    poses: list[Pose] = []
    for name in names:
        if name not in by_stem:
            poses.append((None, None))
            continue
        try:
            poses.append((read_matrix(by_stem[name]), None))
        except BadInput:
            poses.append((None, "unreadable_pose"))
    return poses


def _last_number(name: str) -> int | None:
    digits = "".join(letter if letter in "0123456789" else " " for letter in name).split()
    return int(digits[-1]) if digits else None
