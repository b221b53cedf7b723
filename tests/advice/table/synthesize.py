"""`synthesize`."""

from __future__ import annotations

from tests.advice.rows import NotTried, Tried

OPTIONS = "stages/synthesize/parameters.py"
ASKED = "synthesize --library {golden}/cad_library --out out --dry-run"
ROWS = [
    *(
        Tried(OPTIONS, "a tour has no rounds", f"{ASKED} --rounds 2", f"{ASKED} --rounds 2 --path {path}")
        for path in ("line", "loop", "eight")
    ),
    *(
        Tried(OPTIONS, "--no-depth", f"{ASKED} --no-depth", f"{ASKED} {other}")
        for other in ("--no-depth --stereo-baseline 0.12", "")
    ),
    NotTried(OPTIONS, "another --seed", "a room takes half a minute, and no seed is known by which none is found"),
    NotTried("stages/synthesize/drive.py", "another --path", "no room is known in which a drive comes too near"),
]
