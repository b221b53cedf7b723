"""`inspect` of logs, and what `ingest` says of the frames that it wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.advice.rows import NotTried, Tried
from tests.advice.table.logs import GIVEN, all_are_posed, camera_is_right, images
from tests.unit.ingest.folder_writers import write_image_folder
from tests.unit.ingest.tiny_room import frames, millimetres, png

INGEST = "ingest --log log --out out"
PREFLIGHT, STAGE = "stages/ingest/preflight", "stages/ingest/stage.py"
KNOWN_BY_TESTS = "`inspect` of logs that bring it up is followed in tests/unit/ingest/preflight and tests/strangers"


def calibrated(text: str) -> Callable[[Path], None]:
    """Return a writer of a log with these intrinsics."""

    def write(folder: Path) -> None:
        log = write_image_folder(folder / "log", frames(3), poses=False)
        (log / "intrinsics.txt").write_text(text)

    return write


def stored(pixels: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a writer of a log whose depth [mm] is stored otherwise."""

    def write(folder: Path) -> None:
        log = write_image_folder(folder / "log", frames(3), poses=False)
        for index, (_, depth, _) in enumerate(frames(3)):
            (log / "depth" / f"depth_{index}.png").write_bytes(png(pixels(millimetres(depth))))

    return write


TENTHS = stored(lambda depth: np.clip(depth.astype(int) * 10, 0, 65534).astype(np.uint16))
SWAPPED = stored(lambda depth: depth.byteswap())


ROWS = [
    *(
        Tried(
            f"{PREFLIGHT}/calibration.py",
            says,
            "inspect log",
            f"{INGEST} {way}",
            code=code,
            given=calibrated(text),
            right=camera_is_right,
        )
        for says, text, way, code in (
            ("give --cx", "80 80 35.5 47.5", "--cx 47.5 --cy 35.5", 3),
            ("--fx {} --fy {}", "160 160 95.5 71.5", GIVEN, 3),
            ("--cx {} --cy {}", "160 160 95.5 71.5", GIVEN, 3),
            ("give --fx --fy --cx --cy", "80 80 5 60", GIVEN, 0),
        )
    ),
    Tried(
        f"{PREFLIGHT}/depth.py",
        "m away)",
        "inspect log",
        f"{INGEST} --depth-scale 10000",
        code=3,
        given=TENTHS,
        shows="median_depth 2.6",
    ),
    Tried(
        f"{PREFLIGHT}/bits.py",
        "ingest with --depth-bits",
        "inspect log",
        f"{INGEST} --depth-bits swapped",
        code=3,
        given=SWAPPED,
        shows="median_depth 2.6",
    ),
    *(
        Tried(STAGE, says, INGEST, "inspect log", code=0, then_code=3, given=given, shows=shows)
        for says, given, shows in (
            ("is the depth unit right (depth_scale)", TENTHS, "--depth-scale 10000"),
            ("is it stored otherwise", SWAPPED, "--depth-bits swapped"),
        )
    ),
    Tried(
        f"{PREFLIGHT}/settings.py",
        "not name=value",
        "inspect log --set depth_scale",
        "inspect log --set depth_scale=1000",
        given=images,
    ),
    Tried(
        f"{PREFLIGHT}/inspection.py",
        "your own --trajectory",
        "inspect log",
        f"{INGEST} --trajectory mine.tum",
        code=0,
        given=images,
        right=all_are_posed,
    ),
    *(
        NotTried(f"{PREFLIGHT}/{file}.py", says, KNOWN_BY_TESTS)
        for file, says in (
            ("depth", "ingest with --maximum-depth"),
            ("depth", "find out the unit"),
            ("drift", "poses_method=refine"),
            ("motion", "use the part before or after"),
            ("motion", "use --every, or other poses"),
            ("pictures", "use --every, or rescan"),
            ("pose_findings", "after what --pose-convention does already"),
            ("pose_findings", "ingest with --pose-convention"),
            ("pose_findings", "--pose-scale {}"),
            ("pose_findings", "give the calibration of these images"),
            ("units", "--depth-scale {}"),
            ("units", "--pose-scale {}"),
            ("upright", "--gravity given --up AXIS if known"),
        )
    ),
    NotTried(STAGE, "up may be wrong", KNOWN_BY_TESTS),
    NotTried(f"{PREFLIGHT}/inspection.py", "a splat can be learned", "tests of splats learn such ones"),
    NotTried(f"{PREFLIGHT}/page.py", "choose a writable --html", "root can write everywhere, as tests may"),
    *(
        NotTried(f"{PREFLIGHT}/steps.py", says, "a name of a step")
        for says in ("segment --backend detector", "ground-truth")
    ),
    *(
        NotTried("stages/ingest/losses.py", says, "several options may help, and `inspect` says why frames are lost")
        for says in ("ingest has --maximum-transform-gap", "is the depth unit right")
    ),
]
