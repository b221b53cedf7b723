"""`disparity`."""

from __future__ import annotations

import json
from pathlib import Path

from tests.advice.rows import Tried

EYES, PARAMETERS = "stages/disparity/eyes.py", "stages/disparity/parameters.py"
ASKED = "disparity --sequence {golden}/sequence --out depth --dry-run"
WEIGHTS = "--weights {golden}/sequence/sequence.json"


def verdict(folder: Path) -> str:
    return str(json.loads((folder / "depth/disparity.json").read_text())["rows"][0]["verdict"])


def rectified(folder: Path) -> None:
    assert verdict(folder) == "rectified"


def corrected(folder: Path) -> None:
    assert verdict(folder) == "corrected"


ROWS = [
    Tried(
        PARAMETERS,
        "is not a multiple of 16",
        f"{ASKED} --lowest-disparity 0 --levels 20",
        f"{ASKED} --lowest-disparity 0 --levels 32",
    ),
    *(
        Tried(PARAMETERS, "go together", f"{ASKED} --levels 32", f"{ASKED} {both}")
        for both in ("", "--lowest-disparity 0 --levels 32")
    ),
    Tried(PARAMETERS, "--block-size", f"{ASKED} --block-size 4", f"{ASKED} --block-size 5"),
    Tried(PARAMETERS, "needs --weights", f"{ASKED} --method raft-stereo", f"{ASKED} --method raft-stereo {WEIGHTS}"),
    Tried(PARAMETERS, "reads no --weights", f"{ASKED} {WEIGHTS}", f"{ASKED} {WEIGHTS} --method raft-stereo"),
    Tried(
        EYES,
        "its frames have one eye",
        "disparity --sequence {walks}/two --out depth",
        "ingest --log {pair}/log --out both && disparity --sequence both --out depth",
        code=3,
        right=rectified,
    ),
    Tried(
        EYES,
        "its frames have one eye",
        "disparity --sequence {walks}/two --out depth",
        "ingest --log {suture}/scene/frames.mcap --color-topic /camera/color --right-topic /camera/right --out both && "
        "disparity --sequence both --out depth --dry-run",
        code=3,
    ),
    Tried(
        EYES,
        "--rectification correct",
        "disparity --sequence {pair}/turned --rectification refuse --out depth",
        "disparity --sequence {pair}/turned --rectification correct --out depth",
        code=3,
        right=corrected,
    ),
]
