"""What the method gets of a room: made by the generator of one commit, for ever, so that figures compare.

The generator is a worktree of `GENERATOR`; the two files of `generator/` run in it. A change of either makes another
board, with another number and other figures. `digests.json` holds what the inputs of the public rooms hash to.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from benchmarks.board.method import Method, MethodFailed, checkout_of

BOARD = 1
GENERATOR = "412dc5f3"
SCRIPTS = Path(__file__).with_name("generator")
LIBRARY_SEED, OTHER_SEED = 1, 501
"""Of the library that rooms are furnished from, and of the one whose shapes no room has."""
FRAMES = 40
"""Frames of a room that are mapped."""
DENSER = 10
"""Frames of the recording for each one that is mapped: a map takes few, a camera that is tracked gives many."""
RESCALED = 0.2
"""Largest share by which things are larger or smaller than their models where sizes are wrong."""
SIZE = ("--width", 320, "--height", 240)
PUBLIC = (
    *(f"{recipe}-{seed}" for seed in (9001, 9002) for recipe in ("kitchen", "office", "bedroom", "room")),
    *(f"{recipe}-{seed}" for seed in (9001, 9002, 9003, 9004) for recipe in ("household", "lodging")),
)
"""The rooms that stay the same: seen, and for a curve over versions."""
LADDER = (*PUBLIC[:4], *PUBLIC[8:10])
"""Those that every rung runs in."""


@dataclass(frozen=True)
class Rung:
    """What a reconstruction has to live with."""

    title: str
    noise: bool = True
    errors: str = "detector"
    """Whose errors the masks have (`segment --lasting`), or `none`."""
    bent: bool = False
    estimated: bool = False
    lacking: bool = False
    rescaled: bool = False

    @property
    def recording(self) -> str:
        """Name of the recording that it takes."""
        return "rescaled" if self.rescaled else "plain" if self.noise else "exact"


RUNGS = {
    "perfect": Rung("exact depth, true masks, true poses, own models", noise=False, errors="none"),
    "errors": Rung("masks with lasting errors of a detector, noisy depth"),
    "bent": Rung("and depth that is too long, bends and lies beside the picture", bent=True),
    "estimated": Rung("and poses estimated by `poses`", bent=True, estimated=True),
    "stand_ins": Rung("and a library without the room's styles", bent=True, estimated=True, lacking=True),
    "everything": Rung(
        "and sizes wrong by up to 20 %: everything at once", bent=True, estimated=True, lacking=True, rescaled=True
    ),
}
HEADLINE = "everything"


@dataclass(frozen=True)
class RoomInputs:
    """Paths of what the method gets, and of the truth that it is judged by."""

    log: Path
    every: int
    """Which frames of the log are mapped: every so many."""
    masks: Path
    truth: Path
    library: Path


class Generator:
    """Makes rooms below a folder by the generator's commit; what is there stays."""

    def __init__(self, root: Path, commit: str = GENERATOR) -> None:
        self.root = root
        self.checkout = checkout_of(commit, root / "generator")
        self.method = Method(self.checkout)

    def prepare(self) -> None:
        """Make both libraries. Raises MethodFailed."""
        for name, seed in (("library", LIBRARY_SEED), ("other_library", OTHER_SEED)):
            self._made(self.root / name, partial(self._library, seed))

    def _library(self, seed: int, out: Path) -> None:
        self._run("library build", out, "--seed", seed)

    def truth(self, name: str, rung: Rung, *, clutter: str = "medium") -> Path:
        """Return the true room, made where it is missing. Raises MethodFailed, for a seed without a room."""
        recipe, seed = name.rsplit("-", 1)
        dense = rung.recording != "exact"
        frames = DENSER * (FRAMES - 1) + 1 if dense else FRAMES
        drawn = ("--recipe", recipe, "--seed", seed, "--clutter", clutter, "--frames", frames, *SIZE)
        more = () if dense else ("--no-depth-noise",)
        scale = ("--rescaled", RESCALED) if rung.rescaled else ()
        words = ("--library", self.root / "library", *drawn, *more, *scale)
        folder = self.root / "rooms" / name / rung.recording
        return self._made(folder / "truth", lambda out: self._run("synthesize", out, *words))

    def room(self, name: str, rung: Rung, *, clutter: str = "medium") -> RoomInputs:
        """Return the inputs of a room, made where they are missing. Raises MethodFailed, for a seed without a room."""
        folder, library = self.root / "rooms" / name / rung.recording, self.root / "library"
        truth, dense = self.truth(name, rung, clutter=clutter), rung.recording != "exact"
        log, every = truth / "log.mcap", DENSER if dense else 1
        mapped = self._made(folder / "frames", lambda out: self._run("ingest", out, "--log", log, "--every", every))
        drawn_by = error_seed(f"{name}/{rung.recording}")
        told = ("--sequence", mapped, "--errors", rung.errors, "--seed", drawn_by)
        if rung.bent:
            whole = self._made(folder / "dense", lambda out: self._run("ingest", out, "--log", log))
            spoiled = self._made(
                folder / "bent", lambda out: self._script("spoil", *told, "--masks", out / "masks", *bent(whole, out))
            )
            log, masks = spoiled / "log.mcap", spoiled / "masks"
        else:
            masks = self._made(
                folder / f"masks_{rung.errors}", lambda out: self._script("spoil", *told, "--masks", out)
            )
        chosen = library
        if rung.lacking:
            given = ("--library", self.root / "other_library", "--own", library, "--truth", truth)
            chosen = self._made(folder / "lacking", lambda out: self._script("lacking", *given, "--out", out))
        return RoomInputs(log, every, masks, truth, chosen)

    def every_frame(self, name: str) -> RoomInputs:
        """Return the inputs of a room with masks of every frame of its recording, errors as in the rung `errors`.

        No part of the board. Raises MethodFailed.
        """
        rung = RUNGS["errors"]
        folder, mapped = self.root / "rooms" / name / rung.recording, self.room(name, rung)
        whole = self._made(folder / "dense", lambda out: self._run("ingest", out, "--log", mapped.log))
        drawn_by = error_seed(f"{name}/{rung.recording}")
        told = ("--sequence", whole, "--errors", rung.errors, "--seed", drawn_by)
        masks = self._made(folder / "masks_all", lambda out: self._script("spoil", *told, "--masks", out))
        return RoomInputs(mapped.log, 1, masks, mapped.truth, mapped.library)

    def _run(self, command: str, out: Path, *words: object) -> None:
        self.method.run(command, out, *words)

    def _script(self, name: str, *words: object) -> None:
        command = [sys.executable, str(SCRIPTS / f"{name}.py"), *map(str, words)]
        told = {**os.environ, "PYTHONPATH": str(self.checkout)}
        done = subprocess.run(command, env=told, capture_output=True, text=True, check=False)
        if done.returncode:
            raise MethodFailed(f"generator/{name}.py", done.returncode, (done.stderr.strip() or "?").splitlines()[-1])

    def _made(self, out: Path, make: Callable[[Path], None]) -> Path:
        """Return `out`, which appears whole: made beside it and moved there."""
        if not out.exists():
            partial = out.with_name(f"{out.name}.partial")
            shutil.rmtree(partial, ignore_errors=True)
            partial.parent.mkdir(parents=True, exist_ok=True)
            make(partial)
            partial.rename(out)
        return out


def bent(dense: Path, out: Path) -> tuple[object, ...]:
    """Return the options of `spoil.py` that write a log whose depth is wrong."""
    return ("--dense", dense, "--bent", out / "log.mcap")


def error_seed(name: str) -> int:
    """Return the number that the errors of a recording are drawn with."""
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=4).digest(), "big") >> 1
