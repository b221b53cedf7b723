"""Named priors (`--assume in(bottle, fridge_2)`): things that closed furniture hides, believed until it is opened.

A believed thing has the usual size of its class and stands where its container takes it best. The robot plans with it;
when it has opened the container, a look gives pose and shape of what is really there, or that there is nothing.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_transform, as_vector
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.errors import UsageError
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.plan import BodyMatch
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.plan.regions import Region
from scenewright.stages.plan.world_model import WorldModel

USUAL: dict[str, tuple[float, float, float]] = {
    "bottle": (0.066, 0.22, 0.5),
    "can": (0.066, 0.12, 0.35),
    "cup": (0.075, 0.095, 0.2),
    "jug": (0.12, 0.22, 0.8),
    "bowl": (0.16, 0.065, 0.35),
    "box": (0.07, 0.17, 0.3),
}
"""Diameter [m], height [m] and mass [kg] of classes that may be assumed."""
COMFORT = 0.9
"""An assumed thing is put where the height of the surface is nearest to this [m]; by eye."""
_PRIOR = re.compile(r"^\s*(in|on)\s*\(\s*([a-z_]+)\s*,\s*(\w+)\s*\)\s*$")


@dataclass(frozen=True)
class Belief:
    """A thing that is assumed to be somewhere."""

    name: str
    class_name: str
    container: str
    words: str


def parse_priors(priors: tuple[str, ...], model: WorldModel) -> list[Belief]:
    """Return the beliefs of priors such as `in(bottle, fridge_2)`. Raises UsageError for what is none."""
    beliefs = []
    for number, prior in enumerate(priors, start=1):
        match = _PRIOR.match(prior)
        if match is None:
            raise UsageError(f"assumption {prior!r} is not a literal", hint="write it like in(bottle, fridge_2)")
        _, kind, container = match.groups()
        if kind not in USUAL:
            raise UsageError(f"assumption {prior!r}: no usual size of {kind!r}", hint=f"known: {', '.join(USUAL)}")
        if container not in model.records or model.records[container].carriable:
            raise UsageError(f"assumption {prior!r}: the scene has no furniture {container!r}", hint="see scene.json")
        width, height, _ = USUAL[kind]
        words = (
            f"assumed: {match[1]}({kind}_believed_{number}, {container}), {width:.3f} m wide and {height:.3f} m high: "
            "no camera saw it; where it stands and what it looks like is seen once a hand could get there"
        )
        beliefs.append(Belief(f"{kind}_believed_{number}", kind, container, words))
    return beliefs


def believe(model: WorldModel, graph: ContactGraphFile, beliefs: list[Belief]) -> ContactGraphFile:
    """Put believed things into the model and return the graph with them. Raises UsageError where there is no room."""
    nodes, links = list(graph.nodes), list(graph.links)
    for belief in beliefs:
        width, height, mass = USUAL[belief.class_name]
        region = _best_region(model, belief, width, height)
        middle = apply(model.world_from_region(region), np.array([*(region.low + region.high) / 2, region.level]))
        pose = transform_from_yaw(0.0, middle + [0.0, 0.0, 0.001])
        box = Box(center=as_vector(middle + [0.0, 0.0, height / 2]), size=(width, width, height))
        record = SceneBody(
            name=belief.name,
            class_name=belief.class_name,
            movable=True,
            parent=belief.container,
            relation="contains" if region.doors else "supports",
            world_from_body=as_transform(pose),
            world_from_reconstructed=None,
            box=box,
            mass=mass,
            grasp_width=width,
        )
        model.see(belief.name, record, _cylinder(belief.name, width / 2, height, mass), ())
        nodes.append(
            GraphNode(
                id=belief.name,
                instance=max(node.instance for node in nodes) + 1,
                class_name=belief.class_name,
                node_type="rigid",
                box=box,
                confidence=0.0,
            )
        )
        links.append(
            Relation(source=belief.container, target=belief.name, relation=record.relation, confidence=0.0)  # type: ignore[arg-type]
        )
    return graph.model_copy(update={"nodes": tuple(nodes), "links": tuple(links)})


def _best_region(model: WorldModel, belief: Belief, width: float, height: float) -> Region:
    fitting = [region for region in model.regions(belief.container) if region.takes(width / 2, height)]
    hidden = [region for region in fitting if region.doors] or fitting
    if not hidden:
        raise UsageError(f"nothing as large as a {belief.class_name} has room in {belief.container}")

    def discomfort(region: Region) -> float:
        middle = np.array([*(region.low + region.high) / 2, region.level])
        return abs(float(apply(model.world_from_region(region), middle)[2]) - COMFORT)

    return min(hidden, key=discomfort)


def _cylinder(name: str, radius: float, height: float, mass: float) -> str:
    """Return URDF text of an upright cylinder on the origin of its frame."""
    origin = f'<origin xyz="0 0 {height / 2}"/>'
    shape = f'<geometry><cylinder radius="{radius}" length="{height}"/></geometry>'
    across = mass * (3 * radius**2 + height**2) / 12
    inertia = (
        f'<inertia ixx="{across}" ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{mass * radius**2 / 2}"/>'
        f'<mass value="{mass}"/>'
    )
    return (
        f'<robot name="{name}"><link name="{name}"><inertial>{origin}{inertia}</inertial>'
        f"<visual>{origin}{shape}</visual><collision>{origin}{shape}</collision></link></robot>"
    )


def match_beliefs(
    beliefs: list[Belief], matches: dict[str, BodyMatch], room: dict[str, SceneBody]
) -> dict[str, BodyMatch]:
    """Return the matches with each believed thing taken for what the room really has there.

    That is a thing of its class, not taken for anything else, whose centre lies within the box of what its container
    was taken for; the one nearest to where it was believed. Without one it is nowhere.
    """
    with_beliefs = {name: match for name, match in matches.items() if name not in {belief.name for belief in beliefs}}
    for belief in beliefs:
        container = with_beliefs[belief.container].matched
        matched_names = {match.matched for match in with_beliefs.values()}
        best: tuple[float, str] | None = None
        for name, record in room.items():
            if (
                container is None
                or name in matched_names
                or record.class_name != belief.class_name
                or not record.carriable
            ):
                continue
            box = room[container].box
            away = np.linalg.norm(np.subtract(record.box.center, box.center))
            inside = record.parent == container or bool(away < 0.5 * np.linalg.norm(box.size))
            if inside and (best is None or away < best[0]):
                best = (float(away), name)
        with_beliefs[belief.name] = BodyMatch(body=belief.name, matched=None if best is None else best[1])
    return with_beliefs
