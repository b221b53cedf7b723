"""Why a body of an interactive scene is free or fixed, how its joints move, and whether it settled."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

import numpy as np
from scenewright.cli.explaining.reason import Reason, Reasons, length, listed
from scenewright.schemas.cad_scene import SURROUNDINGS
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.interactive_scene import InteractiveScene, InteractiveSceneFile, SceneBody, SettledBody
from scenewright.schemas.scene_parts import Joint
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.mobility import STANDS, Mobility, mobility

HELD, INFERRED = "held: ", "inferred: "
"""How `because` of a body begins (schemas/interactive_scene.py)."""


def scene_reasons(scene: InteractiveScene) -> Reasons:
    """Return the reasons of every body and of every joint that moves."""
    options = {} if scene.manifest is None else scene.manifest.parameters
    fixed = frozenset(_names(options.get("fixed_classes")))
    carriable = {entry.name for entry in load_vocabulary().classes if entry.movable}
    carriable |= set(_names(options.get("movable_classes")))
    rows = body_reasons(scene.info, scene.graph, carriable - fixed, fixed)
    if (settling := scene.settling) is not None:
        for body in settling.bodies:
            if body.name in rows:
                rows[body.name].append(settled_reason(body, settling.margins.get(body.name)))
    return rows


def body_reasons(
    scene: InteractiveSceneFile, graph: ContactGraphFile, carriable: Collection[str], fixed: Collection[str]
) -> Reasons:
    """Return the reasons of bodies and joints. `carriable`, `fixed`: classes, as `mobility` takes them."""
    nodes, rows = {node.id: node for node in graph.nodes}, {}
    for body in scene.bodies:
        expected = mobility(graph, nodes[body.name], carriable, fixed) if body.name in nodes else None
        load = [b.name for b in scene.bodies if b.parent == body.name and not b.movable and b.relation in STANDS]
        joints = [Reason(*joint_words(joint, body.joint_values.get(joint.name))) for joint in body.joints]
        rows[body.name] = [_free_or_fixed(body, expected, load), *_inferred(body), *_laid_down(body), *joints]
        rows |= {joint.name: [reason] for joint, reason in zip(body.joints, joints, strict=True)}
    return rows


def joint_words(joint: Joint, value: float | None) -> tuple[str, dict[str, object]]:
    """Return how a joint moves, in words and as facts."""
    verb, unit, factor = ("turns", "degrees", 180 / math.pi) if joint.type == "revolute" else ("slides", "mm", 1000.0)
    says = f"The joint {joint.name} {verb} {joint.part} from {factor * joint.lower:.0f} to {factor * joint.upper:.0f}"
    says += f" {unit}."
    if value is not None:
        says += f" It was seen at {factor * value:.0f} {unit}."
    return says, joint.model_dump(mode="json") | {"value": value}


def settled_reason(body: SettledBody, margin: float | None) -> Reason:
    """Return what became of a body in the settle test. `margin`: of that verdict [standard deviations]."""
    motion = f"moved {length(body.moved)} and turned {math.degrees(body.turned):.1f} degrees"
    fate = "it stays" if body.leaves is None else f"it left its place after {body.leaves:.1f} s"
    fate = "it fell through the floor" if body.fell_through else fate
    says = f"Let go in physics, it {motion}: {fate}."
    if margin is not None:
        says += f" That is {margin:.1f} standard deviations from the limit."
    return Reason(says, body.model_dump(mode="json", exclude={"poses"}) | {"margin": margin})


def _free_or_fixed(body: SceneBody, expected: Mobility | None, load: list[str]) -> Reason:
    facts = {"movable": body.movable, "furniture": body.furniture, "parent": body.parent, "mass": body.mass}
    state = "free" if body.carriable else "free as furniture, which no arm carries" if body.movable else "fixed"
    if body.name == SURROUNDINGS:
        why = "it is all that was mapped and has no name"
    elif body.because.startswith(HELD):
        why = body.because.removeprefix(HELD)
    elif expected is None:
        why = "the graph has no node of it"
    elif expected.movable == body.movable:
        why = expected.why
    elif body.movable:
        why = "`urdf` was given other classes"
    else:
        why = f"it carries {listed(load)}, fixed too" if load else "it was made before scenes said why"
    return Reason(f"It is {state}: {why}.", facts | {"why": why})


def _inferred(body: SceneBody) -> Iterator[Reason]:
    if body.because.startswith(INFERRED):
        what, _, why = body.because.removeprefix(INFERRED).partition("; ")
        yield Reason(f"Nobody saw {what} of it: {why}.", {"inferred": what, "because": why})


def _laid_down(body: SceneBody) -> Iterator[Reason]:
    if body.world_from_reconstructed is not None:
        before, after = np.array(body.world_from_reconstructed), np.array(body.world_from_body)
        moved = float(np.linalg.norm(after[:3, 3] - before[:3, 3]))
        yield Reason(f"Physics laid it down: it came to rest {length(moved)} from where it was seen.", {"moved": moved})


def _names(value: object) -> tuple[str, ...]:
    return tuple(map(str, value)) if isinstance(value, list | tuple) else ()
