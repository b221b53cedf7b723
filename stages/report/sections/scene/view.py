"""The interactive scene: its bodies, and the kinematic tree beside the contact graph."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.report.acting import body_rows
from scenewright.stages.report.kinematic_tree import Corresponding, corresponding_trees, read_joints
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any] | None:
    """Return tables of bodies; None without any. Raises BadInput when graph or URDF are no trees."""
    interactive_scene = page.given("interactive_scene", InteractiveScene)
    if interactive_scene is None:
        return None
    scene = interactive_scene.info
    movable = sum(body.movable for body in scene.bodies)
    joints = sum(len(body.joints) for body in scene.bodies)
    rows = body_rows(interactive_scene)
    listed = [row for row in rows if row.joints or row.movable] or rows
    if not listed:
        return None
    return {
        "bodies": listed,
        "fixed_bodies": [row for row in rows if row not in listed],
        "scene_text": f"{len(scene.bodies)} bodies, {movable} of them free to move, {joints} joints. "
        f"{scene.combined_file} is the whole kinematic tree; {scene.static_file} and one file per free body are for "
        "engines without floating joints." + _verdict(interactive_scene),
        "trees": _trees(interactive_scene),
    }


def _verdict(scene: InteractiveScene) -> str:
    """Return a sentence on what became of the scene when it was let go; empty where that was not tried."""
    if "settled" not in scene.summary:
        return ""
    marginal = scene.summary.get("marginal")
    doubt = f" A tenth of a millimetre may turn what is said of {marginal}." if marginal else ""
    if scene.outcome == "ok":
        count = scene.summary.get("movable", 0)
        return f" Let go for a few seconds, all {count} free bodies stay where they are.{doubt}"
    return f" It is {scene.outcome.replace('_', ' ')}: {scene.summary.get('reason', 'see its summary')}.{doubt}"


def _trees(interactive_scene: InteractiveScene) -> Corresponding | None:
    path = interactive_scene.path(interactive_scene.info.combined_file)
    if not path.is_file():
        return None
    try:
        return corresponding_trees(interactive_scene.graph, *read_joints(path))
    except ValueError as error:
        raise BadInput(f"{interactive_scene.path('graph.json')}: {error}", hint="run `urdf` again") from None
