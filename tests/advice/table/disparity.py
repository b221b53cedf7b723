"""`disparity`."""

from __future__ import annotations

from tests.advice.rows import Tried

PARAMETERS = "stages/disparity/parameters.py"
ROWS = [
    Tried(
        PARAMETERS,
        "--levels {} is no multiple of 16",
        "disparity --sequence {golden}/sequence --lowest-disparity 0 --levels 20 --out depth --dry-run",
        "disparity --sequence {golden}/sequence --lowest-disparity 0 --levels 32 --out depth --dry-run",
    )
]
