"""Geometry of picking and placing: grasps, places to put down, base poses, and the motions between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.stages.kit.acting.hand.attempts import first_motion
from scenewright.stages.kit.acting.hand.grip import PITCHES, Grasp, narrowest_width
from scenewright.stages.kit.acting.hand.rim_grasps import rim_grasps
from scenewright.stages.kit.acting.hand.sampled_grasps import sample_grasps
from scenewright.stages.kit.acting.query import carrying, touching
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.base_placement import free_bases, possible_bases
from scenewright.stages.kit.motion.cartesian import drawn_back, raised
from scenewright.stages.kit.motion.collision import RESTING_DEPTH
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Manipulation, Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration
from scenewright.stages.plan.level_carrying import LEVEL_PACE, RAISE, drawn_in, level_place
from scenewright.stages.plan.placements import PLACES, Placement, place_regions, sample_placements, untaken
from scenewright.stages.plan.tray_loading import GRAVITY, easiest_first, lifts_left, lifts_left_beside, load_moments
from scenewright.stages.plan.world_model import RobotState, WorldModel, as_held

APPROACH = 0.10
"""How far the tool comes along its axis, and over its place a thing arrives [m]; by eye."""
LIFT = 0.03
"""How far a thing is first lifted, and over its place under a cover a thing arrives [m]; by eye."""
DRAWER_LIFT = 0.2
"""How far over its place in a drawer a thing arrives [m]; by eye."""
SLOW = 0.35
"""Share of the arm's full speed beside things; by eye."""
FRICTION_USED = 0.3
"""Half of the friction **assumed** of rubber on household things: grasps that ask for no more are tried first, as what
is held is carried with starts and stops."""
LOW_LIFT, BACK_OUT = 0.012, (0.25, 0.15)
"""How far a thing is lifted where there is no room for more, and how far it then goes back out [m]; by eye. Under a
cover that is nearer still it slides out."""
STEEP = 1.2
"""A hand that came so steeply goes back up, not out [rad]."""
PALM_BEHIND, HAND_END = 0.04, 0.11
"""How far behind the tool point the palm begins and the hand ends [m]."""
PALM_ROOM = 0.006
"""Wanted between the palm and what is held [m]."""
GraspStyle = Literal["any", "rather_level", "level", "steep"]
"""How the hand may come: `level` from the side (for what is put under a cover), `steep` from above (into a drawer);
`rather_level` tries the ways from the side first."""
STYLES: dict[GraspStyle, tuple[float, ...]] = {
    "any": PITCHES,
    "rather_level": PITCHES,
    "level": PITCHES[:3],
    "steep": PITCHES[3:],
}
"""How far the hand is tilted out of the level [rad], by how it may come."""


@dataclass(frozen=True)
class Budgets:
    """How much a query may try; counts, never seconds."""

    bases: int
    """Base poses drawn; a quarter as many free ones are used."""
    pairs: int
    """Pairs of base pose and tool pose given to inverse kinematics."""
    path_samples: int
    paths: int
    """Joint-space path searches per query."""
    size_uncertainty: float = 0.0
    """How much thinner than believed items may be [m]; 0 for what was looked at from near by."""


def _pairs(bases: np.ndarray, others: int, random: np.random.Generator, most: int) -> list[tuple[int, int]]:
    """Return at most `most` (base, other) index pairs in random order, each once."""
    order = random.permutation(len(bases) * others)[:most]
    return [(int(index) // others, int(index) % others) for index in order]


def palm_bottom(world_from_tool: np.ndarray, palm: tuple[float, float]) -> float:
    """Return the lowest height [m] of the palm and the hand behind it at a tool pose (4, 4), its length and breadth
    given [m]."""
    corners = [
        [x * palm[1] / 2, y * palm[0] / 2, -z] for x in (-1, 1) for y in (-1, 1) for z in (PALM_BEHIND, HAND_END)
    ]
    return float(apply(world_from_tool, np.array(corners))[:, 2].min())


def _two_finger_grasps(
    model: WorldModel, item: str, widest: float, style: GraspStyle, random: np.random.Generator
) -> tuple[list[Grasp], list[Grasp]]:
    """Return the grasps of a thing that fingers open to `widest` [m] can take, in two halves: first those that ask for
    little friction and keep it off the palm."""
    points, normals = model.surface(item)

    def sampled(friction: float) -> list[Grasp]:
        return sample_grasps(
            points, normals, model.pose(item), opening=widest, random=random, pitches=STYLES[style], friction=friction
        )

    firm, loose = sampled(FRICTION_USED), sampled(np.inf)
    preferred = _palm_free(points, firm, model.description.palm) or _palm_free(points, loose, model.description.palm)
    preferred_ids = {id(grasp) for grasp in preferred}
    return preferred, [grasp for grasp in (*firm, *loose) if id(grasp) not in preferred_ids]


def _palm_free(points: np.ndarray, grasps: list[Grasp], palm: tuple[float, float]) -> list[Grasp]:
    """Return the grasps in which a thing, points (N, 3) of it in its own frame, keeps `PALM_ROOM` from a palm of a
    length and breadth [m]: what the palm presses on is pushed over when the fingers let go."""
    half = np.array([palm[1], palm[0]]) / 2

    def free(grasp: Grasp) -> bool:
        points_in_hand = apply(inverse(grasp.body_from_tool), points)
        behind = (points_in_hand[:, 2] < PALM_ROOM - PALM_BEHIND) & (points_in_hand[:, 2] > -HAND_END)
        return not bool(np.any(behind & np.all(np.abs(points_in_hand[:, :2]) < half, axis=1)))

    return [grasp for grasp in grasps if free(grasp)]


def _bearable_grasps(model: WorldModel, item: str, grasps: list[Grasp]) -> list[Grasp]:
    """Return the grasps in which the fingers bear the moment of a carrier and its load. Raises MotionFailed `no_grasp`
    when it turns in all of them."""
    if not grasps:
        return []
    world_from_item = model.pose(item)
    moments = load_moments(model, item, np.array([world_from_item @ grasp.body_from_tool for grasp in grasps]))
    most = model.description.holding_moment
    if moments.min() > most:
        raise MotionFailed(
            "no_grasp",
            f"{item} and what stands on it turn in the fingers with {moments.min():.2f} N m at least, they bear {most}",
            (item,),
            {"moment": float(moments.min()), "holding_moment": most},
        )
    return [grasp for grasp, moment in zip(grasps, moments, strict=True) if moment <= most]


def _shifted_pose(pose: np.ndarray, shift: np.ndarray) -> np.ndarray:
    moved = pose.copy()
    moved[:3, 3] += shift
    return moved


def _bases_around(
    model: WorldModel,
    state: RobotState,
    target: np.ndarray,
    budgets: Budgets,
    random: np.random.Generator,
    tally: Tally,
    fixed: np.ndarray | None,
) -> np.ndarray:
    if fixed is not None:
        return fixed[None]
    bases = possible_bases(model.description, state.base, target, model.room, budgets.bases, random)
    checker = model.checker.under(as_held(model, state))
    return free_bases(bases, state.arm, checker, tally.blockers, budgets.bases // 4)


def plan_pick(
    model: WorldModel,
    state: RobotState,
    item: str,
    source: str,
    budgets: Budgets,
    random: np.random.Generator,
    preferred: tuple[np.ndarray, np.ndarray] | None = None,
    style: GraspStyle = "any",
    base: np.ndarray | None = None,
) -> Manipulation:
    """Return the motion that takes `item` off (or out of) `source`, base pose included.

    `preferred` (base (3,), body_from_tool (4, 4)) is tried first. `style` is what the place where it goes next asks
    for; `base` (3,): from there or not at all. Raises MotionFailed: `no_grasp` when the item is too wide for the
    gripper, otherwise what ended most attempts.
    """
    world_from_item = model.pose(item)
    points = model.points(item)
    # Fingers may touch the item, so that its believed shape, a little too wide, does not stop them.
    widest = model.description.opening + budgets.size_uncertainty
    # what is laden is held straight from above: the load stays level while the arm moves
    grasps = (
        _bearable_grasps(model, item, rim_grasps(points, world_from_item, random, uncertainty=budgets.size_uncertainty))
        if model.laden(item)
        else []
    )
    others: list[Grasp] = []
    if not grasps:
        grasps, others = _two_finger_grasps(model, item, widest, style, random)
    if not grasps and not others:
        grasps = rim_grasps(points, world_from_item, random, uncertainty=budgets.size_uncertainty)
    if not grasps and not others:
        width = narrowest_width(apply(world_from_item, points))
        raise MotionFailed(
            "no_grasp",
            f"{item} is {width:.3f} m wide at its narrowest, the gripper opens {model.description.opening:.3f} m"
            + (f" (taken to be up to {budgets.size_uncertainty:.3f} m thinner)" if budgets.size_uncertainty else ""),
            (item,),
            {"width": width, "opening": model.description.opening, "size_uncertainty": budgets.size_uncertainty},
        )
    tally = Tally()
    arm_planner = ArmPlanner(model, random, budgets.path_samples)
    bases = _bases_around(model, state, world_from_item[:3, 3], budgets, random, tally, base)
    queue = [
        (bases[i], some[j]) for some in (grasps, others) for i, j in _pairs(bases, len(some), random, budgets.pairs)
    ]
    if model.laden(item):
        poses = np.array([world_from_item @ grasp.body_from_tool for _, grasp in queue])
        queue = [queue[index] for index in easiest_first(model, item, poses)]
    lowest = float(apply(world_from_item, points)[:, 2].min())
    over = {
        id(grasp): palm_bottom(world_from_item @ grasp.body_from_tool, model.description.palm) > lowest
        for grasp in (*grasps, *others)
    }
    sideways = style == "rather_level"
    twist = {} if model.laden(item) else {id(grasp): _twist(model, item, grasp) for grasp in (*grasps, *others)}
    # A hand that reaches below the item's foot, over an edge, cannot put it down but over an edge; what turns it in the
    # fingers most is tried last.
    queue.sort(
        key=lambda entry: (
            not over[id(entry[1])],
            sideways and entry[1].pitch > max(STYLES["level"]),
            twist.get(id(entry[1]), 0.0),
        )
    )
    if preferred is not None:
        queue.insert(0, (preferred[0], Grasp(preferred[1], 0.0, 0.0)))
    attempts = (_try_pick(model, state, item, source, at, grasp, arm_planner, tally) for at, grasp in queue)
    motion = first_motion(attempts, budgets.paths)
    if motion is not None:
        return motion
    tally.raise_for(f"pick({item}, {source})", (item, source))


def _twist(model: WorldModel, item: str, grasp: Grasp) -> float:
    """Return the most that a thing's weight turns it about the line between the fingers, in tenths [N m]: pads resist
    that by friction alone, however the hand is turned on its way."""
    tool_from_middle = inverse(model.pose(item) @ grasp.body_from_tool) @ model.world.center_of_mass(item)
    lever = float(np.hypot(tool_from_middle[0, 3], tool_from_middle[2, 3]))
    return round(GRAVITY * model.records[item].mass * lever, 1)


def _try_pick(
    model: WorldModel,
    state: RobotState,
    item: str,
    source: str,
    base: np.ndarray,
    grasp: Grasp,
    arm_planner: ArmPlanner,
    tally: Tally,
) -> Manipulation | MotionFailed | None:
    """Return the motion, None when a cheap test fails, or the failure of a path search (they are counted)."""
    world_from_item = model.pose(item)
    world_from_tool = world_from_item @ grasp.body_from_tool
    opening = model.description.opening
    model.robot.set(_opened_configuration(state, opening))
    at_item = arm_planner.under(touching(model.links(item)))
    approach = at_item.straight(base, world_from_tool, drawn_back(world_from_tool, APPROACH), tally)
    if approach is None:
        return None
    approach, arm = approach[::-1], approach[0]
    # With the item in hand: up a little, then back out the way the hand came, or further up.
    tool_from_item = inverse(world_from_tool) @ world_from_item
    # What overlaps the item where it is believed to be is an error of belief: it may overlap as much on the way out.
    within = {link: depth + 0.003 for link, depth in model.checker.overlaps(item).items()}
    allowed_depths = {link: RESTING_DEPTH for link in (*model.links(source), *_supports(model, item))}
    allowed_depths = {link: max(within.get(link, 0.0), depth) for link, depth in allowed_depths.items()} | {
        link: depth for link, depth in within.items() if link not in allowed_depths
    }
    laden = model.laden(item)
    off, out, in_hand = (
        arm_planner.under(carrying(item, tool_from_item, model.links(item), depths))
        for depths in (allowed_depths, within, {})
    )
    lifts = (RAISE,) if laden else _lifts(model, item, source)
    lifted = _lifted(model, base, arm, world_from_tool, lifts, grasp.pitch > STEEP, off, out, tally)
    if lifted is None:
        return None
    if not laden and not in_hand.free(base, lifted[-1], tally):
        return None  # slid out, it stands on its support still
    folded = lifted[-1] if laden else in_hand.folded(base, lifted[-1], tally)
    if folded is None:
        return None
    try:
        home = lifted[-1:] if laden else in_hand.path(base, lifted[-1], folded)
    except MotionFailed as failed:
        tally.failed(failed)
        return failed
    model.robot.set(_opened_configuration(state, opening))
    try:
        reach = arm_planner.path(base, state.arm, approach[0])
    except MotionFailed as failed:
        tally.failed(failed)
        return failed
    return Manipulation(
        base,
        (
            Segment(whole_body(base, reach), opening),
            Segment(whole_body(base, approach), opening, SLOW, "grasp", item, firm=laden),
            Segment(whole_body(base, lifted), 0.0, LEVEL_PACE if laden else SLOW, "", item),
            Segment(whole_body(base, home), 0.0, 0.6, "", item),
        ),
        tool_from_item=tool_from_item,
        body_from_tool=grasp.body_from_tool,
    )


def _lifted(
    model: WorldModel,
    base: np.ndarray,
    arm: np.ndarray,
    world_from_tool: np.ndarray,
    lifts: tuple[float, ...],
    steep: bool,
    off: ArmPlanner,
    out: ArmPlanner,
    tally: Tally,
) -> np.ndarray | None:
    """Return arm values (K, J) by the first of the `lifts` [m] that serves up `off` what a thing in the hand stands on,
    and `out` the way the hand came, or further up where it came `steep`; a laden one is drawn in level. None where
    nothing is free."""
    item = out.checker.query.carried
    laden = item is not None and model.laden(item)
    for lift in lifts:
        goal = raised(world_from_tool, lift)
        up = off.line(base, arm, goal, tally)
        if up is None:
            continue
        if laden:
            return np.concatenate([up, drawn_in(model, out, base, up[-1], tally)[1:]])
        for distance in BACK_OUT:
            flat = goal[:3, 2] * np.array([1, 1, 0])
            shift = np.array([0, 0, distance]) if steep else -flat / max(np.linalg.norm(flat), 1e-6) * distance
            back = out.line(base, up[-1], _shifted_pose(goal, shift), tally)
            if back is not None:
                return np.concatenate([up, back[1:]])
    return None


def _lifts(model: WorldModel, item: str, source: str) -> tuple[float, ...]:
    """Return how far a thing may be lifted off what it stands on [m], the farthest first. A cover may be part of the
    link on which it stands, which it touches anyway: how near that is, is asked of the region."""
    region = model.region_under(item, source) if source in model.records else None
    room = np.inf
    if region is not None and region.covered:
        points = apply(inverse(model.world_from_region(region)) @ model.pose(item), model.points(item))
        low, high = points.min(axis=0), points.max(axis=0)
        radius = float((high - low)[:2].max()) / 2
        room = region.free_height((low + high)[:2] / 2, radius) - (high[2] - low[2]) - model.checker.clearance
    return (*(lift for lift in (LIFT, LOW_LIFT) if lift < room), 0.0)


def _opened_configuration(state: RobotState, opening: float) -> Configuration:
    return Configuration(state.base, state.arm, opening)


def _supports(model: WorldModel, item: str) -> tuple[str, ...]:
    """Return the links of what the item's record says it stands on."""
    parent = model.records[item].parent
    return model.links(parent) if parent in model.records else ()


def plan_place(
    model: WorldModel,
    state: RobotState,
    item: str,
    target: str,
    door: str | None,
    budgets: Budgets,
    random: np.random.Generator,
    preferred: tuple[np.ndarray, np.ndarray] | None = None,
    base: np.ndarray | None = None,
    further: tuple[str, ...] = (),
) -> Manipulation:
    """Return the motion that puts the held `item` down on `target`, or in it behind `door`, base pose included.

    `preferred` (base (3,), world_from_item (4, 4)) is tried first, or last where it keeps a tray from being lifted;
    `base` (3,): from there or not at all; `further`: what is put there later. Raises MotionFailed: `no_placement` when
    no free place there carries the item's footprint, otherwise what ended most attempts.
    """
    assert state.tool_from_item is not None
    on_tray = model.records[target].carriable
    drawn = sample_placements(model, item, target, door, random, 4 * PLACES if on_tray else PLACES)
    places = untaken(model, item, target, drawn) or drawn  # what takes them up is told by the attempts
    if not places and preferred is None:
        regions = place_regions(model, item, target, door)
        raise MotionFailed(
            "no_placement",
            f"{target} has no free place that carries {item} ({len(regions)} places would be large enough)",
            (item, target),
            {"places": len(regions)},
        )
    serves = True
    if on_tray and places:
        places, serves = _liftable_places(model, item, target, door, budgets, random, places, preferred, further)
    tally = Tally()
    arm_planner = ArmPlanner(model, random, budgets.path_samples)
    queue: list[tuple[np.ndarray, Placement]] = []
    wish = [] if preferred is None else [(preferred[0], Placement(preferred[1], *_cover(places, preferred[1])))]
    model.robot.set(_opened_configuration(state, model.description.opening))
    checker = model.checker.under(carrying(item, state.tool_from_item, model.links(item)))
    for placement in places[: max(4, budgets.bases // 6)]:
        goal = placement.world_from_item[:3, 3]
        if base is None:
            bases = possible_bases(model.description, state.base, goal, model.room, budgets.bases // 8, random)
            bases = free_bases(bases, state.arm, checker, tally.blockers, 4)
        else:
            bases = base[None]
        queue += [(at, placement) for at in bases]
    queue = wish + queue[: budgets.pairs] if serves else queue[: budgets.pairs] + wish
    attempts = (_try_place(model, state, item, target, at, placement, arm_planner, tally) for at, placement in queue)
    motion = first_motion(attempts, budgets.paths)
    if motion is not None:
        return motion
    tally.raise_for(f"place({item}, {target})", (item, target))


def _liftable_places(
    model: WorldModel,
    item: str,
    tray: str,
    door: str | None,
    budgets: Budgets,
    random: np.random.Generator,
    places: list[Placement],
    preferred: tuple[np.ndarray, np.ndarray] | None,
    further: tuple[str, ...],
) -> tuple[list[Placement], bool]:
    """Return the places on a tray by which it can still be lifted, those that leave room for what is put there later
    first, and whether the preferred one (see `plan_place`) does what the best of them do: it was chosen on a tray that
    was believed to be another."""
    wish = [] if preferred is None else [preferred[1]]
    poses = np.array([*(placement.world_from_item for placement in places), *wish])
    lifts_now = lifts_left(model, tray, item, poses, budgets.size_uncertainty)
    later = lifts_now
    if further and lifts_now.any():
        spots = sample_placements(model, further[0], tray, door, random)
        beside = np.array([spot.world_from_item for spot in spots]).reshape(-1, 4, 4)
        later = lifts_left_beside(model, tray, item, poses, further[0], beside, budgets.size_uncertainty)
    order = sorted(
        range(len(places)),
        key=lambda index: (not later[index], not places[index].roomy, -later[index], -lifts_now[index]),
    )
    serves = all(counts[-1] or not counts.any() for counts in (lifts_now, later))
    return [places[index] for index in order if lifts_now[index] or not lifts_now.any()], serves


def _cover(places: list[Placement], world_from_item: np.ndarray) -> tuple[bool, bool]:
    """Return (covered, in_drawer) of a pose: as of the sampled place nearest to it; in the open when there is none."""
    if not places:
        return False, False
    nearest = min(places, key=lambda place: float(np.linalg.norm((place.world_from_item - world_from_item)[:3, 3])))
    return nearest.covered, nearest.in_drawer


def _try_place(
    model: WorldModel,
    state: RobotState,
    item: str,
    target: str,
    base: np.ndarray,
    placement: Placement,
    arm_planner: ArmPlanner,
    tally: Tally,
) -> Manipulation | MotionFailed | None:
    assert state.tool_from_item is not None
    if model.laden(item):
        rest_on = {link: RESTING_DEPTH for link in model.links(target)}
        return level_place(model, state, item, base, placement, rest_on, arm_planner, tally)
    item_from_tool = inverse(state.tool_from_item)
    model.robot.set(_opened_configuration(state, model.description.opening))
    item_pose = placement.world_from_item
    # a foot that is let down on a tray's rim tips over
    depth = 0.0 if model.records[target].carriable else RESTING_DEPTH
    links, depths = model.links(item), dict.fromkeys(model.links(target), depth)
    onto = arm_planner.under(carrying(item, state.tool_from_item, links, depths))
    in_hand = arm_planner.under(carrying(item, state.tool_from_item, links))
    # The yaw in which the hand points away from the base is the one an arm likes; the sampled yaw varies it.
    outward = np.arctan2(*(item_pose[:2, 3] - base[:2])[::-1])
    upright_from_item = model.standing(item)
    hand = (upright_from_item @ item_from_tool)[:3, 2]
    steep = abs(hand[2]) > 0.95
    for wish in (0.0, 0.6, -0.6):
        yaw = float(np.arctan2(item_pose[1, 0], item_pose[0, 0])) if steep else outward - np.arctan2(hand[1], hand[0])
        upright = transform_from_yaw(yaw + wish, item_pose[:3, 3]) @ upright_from_item
        world_from_tool = upright @ item_from_tool
        height = LIFT if placement.covered else DRAWER_LIFT if placement.in_drawer else APPROACH
        above = raised(world_from_tool, height)
        down = onto.straight(base, world_from_tool, above, tally)
        if down is None:
            continue
        arm = down[0]
        if placement.covered:
            flat = above[:3, 2] * np.array([1, 1, 0])
            out = in_hand.line(base, down[-1], _shifted_pose(above, -BACK_OUT[0] * flat), tally)
            if out is None:
                continue
            down = np.concatenate([down, out[1:]])
        break
    else:
        return None
    try:
        reach = in_hand.path(base, state.arm, down[-1])
    except MotionFailed as failed:
        tally.failed(failed)
        return failed
    opening = model.description.opening
    with model.world.posed(item, upright):
        model.robot.set(_opened_configuration(state, opening))
        away = arm_planner.under(touching(links)).line(base, arm, drawn_back(world_from_tool, APPROACH + 0.02), tally)
        if away is None:
            return None
        try:
            home = arm_planner.path(base, away[-1], model.description.carry)
        except MotionFailed as failed:
            tally.failed(failed)
            return failed
    return Manipulation(
        base,
        (
            Segment(whole_body(base, reach), 0.0, 0.6, "", item),
            Segment(whole_body(base, down[::-1]), 0.0, SLOW, "release", item),
            Segment(whole_body(base, away), opening, SLOW),
            Segment(whole_body(base, home), opening),
        ),
        item_pose=upright,
    )
