"""`ingest` of folders and of files of other tools."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.folders.quarter_turns import OLD_FROM_TURNED
from scenewright.stages.kit.formats.frames import FrameReader

from tests.advice.rows import NotTried, Tried
from tests.advice.table.fuse import scan
from tests.unit.ingest.calibrations import CAMODOCAL
from tests.unit.ingest.folder_writers import stamp_text, tum_line, write_image_folder, write_nerfstudio, write_tum
from tests.unit.ingest.phone_writers import Take, write_stray_scanner
from tests.unit.ingest.tiny_room import CAMERA, frames, png

GIVEN = "--fx 80 --fy 80 --cx 47.5 --cy 35.5"
LOG = "ingest --log log --out out"
ANOTHER = "another program does it, which is not here"
FILES, FOREIGN = "stages/ingest/folders/files.py", "stages/ingest/foreign.py"


def tum(calibration: str | None = "80 80 47.5 35.5", name: str = "calibration.txt", every: int = 1):  # type: ignore[no-untyped-def]
    """Return a writer of a TUM log of three frames, with a pose for so many of five."""

    def write(folder: Path) -> None:
        recorded = frames(5 if every > 1 else 3)
        log = write_tum(folder / "log", recorded, depth_shift=0.0)
        (log / "calibration.txt").unlink()
        if calibration is not None:
            (log / name).write_text(calibration)
        if every > 1:
            lines = [tum_line(stamp_text(10 * k), pose) for k, (_, _, pose) in enumerate(recorded)]
            (log / "groundtruth.txt").write_text("\n".join(lines) + "\n")
            for listed in ("rgb", "depth"):
                rows = []
                for k, (color, depth, _) in enumerate(recorded):
                    (log / listed / f"{k}.png").write_bytes(
                        png(color if listed == "rgb" else np.rint(depth * 5000).astype(np.uint16))
                    )
                    rows.append(f"{stamp_text(5 * k)} {listed}/{k}.png")
                (log / f"{listed}.txt").write_text("\n".join(rows) + "\n")

    return write


def transforms(**fields: object):  # type: ignore[no-untyped-def]
    """Return a writer of a log of nerfstudio in which these fields are others (None: are not)."""

    def write(folder: Path) -> None:
        log = write_nerfstudio(folder / "log", frames(2))
        document = json.loads((log / "transforms.json").read_text()) | fields
        document = {name: value for name, value in document.items() if value is not None}
        (log / "transforms.json").write_text(json.dumps(document))

    return write


def images(folder: Path) -> None:
    write_image_folder(folder / "log", frames(2), poses=False)
    lines = [tum_line(f"{k / 30:.9f}", pose) for k, (_, _, pose) in enumerate(frames(2))]
    (folder / "mine.tum").write_text("\n".join(lines) + "\n")


def odd_stray(folder: Path) -> None:
    """A recording without its video, of pictures that are not ARKit's usual ones."""
    log = write_stray_scanner(folder / "log", Take(3), intrinsics=False)
    (log / "rgb.mp4").unlink()


def upright_phone(folder: Path) -> None:
    """A recording of a phone that was held upright: its pictures lie on their side."""
    take = Take(3)
    take.world_from_camera = take.world_from_camera @ OLD_FROM_TURNED.T
    write_stray_scanner(folder / "log", take)


def room_scan(folder: Path) -> None:
    for ending in ("ply", "obj"):
        scan(f"scan.{ending}")(folder)


def apart(folder: Path) -> None:
    """Depth comes 40 ms after colour."""
    log = write_tum(folder / "log", frames(3), depth_shift=0.04, groundtruth=False)
    lines = [f"{stamp_text(10 * k)} rgb/{stamp_text(k)}.png" for k in range(3)]
    (log / "rgb.txt").write_text("\n".join(lines) + "\n")
    lines = [f"{stamp_text(10 * k, 0.04)} depth/{stamp_text(k, 0.04)}.png" for k in range(3)]
    (log / "depth.txt").write_text("\n".join(lines) + "\n")


def camera_is_right(folder: Path, least: int = 1) -> None:
    with FrameReader(folder / "out/frames.mcap") as reader:
        assert reader.camera == CAMERA and len(reader) >= least


def all_are_posed(folder: Path) -> None:
    info = Sequence(folder / "out").info
    with FrameReader(folder / "out/frames.mcap") as reader:
        poses = [frame.world_from_camera for frame in reader.frames(streams=())]
    assert info.frame_count == info.frames_in_log and all(pose is not None for pose in poses)


def sizes(folder: Path, size: tuple[int, int]) -> None:
    camera = Sequence(folder / "out").info.camera
    assert (camera.width, camera.height) == size


def refused(path: str, says: str, given, code: int = 3) -> Tried:  # type: ignore[no-untyped-def]
    """Return the row of a message that asks for all four intrinsics."""
    return Tried(path, says, LOG, f"{LOG} {GIVEN}", code=code, given=given, right=camera_is_right)


ROWS = [
    Tried(
        "stages/ingest/stage.py",
        "--every 5",
        "ingest --log {walks}/unposed_log/frames.mcap --every auto --out out",
        "ingest --log {walks}/unposed_log/frames.mcap --every 5 --out out",
    ),
    refused(FILES, "intrinsics are for", tum(CAMODOCAL.replace("96", "72"), "lens.yaml")),
    refused(FILES, "are those of no camera", tum("0 0 1 1")),
    NotTried(
        FILES, "intrinsics are not numbers", "readers refuse words where numbers stand before they ask for a camera"
    ),
    refused("stages/ingest/layouts/nerfstudio/reader.py", "neither fl_x nor", transforms(fl_x=None, fl_y=None)),
    refused("stages/ingest/layouts/tum/reader.py", "intrinsics are not known", tum(None)),
    refused("stages/ingest/stage.py", "cannot be those of an image of", tum("8000000 8000000 47.5 35.5")),
    Tried(
        "stages/ingest/folders/stamped_poses.py",
        "interpolates",
        f"{LOG} --maximum-transform-gap 0.1",
        f"{LOG} --maximum-transform-gap 0.34",
        code=0,
        given=tum(every=2),
        right=all_are_posed,
    ),
    Tried(
        "stages/ingest/losses.py",
        "pairs what is further apart",
        LOG,
        f"{LOG} --maximum-time-difference 0.05",
        code=4,
        given=apart,
        right=lambda folder: camera_is_right(folder, 3),
    ),
    *(
        Tried(
            FOREIGN,
            "it is a mesh or points",
            f"ingest --log scan.{ending} --out out",
            "fuse --from-mesh scan.ply --out map",
            code=3,
            given=room_scan,
        )
        for ending in ("ply", "obj")
    ),
    Tried(
        FOREIGN,
        "and it beside",
        "ingest --log mine.tum --out out",
        "ingest --log log --trajectory mine.tum --out out",
        code=3,
        given=images,
        right=all_are_posed,
    ),
    *(
        NotTried(FOREIGN, says, ANOTHER)
        for says in (
            *("azure_kinect_mkv_reader", "rtabmap-export --images --poses_camera", "export_svo.py"),
            *("export the scan as PLY", "ns-process-data aria"),
        )
    ),
    Tried(
        "stages/ingest/layouts/stray_scanner/reader.py",
        "of the depth, or put the app's own",
        LOG,
        f"{LOG} --fx 42.7 --fy 42.8 --cx 32.1 --cy 23.2",
        code=3,
        given=odd_stray,
        right=all_are_posed,
    ),
    Tried(
        "stages/ingest/folders/phone_frames.py",
        "--no-turn leaves them",
        LOG,
        f"{LOG} --no-turn --force",
        code=0,
        given=upright_phone,
        right=lambda folder: sizes(folder, (64, 48)),
    ),
    Tried(
        "stages/ingest/own_poses.py",
        "--trajectory is of one camera",
        "ingest --log {walks}/two_log/frames.mcap --camera all --trajectory {walks}/two/trajectory.tum --out out",
        "ingest --log {walks}/two_log/frames.mcap --camera left --trajectory {walks}/two/trajectory.tum --out out",
        right=all_are_posed,
    ),
]
