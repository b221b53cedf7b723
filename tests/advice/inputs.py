"""Inputs that rows share, made once a process."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

from scenewright.cli.main import run

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


@cache
def folder() -> Path:
    """Return a folder of this process, which goes with it."""
    made = Path(tempfile.mkdtemp(prefix="advice-"))
    atexit.register(_remove, made, os.getpid())
    return made


def _remove(made: Path, maker: int) -> None:
    if os.getpid() == maker:  # and not a process forked from it
        shutil.rmtree(made, ignore_errors=True)


@cache
def golden() -> str:
    """Return a folder with an artifact of every kind, named by it: whole documents, large payloads left out."""
    for version in sorted(GOLDEN.glob("v*")):
        shutil.copytree(version, folder() / "golden", dirs_exist_ok=True)
    return str(folder() / "golden")


@cache
def room() -> str:
    """Return a folder with the sequence of a small room that was ingested from `log/frames.mcap`: four frames."""
    from tests.unit.segment.test_stage import write_sequence

    made = folder() / "room"
    log = write_sequence(made / "log").sequence.path("frames.mcap")
    assert run(["ingest", "--log", str(log), "--out", str(made / "sequence")]) == 0
    return str(made)


@cache
def tiny() -> str:
    """Return a run folder with a small whole artifact of every kind, named by it."""
    from tests.unit.housekeeping.tiny_run import make_tiny_run

    return str(make_tiny_run(folder() / "tiny"))


@cache
def seen() -> str:
    """Return the panoptic map of a floor, a table, two cups and a cabinet."""
    from tests.unit.edit.maps import room_map

    room_map(folder() / "seen")
    return str(folder() / "seen")


INPUTS = {"golden": golden, "room": room, "tiny": tiny, "seen": seen}
"""What stands for `{name}` in a row's commands."""
