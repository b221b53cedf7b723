"""Recordings of other tools that no layout reads: recognised by name, with the way to something that is read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.ingest.folders.calibration_search import calibration_file
from scenewright.stages.ingest.folders.pose_files import pose_file

HEAD = 4_000_000
"""Bytes of a file in which the words of a tool are looked for."""
SHOWN = 5
"""Most files that a message names."""
TABLES = (".json", ".csv", ".yaml", ".yml", ".xml", ".ini", ".toml", ".cfg")
THEN = ", then ingest OUT"
UNPACK = "unpack it into a folder and give that folder"
MESH = "it is a mesh or points, no recording: scenewright fuse --from-mesh takes a PLY"


@dataclass(frozen=True)
class Foreign:
    """A recording that was recognised."""

    name: str
    way: str
    """What to do; `{}` stands for the recording."""


AZURE_KINECT = Foreign(
    "an Azure Kinect recording",
    f"take its images out with Open3D: python azure_kinect_mkv_reader.py --input {{}} --output OUT{THEN}",
)
VIDEO = Foreign(
    "a video",
    "it holds no depth: docs/PHONE.md says what comes of one; that of a stereo camera is read from a folder of its own "
    "with its calibration file (docs/LOGS.md)",
)
RTABMAP = Foreign(
    "an RTAB-Map database",
    "`rtabmap-export --images --poses_camera --poses_format 10 {}` writes NAME_rgb, NAME_depth, NAME_calib and "
    "NAME_camera_poses.txt: name the first two rgb and depth, a file of the third calibration.yaml, and ingest their "
    "folder with --trajectory NAME_camera_poses.txt",
)
BY_ENDING = {
    ".mkv": VIDEO,
    **dict.fromkeys((".mp4", ".mov", ".avi", ".webm"), VIDEO),
    **dict.fromkeys(
        (".svo", ".svo2"),
        Foreign(
            "a ZED recording",
            "write left images and depth with the ZED SDK: python export_svo.py --mode 4 --input_svo_file {} "
            "--output_path_dir OUT, then ingest OUT with its --fx --fy --cx --cy",
        ),
    ),
    ".db": RTABMAP,
    ".oni": Foreign(
        "an OpenNI recording", "play it with OpenNI2 and write colour and 16-bit depth as PNG into color/ and depth/"
    ),
    ".klg": Foreign(
        "a log of Kintinuous or ElasticFusion", "write its colour and 16-bit depth as PNG into color/ and depth/"
    ),
    ".usdz": Foreign(
        "a USDZ model, no recording", "export the scan as PLY for scenewright fuse --from-mesh, or its raw data"
    ),
    ".vrs": Foreign(
        "a Project Aria recording", f"ns-process-data aria --vrs-file {{}} --output-dir OUT (nerfstudio){THEN}"
    ),
    ".rrd": Foreign("a Rerun recording", "record the same streams as MCAP (docs/LOGS.md)"),
    **dict.fromkeys(
        (".h5", ".hdf5", ".parquet"),
        Foreign("a table of arrays", "write its images into a folder (docs/LOGS.md) and give that folder"),
    ),
    ".tum": Foreign("a trajectory, no recording", "give its log, and it beside: ingest --log FOLDER --trajectory {}"),
    **dict.fromkeys((".zip", ".tar", ".gz", ".tgz", ".7z", ".rar", ".xz"), Foreign("an archive", UNPACK)),
    **dict.fromkeys((".ply", ".obj", ".glb", ".gltf", ".stl", ".pcd", ".las", ".e57"), Foreign("a scan", MESH)),
}


def refuse_foreign_file(path: Path) -> None:
    """Raise BadInput for a file of another tool, told apart by its ending, or by its words."""
    ending = path.suffix.lower()
    if ending not in BY_ENDING:
        return
    found = BY_ENDING[ending]
    if ending == ".mkv" and b"K4A_" in _head(path):
        found = AZURE_KINECT
    if ending == ".db" and b"messages" in (head := _head(path)) and b"topics" in head:
        return  # a ROS 2 bag under another name
    _refuse(path, found)


def meant_to_be_read(root: Path) -> bool:
    """Whether a calibration or poses lie in a folder: whoever puts them there means its pictures."""
    return calibration_file(root) is not None or pose_file(root) is not None


def refuse_lone_recording(root: Path) -> None:
    """Raise BadInput for a folder in which nothing is read, but in which a file of another tool lies."""
    for path in sorted(root.iterdir()):
        if path.is_file():
            refuse_foreign_file(path)


def unread_tables(root: Path, read: tuple[str, ...]) -> str:
    """Return the files of tables and settings in a folder, without those `read`: they may say what is missing."""
    names = sorted(p.name for p in root.iterdir() if p.suffix.lower() in TABLES and p.name not in read)
    return ", ".join(names[:SHOWN]) + (f", ... ({len(names)} files)" if len(names) > SHOWN else "")


def _refuse(path: Path, found: Foreign) -> None:
    raise BadInput(f"{path}: is {found.name}, which is not read as it is", hint=found.way.replace("{}", str(path)))


def _head(path: Path) -> bytes:
    with opened(path, hint="check its permissions") as file:
        return file.read(HEAD)
