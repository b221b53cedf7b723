"""From the inputs of a room to a scene in physics, by the commands of a method, as a user runs them."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path

from benchmarks.board.inputs import RoomInputs
from benchmarks.board.method import Method

ARMS_FILE = Path(__file__).with_name("arms.toml")
SCENE_OPTIONS = ("--no-rest", "--settle-seconds", "0")
"""The scene as it was reconstructed: the board lets it go itself."""
PROCESSOR = "processor"
"""Entry of an artifact's timings.json: processor time of all of its step."""
LOST = ("--accept", "tracking_lost", "--accept", "contradictory")


@dataclass(frozen=True)
class Arm:
    """What is given to the steps."""

    title: str
    segment: tuple[str, ...] = ()
    fuse: tuple[str, ...] = ()
    graph: tuple[str, ...] = ()
    cad: tuple[str, ...] = ()


def read_arms(file: Path = ARMS_FILE) -> dict[str, Arm]:
    """Return the arms by name."""
    told = tomllib.loads(file.read_text(encoding="utf-8"))
    return {
        name: Arm(entry["title"], *(tuple(entry.get(step, ())) for step in ("segment", "fuse", "graph", "cad")))
        for name, entry in told.items()
    }


ARMS = read_arms()


@dataclass(frozen=True)
class Reconstruction:
    """Where the artifacts of one arm stand."""

    folder: Path
    """Of what the arms share: the frames."""
    arm: Path

    @property
    def sequence(self) -> Path:
        """The frames that were mapped."""
        return self.folder / "sequence"

    @property
    def panoptic_map(self) -> Path:
        """The map."""
        return self.arm / "panoptic_map"

    @property
    def graph(self) -> Path:
        """The contact graph."""
        return self.arm / "contact_graph"

    @property
    def cad_scene(self) -> Path:
        """The scene of CAD models."""
        return self.arm / "cad_scene"

    @property
    def scene(self) -> Path:
        """The scene in physics."""
        return self.arm / "interactive_scene"


def reconstruct(
    method: Method, arm: str, inputs: RoomInputs, folder: Path, *, estimated: bool = False
) -> tuple[Reconstruction, dict[str, float]]:
    """Return the artifacts of an arm, and the processor seconds of each step. What arms share is made once
    and counts for each.

    Raises MethodFailed where a step ends without an artifact.
    """
    made, own = Reconstruction(folder, folder / arm), ARMS[arm]
    told: tuple[object, ...] = ("--log", inputs.log, *(("--every", inputs.every) if inputs.every > 1 else ()))
    method.run("ingest", made.sequence, *told)
    pose: tuple[object, ...] = ()
    if estimated:
        method.run("ingest", folder / "recording", "--log", inputs.log)
        trajectory = folder / "trajectory"
        method.run("poses", trajectory, "--sequence", folder / "recording", *LOST)
        pose = ("--trajectory", trajectory)
    frames = ("--sequence", made.sequence)
    given = ("--backend", "masks", "--masks", inputs.masks)
    method.run("segment", made.arm / "segments", *frames, *given, *own.segment)
    segments = ("--segments", made.arm / "segments")
    method.run("fuse", made.panoptic_map, *frames, *segments, *pose, *own.fuse)
    of_map = ("--panoptic-map", made.panoptic_map)
    method.run("graph", made.graph, *of_map, *own.graph)
    of_graph = ("--contact-graph", made.graph, *of_map, "--library", inputs.library)
    method.run("cad", made.cad_scene, *of_graph, *own.cad)
    method.run("urdf", made.scene, "--cad-scene", made.cad_scene, *SCENE_OPTIONS)
    steps = {
        "ingest": made.sequence,
        **({"poses": folder / "trajectory"} if estimated else {}),
        "segment": made.arm / "segments",
        "fuse": made.panoptic_map,
        "graph": made.graph,
        "cad": made.cad_scene,
        "urdf": made.scene,
    }
    return made, {name: processor_seconds(artifact) for name, artifact in steps.items()}


def processor_seconds(artifact: Path) -> float:
    """Return what a step says that it took, whoever ran it and when [s]."""
    told = json.loads((artifact / "timings.json").read_bytes())
    return round(float(told[PROCESSOR]), 2)
