"""From the contact graph to symbols: what is on what, in what, behind which door, and which doors are open."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.doors import is_closed, is_open
from scenewright.stages.kit.tasks.strips import Atom, Problem, atom_text
from scenewright.stages.plan.action import goal_checks
from scenewright.stages.plan.affordances import LAYOUT, affordance_atoms
from scenewright.stages.plan.domain import DOMAIN, START
from scenewright.stages.plan.world_model import WorldModel

COMFORT = 0.9
"""Height at which the arm likes to work [m]."""
BEHIND = 0.3
"""An item inside furniture counts as behind a part when its centre is at most this far beside the part [m]."""


def guarding_door(model: WorldModel, item: str, container: str) -> str | None:
    """Return the joint of a container behind whose part an item lies, None for an open compartment.

    The item stands on a region of the container: of the joints to open before a hand gets there, the one whose part
    covers the item's centre, seen against the direction in which it closes. An item that stands on no region (it was
    not reconstructed where it is) is taken to be behind the part that comes nearest to covering it.
    """
    region = model.region_under(item, container)
    if region is not None and len(region.doors) < 2:
        return region.doors[0] if region.doors else None
    candidates = region.doors if region is not None else tuple(joint.name for joint in model.records[container].joints)
    centre = apply(inverse(model.pose(container)), _centre(model, item))
    best: tuple[float, str] | None = None
    for name in candidates:
        outside = _beside(model, container, model.joint(container, name), centre)
        if (outside < BEHIND or region is not None) and (best is None or outside < best[0]):
            best = (outside, name)
    return None if best is None else best[1]


def _beside(model: WorldModel, container: str, joint: Joint, point: np.ndarray) -> float:
    """Return how far [m] a point (3,), body frame, lies beside a closed part; for a drawer, outside its box."""
    low, high = np.asarray(model.part_mesh(container, joint.part).bounds)
    outside = np.maximum(low - point, point - high)
    if joint.type == "revolute":
        outside = np.delete(outside, int(np.argmin(high - low)))
    return float(outside.max())


def _centre(model: WorldModel, item: str) -> np.ndarray:
    points = apply(model.pose(item), model.points(item))
    return (points.min(axis=0) + points.max(axis=0)) / 2


def symbolic_state(
    model: WorldModel, graph: ContactGraphFile, size_uncertainty: float = 0.0
) -> tuple[dict[str, str], frozenset[Atom]]:
    """Return the typed objects and the atoms that hold at the beginning.

    Movable bodies are items; bodies with moving parts are containers, each part a door; what has a horizontal plane
    is a surface, unless nothing is known to carry it: nothing is put there. Doors count as open or closed by their
    joint values; between the two they are neither. Affordances come from regions and grasps (`affordance_atoms`),
    relations from the contact graph.
    """
    objects = {START: "spot"}
    atoms: set[Atom] = {("near", START), ("hand_empty",)}
    for name, record in model.records.items():
        if record.carriable:
            objects[name] = "item"
        elif record.joints:
            objects[name] = "container"
        elif record.class_name in LAYOUT or record.relation == "unknown":
            objects[name] = "support" if record.class_name == "floor" else "thing"
        else:
            objects[name] = "surface"
        for joint in record.joints:
            objects[joint.name] = "door"
            value = model.joint_value(name, joint.name)
            if is_open(joint, value):
                atoms.add(("open", joint.name))
            elif is_closed(joint, value):
                atoms.add(("closed", joint.name))
    loaded = set()
    for link in graph.links:
        item, parent = link.target, link.source
        if link.relation in ("also_supports", "leans_on"):
            loaded.add(parent)  # it falls when this is moved
            continue
        if link.relation == "proximal" or objects.get(item) != "item" or parent not in model.records:
            continue
        loaded.add(parent)
        door = guarding_door(model, item, parent) if objects[parent] == "container" else None
        if door is None:
            atoms.add(("on", item, parent))
            if objects[parent] == "item":
                atoms.add(("carried_along", item, parent))
        else:
            atoms |= {("in", item, parent), ("behind", item, door)}
    atoms |= {("unmoved", name) for name, kind in objects.items() if kind == "item"}
    atoms |= {("clear", name) for name, kind in objects.items() if kind == "item" and name not in loaded}
    ordered = dict(sorted(objects.items(), key=lambda entry: (_discomfort(model, entry[0], entry[1]), entry[0])))
    return ordered, frozenset(atoms | affordance_atoms(model, objects, size_uncertainty))


def _discomfort(model: WorldModel, name: str, kind: str) -> float:
    """Return how far [m] the handle of a door is from a comfortable height: task search tries those near it first."""
    if kind != "door":
        return 0.0
    owner = model.owner(name)
    handle = model.joint(owner, name).handle
    if handle is None:
        return np.inf
    return round(abs(float(apply(model.pose(owner), np.array(handle))[2]) - COMFORT), 3)


_LITERAL = re.compile(r"^\s*(\w+)\s*\(\s*([^()]*?)\s*\)\s*$")


def parse_goal(literals: tuple[str, ...], objects: dict[str, str]) -> tuple[frozenset[Atom], tuple[str, ...]]:
    """Return the goal atoms of literals such as `on(bottle_7, table_3)`, and the literals in normal form.

    `closed(fridge_2)` and `open(fridge_2)` of a container mean all of its doors. Raises UsageError for what is no
    literal, an unknown predicate or object, or an argument of the wrong type.
    """
    atoms: set[Atom] = set()
    normal = []
    allowed = {name: kinds for name, kinds in DOMAIN.predicates.items() if name in goal_checks()}
    for literal in literals:
        match = _LITERAL.match(literal)
        if match is None:
            raise UsageError(f"goal {literal!r} is not a literal", hint="write it like on(bottle_7, table_3)")
        predicate = match[1]
        arguments = [word.strip() for word in match[2].split(",")]
        if predicate not in allowed:
            raise UsageError(f"goal {literal!r}: no predicate {predicate!r}", hint=f"known: {', '.join(allowed)}")
        if len(arguments) != len(allowed[predicate]):
            raise UsageError(
                f"goal {literal!r}: {predicate} takes {len(allowed[predicate])} arguments",
                hint=f"write it like {predicate}({', '.join(allowed[predicate])})",
            )
        for name in arguments:
            if name not in objects:
                raise UsageError(f"goal {literal!r}: the scene has no {name!r}", hint=near(name, objects))
        normal.append(atom_text((predicate, *arguments)))
        doors = [name for name in objects if name.startswith(f"{arguments[0]}__")]
        if predicate in ("open", "closed") and objects[arguments[0]] == "container":
            atoms |= {(predicate, door) for door in doors}
            continue
        for name, kind in zip(arguments, allowed[predicate], strict=True):
            if not DOMAIN.is_a(objects[name], kind):
                raise UsageError(
                    f"goal {literal!r}: {name} is a {objects[name]}, {predicate} needs a {kind}",
                    hint=f"of that kind: {some([other for other in objects if DOMAIN.is_a(objects[other], kind)])}",
                )
        atoms.add((predicate, *arguments))
    return frozenset(atoms), tuple(normal)


def near(name: str, names: Iterable[str]) -> str:
    """Return in words which of the names look like one that is none of them."""
    return f"near: {some(difflib.get_close_matches(name, list(names), n=3, cutoff=0.4))}"


def some(names: Sequence[str]) -> str:
    """Return the first five names in words."""
    return ", ".join(names[:5]) or "none"


def task_problem(objects: dict[str, str], initial: frozenset[Atom], goal: frozenset[Atom]) -> Problem:
    """Return the STRIPS problem of a scene."""
    return Problem("scene", objects, initial, goal)
