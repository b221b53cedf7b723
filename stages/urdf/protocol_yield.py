"""What a scene kept of the things that were seen: those that are in it, those of them that are free, and those that are
held although they should move. A scene that leaves things out, or nails them down, stands still by itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.mobility import mobility


@dataclass(frozen=True)
class Yield:
    """Counts of things, without floor, walls and ceiling."""

    seen: int | None
    """None where nobody says."""
    kept: int
    free: int
    held: tuple[str, ...] | None
    """Things that by class and place are free and that the scene has fixed; None where classes are not known."""


def scene_yield(folder: Path, seen: int | None = None) -> Yield:
    """Return what a scene folder kept. What was seen are the things of its contact graph (graph.json), or `seen`.

    Without a graph, as of other people's scenes, things are the free bodies and those with a joint that moves: of what
    stands fast, nothing tells a cupboard from a wall. Raises UsageError when `seen` is less than was kept.
    """
    bodies = InteractiveSceneFile.read(folder / "scene.json").bodies
    if (folder / "graph.json").is_file():
        graph = ContactGraphFile.read(folder / "graph.json")
        things = {node.id: node for node in graph.nodes if node.id != SCENE_NODE and node.node_type != "layout"}
        carriable = {entry.name for entry in load_vocabulary().classes if entry.movable}
        kept = [body for body in bodies if body.name in things]
        held = [body for body in kept if not body.movable and mobility(graph, things[body.name], carriable, ()).movable]
        counted = Yield(
            len(things) if seen is None else seen,
            len(kept),
            sum(body.movable for body in kept),
            tuple(body.name for body in held),
        )
    else:
        free = sum(body.movable for body in bodies)
        counted = Yield(seen, sum(body.movable or bool(body.joint_values) for body in bodies), free, None)
    if counted.seen is not None and counted.seen < counted.kept:
        raise UsageError(f"--seen {counted.seen}: the scene holds {counted.kept} things", hint="count those too")
    return counted
