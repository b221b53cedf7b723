"""From the contact graph to symbols: what is on what, in what, behind which door, and which doors are open."""

from __future__ import annotations

import difflib
import re

import numpy as np

from schemas.contact_graph import ContactGraphFile
from schemas.errors import UsageError
from stages.kit.geometry.transforms import apply, inverse
from stages.plan.door_motion import is_closed, is_open
from stages.plan.strips import Atom, Domain, Problem, Schema, atom_text
from stages.plan.world_model import WorldModel

START = "start"
SURFACE_CLASSES = ("table", "desk", "shelf", "cabinet", "bench")

BEHIND = 0.3
"""An item inside furniture counts as behind a part when its centre is at most this far beside the part [m]."""

DOMAIN = Domain(
    name="mobile_manipulation",
    types={
        "thing": "",
        "support": "thing",
        "item": "support",
        "surface": "support",
        "container": "support",
        "door": "thing",
        "spot": "thing",
    },
    predicates={
        "near": ("thing",),
        "on": ("item", "support"),
        "in": ("item", "container"),
        "behind": ("item", "door"),
        "entrance": ("door", "container"),
        "clear": ("support",),
        "holding": ("item",),
        "hand_empty": (),
        "open": ("door",),
        "closed": ("door",),
    },
    schemas=(
        Schema("drive", (("?from", "thing"), ("?to", "thing")), (("near", "?from"),), (("near", "?to"),),
               (("near", "?from"),)),
        Schema("pick", (("?item", "item"), ("?from", "support")),
               (("near", "?item"), ("on", "?item", "?from"), ("clear", "?item"), ("hand_empty",)),
               (("holding", "?item"), ("clear", "?from")), (("on", "?item", "?from"), ("hand_empty",))),
        Schema("take_out", (("?item", "item"), ("?from", "container"), ("?door", "door")),
               (("near", "?item"), ("in", "?item", "?from"), ("behind", "?item", "?door"), ("open", "?door"),
                ("clear", "?item"), ("hand_empty",)),
               (("holding", "?item"),),
               (("in", "?item", "?from"), ("behind", "?item", "?door"), ("hand_empty",))),
        Schema("place", (("?item", "item"), ("?on", "surface")), (("holding", "?item"), ("near", "?on")),
               (("on", "?item", "?on"), ("hand_empty",)), (("holding", "?item"),)),
        Schema("put_in", (("?item", "item"), ("?in", "container"), ("?door", "door")),
               (("holding", "?item"), ("near", "?in"), ("entrance", "?door", "?in"), ("open", "?door")),
               (("in", "?item", "?in"), ("behind", "?item", "?door"), ("hand_empty",)), (("holding", "?item"),)),
        Schema("open", (("?door", "door"),), (("near", "?door"), ("hand_empty",)), (("open", "?door"),),
               (("closed", "?door"),)),
        Schema("close", (("?door", "door"),), (("near", "?door"), ("hand_empty",)), (("closed", "?door"),),
               (("open", "?door"),)),
    ),
)  # fmt: skip
"""The domain. `take_out` and `put_in` are `pick` and `place` through a door."""


def guarding_door(model: WorldModel, item: str, container: str) -> str | None:
    """Return the joint of a container behind whose closed part an item lies, None for an open compartment.

    The part that covers the item's centre, seen against the direction in which the part closes (for drawers: whose box
    holds the centre), or comes nearest to doing so: reconstructed items are not always where they should be.
    """
    centre = apply(inverse(model.pose(container)), _centre(model, item))
    best: tuple[float, str] | None = None
    for joint in model.records[container].joints:
        mesh = model.part_mesh(container, joint.part)
        low, high = np.asarray(mesh.bounds)
        if joint.type == "prismatic":
            outside = float(np.maximum(low - centre, centre - high).max())
        else:
            thin = int(np.argmin(high - low))
            others = [axis for axis in range(3) if axis != thin]
            outside = float(np.maximum(low - centre, centre - high)[others].max())
        if outside < BEHIND and (best is None or outside < best[0]):
            best = (outside, joint.name)
    return None if best is None else best[1]


def _centre(model: WorldModel, item: str) -> np.ndarray:
    points = apply(model.pose(item), model.points(item))
    return (points.min(axis=0) + points.max(axis=0)) / 2


def symbolic_state(model: WorldModel, graph: ContactGraphFile) -> tuple[dict[str, str], frozenset[Atom]]:
    """Return the typed objects and the atoms that hold at the beginning.

    Movable bodies are items; bodies with moving parts are containers, each part a door; what has a horizontal plane
    is a surface. Doors count as open or closed by their joint values; between the two they are neither.
    """
    objects = {START: "spot"}
    atoms: set[Atom] = {("near", START), ("hand_empty",)}
    for name, record in model.records.items():
        if record.movable:
            objects[name] = "item"
        elif record.joints:
            objects[name] = "container"
        elif record.class_name in SURFACE_CLASSES and any(plane.horizontal for plane in model.planes[name]):
            objects[name] = "surface"
        else:
            objects[name] = "support" if record.class_name not in ("wall", "ceiling") else "thing"
        for joint in record.joints:
            objects[joint.name] = "door"
            atoms.add(("entrance", joint.name, name))
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
        door = guarding_door(model, item, parent) if link.relation == "contains" else None
        if door is None:
            atoms.add(("on", item, parent))
        else:
            atoms |= {("in", item, parent), ("behind", item, door)}
    atoms |= {("clear", name) for name, kind in objects.items() if kind == "item" and name not in loaded}
    return objects, frozenset(atoms)


_LITERAL = re.compile(r"^\s*(\w+)\s*\(\s*([^()]*?)\s*\)\s*$")


def parse_goal(literals: tuple[str, ...], objects: dict[str, str]) -> tuple[frozenset[Atom], tuple[str, ...]]:
    """Return the goal atoms of literals such as `on(bottle_7, table_3)`, and the literals in normal form.

    `closed(fridge_2)` and `open(fridge_2)` of a container mean all of its doors. Raises UsageError for what is no
    literal, an unknown predicate or object, or an argument of the wrong type.
    """
    atoms: set[Atom] = set()
    normal = []
    allowed = {
        name: kinds for name, kinds in DOMAIN.predicates.items() if name in ("on", "in", "holding", "open", "closed")
    }
    for literal in literals:
        match = _LITERAL.match(literal)
        if match is None:
            raise UsageError(f"goal {literal!r} is no literal", hint="write it like on(bottle_7, table_3)")
        predicate = match[1]
        arguments = [word.strip() for word in match[2].split(",")]
        if predicate not in allowed:
            raise UsageError(f"goal {literal!r}: no predicate {predicate!r}", hint=f"known: {', '.join(allowed)}")
        if len(arguments) != len(allowed[predicate]):
            raise UsageError(f"goal {literal!r}: {predicate} takes {len(allowed[predicate])} arguments")
        for name in arguments:
            if name not in objects:
                near = difflib.get_close_matches(name, objects, n=3, cutoff=0.4)
                raise UsageError(
                    f"goal {literal!r}: the scene has no {name!r}", hint=f"near: {', '.join(near) or 'none'}"
                )
        normal.append(atom_text((predicate, *arguments)))
        doors = [name for name in objects if name.startswith(f"{arguments[0]}__")]
        if predicate in ("open", "closed") and objects[arguments[0]] == "container":
            atoms |= {(predicate, door) for door in doors}
            continue
        for name, kind in zip(arguments, allowed[predicate], strict=True):
            if not DOMAIN.is_a(objects[name], kind):
                raise UsageError(f"goal {literal!r}: {name} is a {objects[name]}, {predicate} needs a {kind}")
        atoms.add((predicate, *arguments))
    return frozenset(atoms), tuple(normal)


def task_problem(objects: dict[str, str], initial: frozenset[Atom], goal: frozenset[Atom]) -> Problem:
    """Return the STRIPS problem of a scene."""
    return Problem("scene", objects, initial, goal)
