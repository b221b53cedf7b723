"""How deep the bodies of a scene lie in each other as it was written: every body where scene.json puts it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import LoadedBody, PhysicsWorld


@dataclass(frozen=True)
class Overlap:
    """Two links that share space, `depth` [m] deep; `first` and `second` are their bodies."""

    first: str
    second: str
    first_link: str
    second_link: str
    depth: float
    margin: float | None = None
    """How far `depth` is from the limit of the settle test (`settle_margins`); None: far."""


MESH_PADDING = 0.001
"""Bullet pads the convex hull of a mesh by this much [m] on all sides, boxes by nothing. It is not in the files."""


def resting_overlaps(world: PhysicsWorld, smallest: float = 0.0) -> list[Overlap]:
    """Return the pairs of bodies of a scene that lie more than `smallest` [m] in each other, deepest first.

    One entry a pair, with the links that are deepest. Bodies and joints are taken as they stand in the world. Pairs of
    floor, walls and ceiling are left out: their slabs overlap at the corners of the room by design. The moving parts of
    one body are compared too, unless a joint connects them.
    """
    vocabulary = load_vocabulary()
    bodies = list(world.bodies.values())
    layout = {body.name for body in bodies if vocabulary.by_name(body.record.class_name).is_layout}
    overlaps = []
    for first, second in combinations(bodies, 2):
        if (first.name in layout and second.name in layout) or not _bounds_meet(world, first.name, second.name):
            continue
        pairs = [(a, b) for a in sorted(first.links.values()) for b in sorted(second.links.values())]
        overlaps += _deepest(world, first, second, pairs, smallest)
    for body in bodies:
        links = sorted(body.links.values())
        joined = {
            (engine.getJointInfo(body.body_id, link, physicsClientId=world.client)[16], link) for link in links[1:]
        }
        overlaps += _deepest(
            world, body, body, [pair for pair in combinations(links, 2) if pair not in joined], smallest
        )
    return sorted(overlaps, key=lambda overlap: (-overlap.depth, overlap.first_link, overlap.second_link))


def pair_depth(world: PhysicsWorld, pair: Overlap) -> float:
    """Return how deep [m] the two links of a pair lie in each other as they stand now."""
    first, second = world.bodies[pair.first], world.bodies[pair.second]
    ends = (first.body_id, first.links[pair.first_link], second.body_id, second.links[pair.second_link])
    return link_depth(world, *ends)


def link_depth(world: PhysicsWorld, first: int, first_link: int, second: int, second_link: int) -> float:
    """Return how deep [m] a link of one body (engine's ids) lies in a link of another or the same; negative or 0 when
    it does not. What Bullet pads meshes with is taken off."""
    points = engine.getClosestPoints(first, second, 0.0, first_link, second_link, physicsClientId=world.client)
    if not points:
        return 0.0
    depth = max(-point[8] for point in points)
    return (
        float(depth) - link_padding(world.client, first, first_link) - link_padding(world.client, second, second_link)
    )


def link_padding(client: int, body: int, link: int) -> float:
    """Return what Bullet pads a link's shapes with [m]: 0 when any is no mesh, as contacts do not tell shapes apart."""
    shapes = engine.getCollisionShapeData(body, link, physicsClientId=client)
    return MESH_PADDING if shapes and all(shape[2] == engine.GEOM_MESH for shape in shapes) else 0.0


def _bounds_meet(world: PhysicsWorld, first: str, second: str) -> bool:
    (low, high), (other_low, other_high) = world.bounds(first), world.bounds(second)
    return bool((low <= other_high).all() and (other_low <= high).all())


def _deepest(
    world: PhysicsWorld, first: LoadedBody, second: LoadedBody, pairs: list[tuple[int, int]], smallest: float
) -> list[Overlap]:
    """Return the deepest of pairs of links as a list of one, or nothing when none is deeper than `smallest`."""
    depths = [link_depth(world, first.body_id, a, second.body_id, b) for a, b in pairs]
    if not depths or max(depths) <= smallest:
        return []
    deepest = depths.index(max(depths))
    names = (world.link_name(first.body_id, pairs[deepest][0]), world.link_name(second.body_id, pairs[deepest][1]))
    return [Overlap(first.name, second.name, *names, depths[deepest])]
