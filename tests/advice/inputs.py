"""Inputs that rows share, made once a process."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from scenewright.cli.main import run

from tests.unit.segment.test_stage import write_sequence

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


@cache
def folder() -> Path:
    """Return a folder of this process, which goes with it."""
    made = Path(tempfile.mkdtemp(prefix="advice-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


@cache
def golden() -> str:
    """Return a folder with an artifact of every kind, named by it: whole documents, large payloads left out."""
    for version in sorted(GOLDEN.glob("v*")):
        shutil.copytree(version, folder() / "golden", dirs_exist_ok=True)
    return str(folder() / "golden")


@cache
def room() -> str:
    """Return a folder with the sequence of a small room that was ingested from `log/frames.mcap`: four frames."""
    made = folder() / "room"
    log = write_sequence(made / "log").sequence.path("frames.mcap")
    assert run(["ingest", str(log), "--out", str(made / "sequence")]) == 0
    return str(made)


INPUTS = {"golden": golden, "room": room}
"""What stands for `{name}` in a row's commands."""
