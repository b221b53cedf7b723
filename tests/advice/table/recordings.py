"""`ingest` of bags and MCAP."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.frames import FrameReader

from tests.advice.rows import NotTried, Tried
from tests.advice.table.logs import GIVEN
from tests.unit.disparity.pairs import BASELINE, pair
from tests.unit.disparity.pairs import CAMERA as EYE
from tests.unit.ingest.message_logs import FIRST, recorder

LOG = "ingest --log log/log.mcap --out out"
ORDER, STEREO, GEOMETRY = (
    "stages/ingest/eye_order.py",
    "stages/ingest/stereo.py",
    "stages/ingest/messages/camera_geometry.py",
)
POSES, SOURCE = "stages/ingest/messages/pose_source.py", "stages/ingest/messages/message_source.py"
EXCHANGED = "--color-topic /right/image_rect --right-topic /left/image_rect"
LEFT, RIGHT, _, _ = pair(noise=0.0)


def eyes(pictures: tuple[np.ndarray, np.ndarray] = (LEFT, RIGHT), x: float | None = BASELINE, infos: int = 2):  # type: ignore[no-untyped-def]
    """Return a writer of a rectified pair whose right eye stands `x` to the right by its calibration."""

    def write(folder: Path) -> None:
        with recorder(folder / "log") as log:
            for name, picture, shift in zip(("left", "right")[:2], pictures, (0.0, x or 0.0), strict=True):
                projection = [EYE.fx, 0, EYE.cx, -EYE.fx * shift, 0, EYE.fy, EYE.cy, 0, 0, 0, 1.0, 0]
                if name == "left" or infos == 2:
                    log.info(f"/{name}/camera_info", FIRST, f"{name}_eye", EYE, P=projection)
                log.image(f"/{name}/image_rect", FIRST, picture, "rgb8", f"{name}_eye")
        log.path.rename(folder / "log/log.mcap") if log.path.name != "log.mcap" else None

    return write


def baseline_is(metres: float):  # type: ignore[no-untyped-def]
    def right(folder: Path) -> None:
        with FrameReader(folder / "out/frames.mcap") as reader:
            (found,) = reader.baselines.values()
        assert abs(found - metres) < 1e-6

    return right


BLANK = np.full_like(LEFT, 90)
ROWS = [
    Tried(
        ORDER,
        "--color-topic {} --right-topic {}",
        LOG,
        f"{LOG} {EXCHANGED}",
        code=3,
        given=eyes((RIGHT, LEFT), -BASELINE),
        right=baseline_is(BASELINE),
    ),
    Tried(
        ORDER,
        "says so",
        LOG,
        f"{LOG} --baseline {BASELINE}",
        code=0,
        given=eyes(x=-BASELINE),
        right=baseline_is(BASELINE),
    ),
    *(
        Tried(ORDER, "seem to be swapped", LOG, f"{LOG} {way}", code=3, given=eyes((BLANK, BLANK), -BASELINE))
        for way in (f"--baseline {BASELINE}", EXCHANGED)
    ),
    Tried(
        "stages/disparity/eyes.py",
        "topics of --color-topic and --right-topic exchanged",
        f"{LOG} && disparity --sequence out --out depth",
        f"ingest --log log/log.mcap --out again {EXCHANGED} && disparity --sequence again --out depth",
        code=3,
        given=eyes((RIGHT, LEFT)),
    ),
    NotTried(
        "stages/disparity/eyes.py", "have no baseline", "`ingest` refuses such a pair, and its row follows the advice"
    ),
    Tried(
        STEREO,
        "nothing says how",
        f"{LOG} --right-topic /right/image_rect",
        f"{LOG} --right-topic /right/image_rect --baseline {BASELINE}",
        code=3,
        given=eyes(x=None),
        right=baseline_is(BASELINE),
    ),
    Tried(
        STEREO,
        "if it is in centimetres",
        LOG,
        f"{LOG} --baseline 0.6",
        code=0,
        given=eyes(x=60.0),
        right=baseline_is(0.6),
    ),
    *(
        Tried(
            STEREO, "too long", LOG, f"{LOG} --baseline {metres}", code=3, given=eyes(x=10.0), right=baseline_is(metres)
        )
        for metres in (0.1, 0.01)
    ),
    Tried(
        STEREO,
        "so they are no stereo pair",
        f"{LOG} --right-topic /right/image_rect --baseline 0.0001",
        f"{LOG} --right-topic /right/image_rect --baseline {BASELINE}",
        code=3,
        given=eyes(x=None),
        right=baseline_is(BASELINE),
    ),
    Tried(
        GEOMETRY,
        "a stereo pair needs the calibration",
        f"{LOG} --right-topic /right/image_rect {GIVEN}",
        f"{LOG} --right-topic /right/image_rect",
        code=3,
        given=eyes(),
        right=baseline_is(BASELINE),
    ),
    Tried(
        GEOMETRY,
        "and a stereo pair needs both",
        f"{LOG} --color-topic /left/image_rect --right-topic /right/image_rect",
        f"{LOG} --color-topic /left/image_rect",
        code=3,
        given=eyes(infos=1),
    ),
]
