"""The functionally equivalent scene cg' as a kinematic tree (Han 2024, section 2.4.5)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.errors import UsageError
from scenewright.schemas.interactive_scene import InteractiveScene, InteractiveSceneFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.simulation.margins import is_marginal
from scenewright.stages.kit.stage import Context
from scenewright.stages.urdf.bodies import scene_bodies, seen_floors
from scenewright.stages.urdf.doubts import doubts_of
from scenewright.stages.urdf.exports import write_exports
from scenewright.stages.urdf.giving_way import given_way
from scenewright.stages.urdf.parameters import UrdfParameters
from scenewright.stages.urdf.piece_merging import merged_bodies
from scenewright.stages.urdf.resting import rested_bodies
from scenewright.stages.urdf.settle_margins import with_margins
from scenewright.stages.urdf.settle_report import SettleReport, settle_file, settle_report
from scenewright.stages.urdf.spawning import spawn_of
from scenewright.stages.urdf.wedged import wedged_furniture


def run(cad_scene: CadScene, *, parameters: UrdfParameters, context: Context) -> InteractiveScene:
    """Write the scene as URDF: supports become fixed or floating joints, joints of CAD models are kept.

    Raises UsageError for an unknown class, BadInput for a scene whose poses, models or meshes are broken.
    """
    movable = _movable_classes(parameters)
    with context.progress.step("read the CAD scene"):
        graph = cad_scene.graph
        bodies = scene_bodies(cad_scene, graph, movable, parameters.fixed_classes)
        spawn = spawn_of(bodies, seen_floors(cad_scene))

    def write(bodies: list[BundleBody]) -> InteractiveSceneFile:
        return write_scene_bundle(context.output, bodies, graph, spawn, doubts_of(cad_scene, bodies))

    with context.progress.step("write and check the kinematic tree"):
        scene = write(bodies)
    with context.progress.step("cut meshes that lie in other things"):
        bodies = given_way(context.output, bodies)
    cut = sum(bool(body.cut) for body in bodies)
    if cut:
        scene = write(_for_rewriting(bodies))
    wedged = _find_wedged(context)
    if wedged:
        bodies = _hold(context.output, bodies, wedged)
        scene = write(bodies)
    with context.progress.step("merge small pieces"):
        before, bodies = bodies, merged_bodies(context.output, bodies)
        merged = [body.name for body, whole in zip(bodies, before, strict=True) if body is not whole]
    if merged:
        _remove_shapes(context.output, merged)
        scene = write(_for_rewriting(bodies))
    rested = 0
    if parameters.rest:
        with context.progress.step("lay movable bodies down"):
            laid = rested_bodies(context.output, bodies)
            rested = sum(body.reconstructed is not None for body in laid)
            if rested:
                scene = write(_for_rewriting(laid))
    with context.progress.step("write what stands beside it"):
        write_exports(context.output, scene)
    summary: dict[str, float | str] = {
        "bodies": len(scene.bodies),
        "movable": sum(body.movable for body in scene.bodies),
        "joints": sum(len(body.joints) for body in scene.bodies),
        "cad_models": sum(body.model is not None for body in bodies),
        "rested": rested,
        "held": len(wedged),
        "cut": cut,
    }
    outcome = "ok" if scene.bodies else "empty"
    if parameters.settle_seconds:
        with context.progress.step("settle in physics"):
            report = _settle(context, parameters)
        settle_file(report).write(context.output / "settle.json")
        summary |= _measures(report)
        if scene.bodies and not report.settled:
            outcome, summary["reason"] = report.verdict, report.reason
        if is_marginal(report.margin):
            summary["verdict"] = "marginal"
    return InteractiveScene(context.output, outcome=outcome, summary=summary)


def _find_wedged(context: Context) -> dict[str, str]:
    """Return the furniture of the scene just written that cannot be free, and say so."""
    with context.progress.step("look for what is wedged"):
        carrier_of = wedged_furniture(context.output)
    for name, carrier in sorted(carrier_of.items()):
        context.logger.warning("%s could be pushed but lies in %s: it stays", name, carrier)
    return carrier_of


def _hold(root: Path, bodies: list[BundleBody], wedged: Mapping[str, str]) -> list[BundleBody]:
    """Return the bodies for another writing into `root`, those held that lie in something (body -> what it lies in);
    removes what only free ones have there."""
    for name in wedged:
        (root / "bodies" / f"{name}.urdf").unlink()
    _remove_shapes(root, wedged)
    rewritten = _for_rewriting(bodies)
    return [
        replace(body.as_held(f"it lies in {wedged[body.name]}"), cut={}) if body.name in wedged else body
        for body in rewritten
    ]


def _remove_shapes(root: Path, names: Iterable[str]) -> None:
    """Remove the collision shapes of bodies that keep their mesh; another writing makes those that are needed."""
    for name in names:
        for pattern in ("collision_*.obj", "cut_*.obj"):
            for file in (root / "meshes" / name).glob(pattern):
                file.unlink()


def _for_rewriting(bodies: Sequence[BundleBody]) -> list[BundleBody]:
    """Return the bodies for another writing into the same folder."""
    return [replace(body, mesh_is_written=body.mesh is not None) for body in bodies]


def _settle(context: Context, parameters: UrdfParameters) -> SettleReport:
    """Run the settle test on the scene just written and warn of what it finds."""
    report = settle_report(
        context.output,
        parameters.settle_seconds,
        moved_limit=parameters.settle_distance,
        turned_limit=math.radians(parameters.settle_angle),
    )
    report = with_margins(report, context.output)
    for body in report.unsettled:
        fate = "falls through the floor" if body.fell_through else "does not stay where it was reconstructed"
        context.logger.warning(
            "%s %s: moved %.3f m, turned %.1f degrees in physics",
            body.name,
            fate,
            body.moved,
            math.degrees(body.turned),
        )
    for joint in report.blocked:
        context.logger.warning("%s meets %s at the start of its motion", joint.joint, joint.hit_link)
    return report


def _measures(report: SettleReport) -> dict[str, float | str]:
    marginal = {"marginal": ", ".join(report.marginal)} if report.marginal else {}
    return marginal | {
        "settled": float(report.settled),
        "unstable": len(report.unsettled),
        "fell_through": sum(body.fell_through for body in report.bodies),
        "largest_move_mm": round(1000 * max((body.moved for body in report.bodies), default=0.0), 3),
        "blocked_joints": len(report.blocked),
        "max_penetration_mm": round(report.max_penetration_mm, 3),
        "collisions": len(report.collisions),
    }


def _movable_classes(parameters: UrdfParameters) -> frozenset[str]:
    vocabulary = load_vocabulary()
    names = {entry.name for entry in vocabulary.classes}
    for name in (*parameters.movable_classes, *parameters.fixed_classes):
        if name not in names:
            raise UsageError(f"class {name!r} is not in the vocabulary", hint="name a class of data/vocabulary.toml")
    movable = {entry.name for entry in vocabulary.classes if entry.movable} | set(parameters.movable_classes)
    return frozenset(movable - set(parameters.fixed_classes))
