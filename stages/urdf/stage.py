"""The functionally equivalent scene cg' as a kinematic tree (Han 2024, section 2.4.5)."""

from __future__ import annotations

from schemas.cad_scene import CadScene
from schemas.errors import UsageError
from schemas.interactive_scene import InteractiveScene
from schemas.vocabulary import load_vocabulary
from stages.kit.formats.scene_bundle import write_scene_bundle
from stages.kit.simulation.world import load_scene
from stages.kit.stage import Context
from stages.urdf.bodies import scene_bodies
from stages.urdf.parameters import UrdfParameters


def run(cad_scene: CadScene, *, parameters: UrdfParameters, context: Context) -> InteractiveScene:
    """Write the scene as URDF: supports become fixed or floating joints, joints of CAD models are kept.

    Raises UsageError for an unknown class, BadInput for a scene whose poses, models or meshes are broken.
    """
    movable = _movable_classes(parameters)
    with context.progress.step("read the CAD scene"):
        graph = cad_scene.graph
        bodies = scene_bodies(cad_scene, graph, movable)
    with context.progress.step("write and check the kinematic tree"):
        scene = write_scene_bundle(context.output, bodies, graph)
    with context.progress.step("settle in physics"):
        unstable = _unstable(context, parameters)
    summary = {
        "bodies": len(scene.bodies),
        "movable": sum(body.movable for body in scene.bodies),
        "joints": sum(len(body.joints) for body in scene.bodies),
        "cad_models": sum(body.model is not None for body in bodies),
        "unstable": len(unstable),
    }
    return InteractiveScene(context.output, outcome="ok" if scene.bodies else "empty", summary=summary)


def _unstable(context: Context, parameters: UrdfParameters) -> dict[str, float]:
    """Return movable body -> how far it moved [m], of those that do not stay when the scene is let go."""
    if parameters.settle_seconds == 0:
        return {}
    with load_scene(context.output) as world:
        moved = world.settle(parameters.settle_seconds)
    unstable = {name: distance for name, distance in sorted(moved.items()) if distance > parameters.settle_distance}
    for name, distance in unstable.items():
        context.logger.warning("%s does not stay where it was reconstructed: moved %.2f m in physics", name, distance)
    return unstable


def _movable_classes(parameters: UrdfParameters) -> frozenset[str]:
    vocabulary = load_vocabulary()
    names = {entry.name for entry in vocabulary.classes}
    for name in (*parameters.movable_classes, *parameters.fixed_classes):
        if name not in names:
            raise UsageError(f"class {name!r} is not in the vocabulary")
    movable = {entry.name for entry in vocabulary.classes if entry.movable} | set(parameters.movable_classes)
    return frozenset(movable - set(parameters.fixed_classes))
