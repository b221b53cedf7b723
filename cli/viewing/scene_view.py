"""Interactive scenes, with what is known of the models and joints that they are made of."""

from __future__ import annotations

from scenewright.cli.viewing.inputs import input_artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.scenes import draw_scene_with_graph


def draw_interactive_scene(scene: InteractiveScene, canvas: Canvas) -> None:
    """Draw the links, the boxes and the contact graph, and what can be trusted."""
    cad_scene = input_artifact(scene, CadScene)
    draw_scene_with_graph(scene, cad_scene.info if cad_scene is not None else None, canvas)
