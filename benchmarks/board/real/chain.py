"""The chain from a log to an interactive scene, command by command, as the pipeline `reconstruct` runs it."""

from __future__ import annotations

import fcntl
import json
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence

from benchmarks.board.method import Method, MethodFailed
from benchmarks.board.real.logs import Log
from benchmarks.steps import Kind, opened

CHAIN = (
    ("ingest", "sequence", ()),
    ("segment", "segments", ("sequence",)),
    ("articulate", "articulations", ("sequence",)),
    ("fuse", "panoptic_map", ("sequence", "segments", "articulations")),
    ("graph", "contact_graph", ("panoptic_map",)),
    ("cad", "cad_scene", ("contact_graph", "panoptic_map", "articulations")),
    ("urdf", "interactive_scene", ("cad_scene",)),
)
"""Command, what it writes, what it reads of what stands before it."""
FOLDERS: dict[type[Artifact], str] = {
    Sequence: "sequence",
    PanopticMap: "panoptic_map",
    ContactGraph: "contact_graph",
    CadScene: "cad_scene",
    InteractiveScene: "interactive_scene",
}
NOT_OF_THE_METHOD = (5, 6, 130)
"""Exit codes of a missing dependency, a machine that failed, and somebody who stopped it."""
SECONDS = "seconds.json"
"""Beside the artifacts: processor seconds of each command, which stay known when nothing is made anew."""


@dataclass(frozen=True)
class Run:
    """What the chain made of a log."""

    folder: Path
    seconds: dict[str, float]
    """Command -> processor seconds."""
    done: tuple[str, ...] = ()
    """The artifacts that stand."""
    failed: str = ""
    """What stopped it, in words; empty where it went through."""

    def made(self, kind: type[Kind]) -> Kind | None:
        """The artifact of this kind; None where the chain stopped before it. Raises BadInput when it is broken."""
        name = FOLDERS[kind]
        return opened(kind, self.folder / name) if name in self.done else None


def run_chain(
    method: Method, log: Log, folder: Path, library: Path, masks: tuple[str, ...] = (), last: str = "urdf"
) -> Run:
    """Run the chain of a log in `folder`, to the command `last`; nothing is made twice.

    `library`: where the method's CAD library stands, or is made. `masks`: options of `segment`. A command that fails
    stops the chain, which is a result; MethodFailed is raised where the machine failed.
    """
    kept = folder / SECONDS
    seconds: dict[str, float] = json.loads(kept.read_text()) if kept.is_file() else {}
    done: list[str] = []
    try:
        for command, out, needed in CHAIN:
            if command == "cad":
                make_library(method, library)
            words = [word for name in needed for word in (f"--{name.replace('_', '-')}", str(folder / name))]
            words += {"ingest": log.words, "segment": masks, "cad": ("--library", str(library))}.get(command, ())
            if spent := method.run(command, folder / out, *words):
                seconds[command] = spent
                kept.write_text(json.dumps(seconds, indent=1) + "\n")
            done.append(out)
            if command == last:
                break
    except MethodFailed as failure:
        if failure.exit_code in NOT_OF_THE_METHOD:
            raise
        return Run(folder, seconds, tuple(done), failure.message)
    return Run(folder, seconds, tuple(done))


def make_library(method: Method, library: Path) -> None:
    """Make the method's CAD library where it is missing; of processes that want it together one makes it, the others
    wait. Raises MethodFailed."""
    library.parent.mkdir(parents=True, exist_ok=True)
    with library.with_name(f".{library.name}.wait").open("w") as gate:
        fcntl.flock(gate, fcntl.LOCK_EX)
        method.run("library build", library, "--seed", 1)


def masks_of(data: Path) -> tuple[str, ...]:
    """Options of `segment` for the recorded logs: a detector trained on photographs, of the data folder.

    Raises BadInput when it is not there.
    """
    weights = data / "detectors" / "yolox_nano.onnx"
    if not weights.is_file():
        raise BadInput(f"{weights}: no detector", hint="docs/DATA.md says what the data folder holds")
    return ("--backend", "detector", "--weights", str(weights))
