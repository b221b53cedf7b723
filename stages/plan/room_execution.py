"""Carry a plan out in the physics of a room, and tell what came of it: checks, graphs, pictures, the log."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene, SceneBody
from scenewright.schemas.plan import BodyMatch, Check, Failure, TreeDifference, TriedPlan
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.acting.errors import Luck, SegmenterErrors, segmenter_rates
from scenewright.stages.kit.acting.eyes.masks import Segmenter
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.simulation.robot import Configuration
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene, read_scene_bodies
from scenewright.stages.kit.stage import Context
from scenewright.stages.plan.assumptions import Belief, match_beliefs
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.camera_eyes import CameraEyes
from scenewright.stages.plan.check_margins import with_margins
from scenewright.stages.plan.conduct import Conduct, joint_pairs
from scenewright.stages.plan.correspondence import match_bodies
from scenewright.stages.plan.execution_log import write_execution
from scenewright.stages.plan.eyes import Eyes, Room, TrueEyes
from scenewright.stages.plan.goal_checks import check_goal
from scenewright.stages.plan.parameters import PlanParameters
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.pictures import RoomPictures, picture_camera
from scenewright.stages.plan.reading import Reading
from scenewright.stages.plan.refinement import Step
from scenewright.stages.plan.replanning import Replanning, Search
from scenewright.stages.plan.room_segmenter import room_segmenter
from scenewright.stages.plan.trajectories import executed_rows
from scenewright.stages.plan.tree_state import after_step, graph_of_state, observed_state, start_state, tree_differences
from scenewright.stages.plan.world_model import RobotState, WorldModel, body_planes

RECORD_RATE = 10.0
"""Snapshots of the simulation that are kept [1/s]."""
SETTLE_SECONDS = 1.0
"""How long the room is left alone before it is looked at [s]; by eye."""
ROBOT_ERRORS, CAMERA_NOISE = 5, 6
"""Streams of the seed."""
START = -1
"""Index of what is observed before the first action."""
LOOK = (
    "before each action the robot saw pose, joint values and shape of the bodies that the action names, as they are in "
    "the room (stands for a wrist camera's look); everything else it knew from the planned scene"
)
LOOK_AROUND = (
    "before planning anew it saw all bodies of the planned scene that can move, as they are in the room, and what they "
    "stand on"
)
NOISY = (
    "localisation is off at every stop and joints stand beside their encoders; a look is from where the robot believes "
    "to stand, and shows nothing where the segmentation misses a body or takes it for something else; picking and "
    "placing are planned anew from where the robot stands then"
)
CAMERAS = (
    "before each action the planned shapes of what it names were fitted to rendered depth images: how what can be "
    "carried lies and, from near by, how large it is, where furniture stands and how far it is open; of a tray from "
    "near by the shape was seen; from over things where the hand was free; all else it knew from the planned scene. "
    "Whether an action had its effect is told by the room"
)
PROPRIOCEPTION = "the pose of a held item in the hand was read from the simulation"
GRIP = "items are held by friction of the two fingers alone; no constraint is added"


@dataclass(frozen=True)
class Order:
    """What is to be carried out, and what is known of it."""

    scene: InteractiveScene
    ground_truth: GroundTruth | None
    graph: ContactGraphFile
    beliefs: list[Belief]
    literals: tuple[str, ...]
    reading: Reading
    state: RobotState
    steps: list[Step]


@dataclass(frozen=True)
class Outcome:
    """What came of a plan."""

    steps: list[Step] | None
    """As carried out: what was planned anew on the way stands in the place of what failed."""
    executed_in: str | None = None
    checks: tuple[Check, ...] = ()
    matches: tuple[BodyMatch, ...] = ()
    assumptions: tuple[str, ...] = ()
    failures: tuple[Failure, ...] = ()
    tried: tuple[TriedPlan, ...] = ()
    learned: tuple[str, ...] = ()
    replanned: tuple[int, ...] = ()
    bumps: dict[str, float] = field(default_factory=dict)
    graphs: dict[int, ContactGraphFile] = field(default_factory=dict)
    """Index of an action -> the graph after it."""
    graph: ContactGraphFile | None = None
    """The graph in the end; None: as it was."""
    differences: tuple[TreeDifference, ...] = ()
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


def only_planned(model: WorldModel, graph: ContactGraphFile, steps: list[Step] | None) -> Outcome:
    """Return what a plan leaves that is not executed (or, `steps` None, not found): the graphs as planned."""
    believed = start_state(model)
    graphs, state = {}, believed
    for number, step in enumerate(steps or []):
        state = after_step(state, step)
        if step.manipulation is not None:
            graphs[number] = graph_of_state(graph, believed, state, believed, model)
    return Outcome(steps, graphs=graphs, graph=graphs[max(graphs)] if graphs else None)


def execute(
    model: WorldModel,
    order: Order,
    budgets: Budgets,
    search: Search,
    parameters: PlanParameters,
    context: Context,
    random: np.random.Generator,
) -> Outcome:
    """Carry out the steps in the room, write pictures and log, and return what came of it.

    The room is that of the ground truth, else the planned scene itself. `search` plans anew when that is needed.
    """
    root = order.scene.root if order.ground_truth is None else order.ground_truth.path("room")
    room = _read_room(root, order)
    planned = dict(model.records)
    matches = match_beliefs(order.beliefs, match_bodies(planned, room.records, parameters.match_radius), room.records)
    joint_names = joint_pairs(planned, room.records, matches)
    believed = start_state(model)
    replanning = Replanning(model, order.graph, believed, order.literals, order.reading, search)
    observed: dict[int, TreeState] = {}
    anew: dict[int, TreeState] = {}
    with load_scene(root) as world, ExitStack() as stack:
        world.anchor_friction()
        start = Configuration(order.state.base, order.state.arm, model.description.opening)
        physical = _robot(world, model, start, parameters, context)
        failures = _start_failures(physical)
        physical.wait(SETTLE_SECONDS)

        def observe(number: int) -> TreeState:
            observed[number] = observed_state(world, matches, joint_names, physical.held)
            return observed[number]

        def checks_now() -> tuple[Check, ...]:
            now = observed_state(world, matches, joint_names, physical.held)
            graph = graph_of_state(order.graph, observed[START], now, believed, model)
            learned = partial(order.reading.check, model, graph)
            return check_goal(world, order.literals, matches, joint_names, physical.held, learned)

        def settled_checks() -> tuple[Check, ...]:
            world.wake()
            physical.wait(SETTLE_SECONDS)
            return checks_now()

        def replan(state: RobotState, number: int) -> list[Step] | None:
            anew[number] = observed_state(world, matches, joint_names, physical.held)
            return replanning.plan(state, observed[START], anew[number], number)

        pictures = RoomPictures(world, room.records, room.texts, model.description)
        observe(START)
        physical.recording.keyframe(START, "start")
        conduct = Conduct(
            model,
            room,
            physical,
            matches,
            joint_names,
            replace(budgets, size_uncertainty=budgets.size_uncertainty if parameters.eyes == "camera" else 0.0),
            random,
            parameters.relocalize,
            parameters.execution_attempts,
            observe=observe,
            eyes=_eyes(Sight(model, room, physical, joint_names, pictures), parameters, context, stack),
        )
        if failures:
            conduct.steps = order.steps
        else:
            conduct.run(
                order.state,
                order.steps,
                parameters.replans,
                replan,
                reached=lambda: all(check.holds for check in settled_checks()),
            )
        checks = settled_checks()
        physical.recording.keyframe(len(conduct.steps) - 1, "end")
        final = observed_state(world, matches, joint_names, physical.held)
        with context.progress.step("pictures"):
            draw(pictures, physical, parameters, context)
        checks = with_margins(checks, world, physical.held, checks_now)
    graphs = {
        number: graph_of_state(order.graph, observed[START], state, believed, model)
        for number, state in observed.items()
        if number >= 0
    }
    used: tuple[str, ...] = ("the planned motion was replayed", GRIP)
    if parameters.relocalize:
        used = (CAMERAS if parameters.eyes == "camera" else LOOK, PROPRIOCEPTION, GRIP)
    if parameters.eyes != "true":
        used += (NOISY,)
    return Outcome(
        conduct.steps,
        executed_in="reconstructed" if order.ground_truth is None else "ground_truth",
        checks=checks,
        matches=tuple(match for name, match in matches.items() if name in _names_in_steps(conduct.steps, planned)),
        assumptions=(*used, LOOK_AROUND) if replanning.places else used,
        failures=(*failures, *conduct.failures, *replanning.failures),
        tried=tuple(replanning.tried),
        learned=tuple(replanning.learned),
        replanned=tuple(replanning.places),
        bumps={name: round(force, 3) for name, force in sorted(physical.bumps.items())},
        graphs=graphs,
        graph=graph_of_state(order.graph, observed[START], final, believed, model),
        differences=_differences(model, believed, conduct.steps, observed, anew),
        arrays=executed_rows(physical.recording.snapshots),
    )


def _robot(
    world: PhysicsWorld, model: WorldModel, start: Configuration, parameters: PlanParameters, context: Context
) -> PhysicalRobot:
    if parameters.eyes == "true":
        return PhysicalRobot(world, model.description, start, RECORD_RATE)
    return ErringRobot(world, model.description, start, RECORD_RATE, context.random(ROBOT_ERRORS))


@dataclass(frozen=True)
class Sight:
    """What eyes are made of."""

    model: WorldModel
    room: Room
    physical: PhysicalRobot
    joint_names: dict[str, str]
    pictures: RoomPictures


def _eyes(sight: Sight, parameters: PlanParameters, context: Context, stack: ExitStack) -> Eyes:
    model, physical = sight.model, sight.physical
    true = TrueEyes(model, sight.room, physical, sight.joint_names)
    if not isinstance(physical, ErringRobot):
        return true
    noise = context.random(CAMERA_NOISE)
    segmenter = _segmenter(sight, parameters, context, stack)
    return CameraEyes(model, sight.pictures, physical, segmenter, noise, parameters.match_radius)


def _segmenter(sight: Sight, parameters: PlanParameters, context: Context, stack: ExitStack) -> Segmenter:
    if parameters.segmenter:
        from scenewright.stages.kit.acting.eyes.asked import AskedSegmenter

        known = [entry.name for entry in load_vocabulary().classes]
        asked = AskedSegmenter(parameters.segmenter, context.seed, known)
        stack.callback(asked.close)
        return asked
    sought = sorted({record.class_name for record in sight.model.records.values() if record.carriable})
    errors = SegmenterErrors(segmenter_rates(parameters.segmenter_errors), Luck(context.seed), sought)
    return room_segmenter(sight.room, sight.physical.world, errors)


def _read_room(root: Path, order: Order) -> Room:
    nodes = {node.id: node for node in (order.graph if order.ground_truth is None else order.ground_truth.graph).nodes}
    bodies = read_scene_bodies(root)
    records = {name: record for name, (record, _) in bodies.items()}
    texts = {name: text for name, (_, text) in bodies.items()}
    planes = {}
    for name, record in records.items():
        seen_planes = nodes[name].planes if name in nodes else ()
        flat = any(plane.horizontal and len(plane.corners) == 4 for plane in seen_planes)
        planes[name] = seen_planes if flat else seen_planes + body_planes(record, texts[name])
    return Room(records, texts, planes)


def _start_failures(physical: PhysicalRobot) -> list[Failure]:
    """Return why the robot cannot begin where it stands: nothing, or that it stands in something."""
    try:
        physical.check_start()
    except MotionFailed as failed:
        return [failed.failure]
    return []


def _names_in_steps(steps: list[Step], planned: dict[str, SceneBody]) -> set[str]:
    """Return the names in the steps' arguments, and the owners of joints among them."""
    arguments = {argument for step in steps for argument in step.arguments}
    return arguments | {name for name in planned for argument in arguments if argument.startswith(f"{name}__")}


def _differences(
    model: WorldModel,
    believed: TreeState,
    steps: list[Step],
    observed: dict[int, TreeState],
    anew: dict[int, TreeState],
) -> tuple[TreeDifference, ...]:
    """Return where the tree was not as the steps say; what was planned anew began with the tree as it was then."""
    differences: list[TreeDifference] = []
    expected = replace(believed, parents={**believed.parents, **observed[START].parents})
    for number, step in enumerate(steps):
        if number in anew:
            tree_then = anew[number]
            expected = replace(
                expected,
                parents={**expected.parents, **tree_then.parents},
                poses={**expected.poses, **tree_then.poses},
                joints={**expected.joints, **tree_then.joints},
                held=tree_then.held,
            )
        expected = after_step(expected, step)
        if number in observed:
            differences += tree_differences(number, expected, observed[number], model)
    return tuple(differences)


def draw(pictures: RoomPictures, physical: PhysicalRobot, parameters: PlanParameters, context: Context) -> None:
    """Write the key frames as PNG files, and the log with its video, into the artifact's folder."""
    import cv2

    recording = physical.recording
    folder = context.output / "keyframes"
    folder.mkdir()
    camera = picture_camera(parameters.image_width)
    for number, (index, label) in enumerate(context.progress.track(recording.keyframes, description="key frames")):
        image = pictures.near(recording.snapshots[index], camera)
        cv2.imwrite(str(folder / f"{number:02d}_{label}.png"), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    small = picture_camera(min(400, parameters.image_width), 0.8)
    images: dict[int, np.ndarray] = {}
    if parameters.video_rate > 0:
        every = max(1, round(RECORD_RATE / parameters.video_rate))
        snapshot_indices = list(range(0, len(recording.snapshots), every))
        for index in context.progress.track(snapshot_indices, description="video"):
            images[index] = pictures.overview(recording.snapshots[index], small)
    write_execution(
        context.output / "execution.mcap", recording.snapshots, images, small, pictures.overview_pose(small)
    )
