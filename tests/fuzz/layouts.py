"""Harnesses of folder logs: any bytes in place of a file that describes the folder."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.calibration_files import read_calibration
from scenewright.stages.ingest.folders.depth_arrays import ARRAY_SUFFIXES, depth_array
from scenewright.stages.ingest.folders.pose_files import read_pose_list
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.stamps import exact_stamps

from tests.fuzz.harness import Harness, as_file, chosen, refused, scratch
from tests.unit.ingest.folder_writers import (
    write_colmap,
    write_image_folder,
    write_nerfstudio,
    write_replica,
    write_scannet,
    write_scenenn,
    write_tum,
)
from tests.unit.ingest.phone_writers import (
    Take,
    write_arkit_scenes,
    write_polycam,
    write_record3d_pictures,
    write_scanner_app,
    write_scannetpp,
    write_stray_scanner,
)
from tests.unit.ingest.tiny_room import frames, write_posed_images, write_redwood, write_seven_scenes

WRITERS: dict[str, Callable[[Path, list], Path]] = {
    "7scenes": write_seven_scenes,
    "redwood": write_redwood,
    "posed_images": write_posed_images,
    "tum": write_tum,
    "scenenn": write_scenenn,
    "scannet": write_scannet,
    "nerfstudio": write_nerfstudio,
    "replica": write_replica,
    "colmap": write_colmap,
    "colmap_text": lambda root, recorded: write_colmap(root, recorded, binary=False),
    "images": write_image_folder,
    "stray_scanner": lambda root, _: write_stray_scanner(root, Take(2)),
    "record3d": lambda root, _: write_record3d_pictures(root, Take(2)),
    "polycam": lambda root, _: write_polycam(root, Take(2)),
    "scanner_app": lambda root, _: write_scanner_app(root, Take(2)),
    "arkit_scenes": lambda root, _: write_arkit_scenes(root, Take(2)),
    "scannetpp": lambda root, _: write_scannetpp(root, Take(2)),
}
INTRINSICS = {"fx": 80.0, "fy": 80.0, "cx": 47.5, "cy": 35.5}
DESCRIBING = (".txt", ".json", ".log", ".ini", ".yaml", ".bin", ".freiburg", ".csv", ".traj", ".pincam")
CALIBRATIONS = ("calibration.yaml", "camera.json", "calib.txt", "intrinsics.txt")


@functools.cache
def _folder(layout: str) -> tuple[Path, tuple[tuple[Path, bytes], ...]]:
    """Return a log of the layout and its describing files with their bytes."""
    root = scratch() / f"layout-{layout}"
    shutil.rmtree(root, ignore_errors=True)
    log = WRITERS[layout](root / "log", frames(2))
    files = sorted(path for path in root.rglob("*") if path.suffix in DESCRIBING)
    return log, tuple((path, path.read_bytes()) for path in files)


def _target(layout: str) -> Callable[[bytes], None]:
    def target(data: bytes) -> None:
        """The first byte chooses the file that the rest becomes."""
        log, files = _folder(layout)
        number, rest = chosen(data, len(files))
        path, whole = files[number]
        path.write_bytes(rest)
        options = INTRINSICS if layout == "posed_images" else {}
        try:
            with refused(BadInput, UsageError):
                source = open_log(log, IngestParameters(**options))
                try:
                    for entry in source.entries[:2]:
                        assert isinstance(entry.time, float)
                        assert entry.world_from_camera is None or np.shape(entry.world_from_camera) == (4, 4)
                        with refused(Unusable):
                            entry.load()
                finally:
                    source.close()
        finally:
            path.write_bytes(whole)

    return target


def _seeds(layout: str) -> Callable[[], dict[str, bytes]]:
    return lambda: {path.name: bytes([number]) + data for number, (path, data) in enumerate(_folder(layout)[1])}


def depth_array_file(data: bytes) -> None:
    """The first byte chooses the format of the array that follows."""
    number, rest = chosen(data, len(ARRAY_SUFFIXES))
    with refused(Unusable):
        image = depth_array(rest, ARRAY_SUFFIXES[number])
        assert image.ndim == 2 and image.size * 2 <= len(rest)


def _array_seeds() -> dict[str, bytes]:
    array = np.arange(12, dtype=np.float32).reshape(3, 4)
    path = scratch() / "a.npy"
    np.save(path, array)
    samples = {
        ".npy": path.read_bytes(),
        ".pfm": b"Pf\n4 3\n-1.0\n" + array.tobytes(),
        ".bin": b"4&3&1&" + array.tobytes(),
    }
    return {
        f"array{suffix}": bytes([ARRAY_SUFFIXES.index(suffix)]) + samples[suffix]
        for suffix in ARRAY_SUFFIXES
        if suffix in samples
    }  # noqa: E501


def calibration_file(data: bytes) -> None:
    """The first byte chooses the name of the calibration file that follows."""
    number, rest = chosen(data, len(CALIBRATIONS))
    with refused(BadInput):
        found = read_calibration(as_file(CALIBRATIONS[number], rest))
        assert found.left.K[0] > 0 and np.isfinite(found.left.K).all()


def _calibration_seeds() -> dict[str, bytes]:
    texts = {
        "calibration.yaml": "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [ 80., 0., 47.5, 0., 80., 35.5, 0., 0., 1. ]\nD1: [0, 0, 0, 0]\n"
        "M2: [80, 0, 47.5, 0, 80, 35.5, 0, 0, 1]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [-0.1, 0, 0]\n",
        "camera.json": '{"width": 96, "height": 72, "camera": {"fx": 80, "fy": 80, "cx": 47.5, "cy": 35.5, "k1": 0.1}}',
        "calib.txt": "P0: 80 0 47.5 0 0 80 35.5 0 0 0 1 0\nP1: 80 0 47.5 -8 0 80 35.5 0 0 0 1 0\n",
        "intrinsics.txt": "cam0=[80 0 47; 0 80 35; 0 0 1]\ncam1=[80 0 50; 0 80 35; 0 0 1]\ndoffs=3\nbaseline=100\n",
    }
    return {name: bytes([CALIBRATIONS.index(name)]) + text.encode() for name, text in texts.items()}


def pose_list(data: bytes) -> None:
    """Any bytes as the poses of two images, and as a stamp."""
    with refused(BadInput):
        found = read_pose_list(as_file("poses.txt", data), ["a", "b"])
        assert isinstance(found, StampedPoses) or len(found) == 2
    with refused(BadInput):
        (stamp,) = exact_stamps([data.decode("utf-8", "replace")], ["here"]).stamps
        assert stamp is not None and 0 <= stamp < 9 * 10**18


def _pose_list_seeds() -> dict[str, bytes]:
    return {
        "rows": b"1 0 0 0 0 1 0 0 0 0 1 0\n" * 2,
        "stamped": b"1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0 0 0 1\n",
        "stamp": b"1.5",
    }


HARNESSES = {f"layout_{name}": Harness(_target(name), _seeds(name), choosing=1) for name in WRITERS} | {
    "depth_array": Harness(depth_array_file, _array_seeds, choosing=1),
    "calibration_file": Harness(calibration_file, _calibration_seeds, choosing=1),
    "pose_list": Harness(pose_list, _pose_list_seeds),
}
