"""Which file of a folder says what camera took its pictures."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.calibration_files import (
    KITTI,
    FolderCalibration,
    pair_of_files,
    read_calibration,
    split_lines,
)
from scenewright.stages.kit.formats.trajectories import read_text

NAMES = tuple(
    f"{stem}.{ending}"
    for stem in ("intrinsics", "intrinsic", "camera_info", "camera", "calibration", "calib", "camera_intrinsic")
    for ending in ("yaml", "yml", "json", "txt")
) + ("camera-intrinsics.txt", "K.txt", "sensor.yaml", "camchain.yaml")
PAIR_NAMES = (("left.yaml", "right.yaml"), ("left.yml", "right.yml"), ("cam0/sensor.yaml", "cam1/sensor.yaml"))
"""One file for each eye."""
ENDINGS = (".yaml", ".yml", ".json", ".txt")
SMALL_FILE, MOST_FILES = 32_000, 10
"""Bytes of a file, and how many files, that are looked at for a camera where none is named like a calibration."""
SAYING_KEYS = {"fx", "cam0"}
"""Keys of text files, of which one says that the numbers are a camera's."""


def find_calibration(root: Path, camera_number: int = 0) -> FolderCalibration | None:
    """Return the calibration in a folder, None without any. `camera_number` is the left camera of KITTI's files.

    Raises BadInput when there is a file but no camera can be found in it.
    """
    for left, right in PAIR_NAMES:
        if (root / left).is_file() and (root / right).is_file():
            return pair_of_files(root / left, root / right)
    path = calibration_of(root)
    return None if path is None else read_calibration(path, camera_number)


def calibration_of(root: Path) -> Path | None:
    """Return the file of a folder that is named like a calibration, else the only one that holds a camera."""
    named = calibration_file(root)
    others = [] if named is not None else calibrations_by_content(root)
    return others[0] if len(others) == 1 else named


def calibration_file(root: Path) -> Path | None:
    """Return the first file in a folder that is named like a calibration."""
    return next((root / name for name in NAMES if (root / name).is_file()), None)


def calibrations_by_content(root: Path) -> list[Path]:
    """Return the files of a folder that hold a camera and say which number is what, whatever they are called."""
    paths = [p for p in sorted(root.iterdir()) if p.suffix.lower() in ENDINGS and not p.name.startswith(".")]
    small = [path for path in paths if path.is_file() and path.stat().st_size <= SMALL_FILE]
    return [path for path in small[:MOST_FILES] if _holds_a_camera(path)]


def _holds_a_camera(path: Path) -> bool:
    try:
        if path.suffix.lower() == ".txt":
            text = read_text(path)
            if not KITTI.search(text) and not SAYING_KEYS & split_lines(text).keys():
                return False
        read_calibration(path)
    except BadInput:
        return False
    return True


def refuse_several(root: Path) -> None:
    """Raise BadInput where more than one file of a folder holds a camera, and none is named like a calibration."""
    several = [] if calibration_file(root) is not None else calibrations_by_content(root)
    if len(several) > 1:
        names = ", ".join(path.name for path in several)
        raise BadInput(
            f"{root}: {names} hold a camera each, and none is named like a calibration",
            hint=f"name the one of these images calibration{several[0].suffix}",
        )
