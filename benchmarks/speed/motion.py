"""Speed of motion planning beside named peers: a Panda among seven boxes, medians over random queries in one run.

    python -m benchmarks.speed.motion --out FOLDER [--quick]

Peers: pybullet's own inverse kinematics (with the same restarts and the same check of its answer) and OMPL's
RRT-Connect with our collision checker. OMPL's paths are neither smoothed nor looked at more closely; ours always are
checked again at a third of the resolution, and are timed without and with smoothing.
Both ask the meshes alone here; what the compiled check gains is measured by `make bench-planning`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from scenewright.schemas.base import as_transform
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.geometry.transforms import quaternion_of
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import arm_chain, forward, inverse_kinematics, random_starts
from scenewright.stages.kit.motion.rrt_connect import SearchSpace, densify, first_collision, rrt_connect
from scenewright.stages.kit.simulation.engine import engine, native_output_to_stderr
from scenewright.stages.kit.simulation.robot import Robot
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.world import PhysicsWorld

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured

BASE = np.zeros(3)
RESOLUTION = np.full(7, 0.05)
RESTARTS = 12


def boxes_world() -> PhysicsWorld:
    """Return a world with seven boxes around the robot."""
    world = PhysicsWorld()
    random = np.random.default_rng(4)
    for number in range(7):
        angle = 2 * np.pi * number / 7
        size = random.uniform(0.1, 0.3, 3)
        pose = np.eye(4)
        pose[:3, 3] = [0.65 * np.cos(angle), 0.65 * np.sin(angle), random.uniform(0.4, 1.2)]
        record = SceneBody(
            name=f"box_{number}",
            class_name="box",
            movable=False,
            world_from_body=as_transform(pose),
            mass=1.0,
            world_from_reconstructed=None,
            box=Box(center=tuple(pose[:3, 3].tolist()), size=tuple(size.tolist())),
        )
        shape = f'<geometry><box size="{size[0]} {size[1]} {size[2]}"/></geometry>'
        inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
        link = f'<inertial><mass value="1"/>{inertia}</inertial><collision>{shape}</collision>'
        world.add_body(record, f'<robot name="b"><link name="box_{number}">{link}</link></robot>')
    return world


def timed(function: Callable[[], object]) -> tuple[float, object]:
    """Return the seconds that a call takes, and its result."""
    started = time.perf_counter()
    result = function()
    return time.perf_counter() - started, result


def measure_inverse(robot: Robot, queries: int) -> dict[str, float]:
    """Return share solved and median milliseconds of ours and of pybullet's inverse kinematics."""
    chain = arm_chain(robot.description)
    random = np.random.default_rng(0)
    client = robot.world.client
    with native_output_to_stderr():
        arm_only = engine.loadURDF(str(robot.description.urdf), useFixedBase=True, physicsClientId=client)
    indices = range(engine.getNumJoints(arm_only, physicsClientId=client))
    infos = {index: engine.getJointInfo(arm_only, index, physicsClientId=client) for index in indices}
    tool = next(index for index, info in infos.items() if info[12].decode() == robot.description.tool_link)
    joints = [index for index, info in infos.items() if info[1].decode() in robot.description.arm_joints]
    times: dict[str, list[float]] = {"ours": [], "pybullet": []}
    solved = {"ours": 0, "pybullet": 0}
    for arm in random_starts(chain, queries, random):
        target = forward(chain, arm)
        starts = random_starts(chain, RESTARTS, random)
        seconds, solution = timed(lambda: inverse_kinematics(chain, target, starts))  # noqa: B023
        times["ours"].append(seconds)
        solved["ours"] += solution.found  # type: ignore[attr-defined]

        def peer() -> bool:
            for start in starts:  # noqa: B023
                for index, value in zip(joints, start.tolist(), strict=True):  # noqa: B023
                    engine.resetJointState(arm_only, index, value, physicsClientId=client)
                answer = engine.calculateInverseKinematics(
                    arm_only,
                    tool,
                    target[:3, 3].tolist(),  # noqa: B023
                    quaternion_of(target).tolist(),  # noqa: B023
                    maxNumIterations=200,
                    residualThreshold=1e-4,  # noqa: B023
                    physicsClientId=client,
                )
                values = np.array(answer[:7])
                reached = forward(chain, values)
                inside = bool(np.all(values >= chain.lower) and np.all(values <= chain.upper))
                if inside and np.abs(reached - target).max() < 1e-3:  # noqa: B023
                    return True
            return False

        seconds, found = timed(peer)
        times["pybullet"].append(seconds)
        solved["pybullet"] += bool(found)
    engine.removeBody(arm_only, physicsClientId=client)
    result = {
        f"inverse_kinematics/{name}/milliseconds": 1e3 * float(np.median(values)) for name, values in times.items()
    }
    return result | {f"inverse_kinematics/{name}/solved": count / queries for name, count in solved.items()}


def ompl_path(
    start: np.ndarray, goal: np.ndarray, free: Callable[[np.ndarray], bool], lower: np.ndarray, upper: np.ndarray
) -> bool:
    """Return whether OMPL's RRT-Connect finds a path within 5 s."""
    space = ob.RealVectorStateSpace(7)
    bounds = ob.RealVectorBounds(7)
    for joint in range(7):
        bounds.setLow(joint, float(lower[joint]))
        bounds.setHigh(joint, float(upper[joint]))
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: free(np.array([state[joint] for joint in range(7)])))
    setup.getSpaceInformation().setStateValidityCheckingResolution(0.05 / space.getMaximumExtent())
    states = []
    for values in (start, goal):
        state = space.allocState()
        for joint in range(7):
            state[joint] = float(values[joint])
        states.append(state)
    setup.setStartAndGoalStates(*states)
    planner = og.RRTConnect(setup.getSpaceInformation())
    planner.setRange(0.4)
    setup.setPlanner(planner)
    setup.solve(5.0)
    return bool(setup.haveExactSolutionPath())


def measure_paths(robot: Robot, queries: int) -> dict[str, float]:
    """Return solved share and median milliseconds of ours and OMPL's RRT-Connect, and collision checks per second."""
    checker = CollisionChecker(robot.world, robot)
    chain = arm_chain(robot.description)
    random = np.random.default_rng(1)

    def check(arm: np.ndarray) -> Any:
        return checker.check_meshes(np.concatenate([BASE, arm]))

    samples = random_starts(chain, 2000, random)
    seconds, collisions = timed(lambda: [check(arm) for arm in samples])
    result = {"collision_checks/per_second": len(samples) / seconds}
    free = [arm for arm, hit in zip(samples, collisions, strict=True) if hit is None]  # type: ignore[call-overload]
    result["collision_checks/free_share"] = len(free) / len(samples)
    space = SearchSpace(chain.lower, chain.upper, RESOLUTION)
    times: dict[str, list[float]] = {"ours": [], "ours_smoothed": [], "ompl": []}
    solved = dict.fromkeys(times, 0)
    for number in range(queries):
        start, goal = free[2 * number], free[2 * number + 1]
        for name, smoothing in (("ours", 0), ("ours_smoothed", 60)):

            def ours() -> np.ndarray | None:
                try:
                    return rrt_connect(start, goal, check, space, np.random.default_rng(number), smoothing=smoothing)  # noqa: B023
                except MotionFailed:
                    return None

            seconds, path = timed(ours)
            times[name].append(seconds)
            if isinstance(path, np.ndarray):
                solved[name] += first_collision(densify(path, RESOLUTION), check) is None
        seconds, found = timed(lambda: ompl_path(start, goal, lambda arm: check(arm) is None, chain.lower, chain.upper))  # noqa: B023
        times["ompl"].append(seconds)
        solved["ompl"] += bool(found)
    for name, values in times.items():
        result[f"rrt_connect/{name}/milliseconds"] = 1e3 * float(np.median(values))
        result[f"rrt_connect/{name}/milliseconds_p90"] = 1e3 * float(np.quantile(values, 0.9))
        result[f"rrt_connect/{name}/solved"] = solved[name] / queries
    return result


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    arguments = asked(Measurement)
    ou.setLogLevel(ou.LogLevel.LOG_ERROR)
    ou.RNG.setSeed(1)
    queries = 12 if arguments.quick else 60
    with boxes_world() as world:
        robot = Robot(world, load_robot("panda"))
        measure_inverse(robot, 3)  # compile
        metrics = {"queries": float(queries)} | measure_inverse(robot, 10 * queries) | measure_paths(robot, queries)
    lines = [f"{queries} path queries, {10 * queries} inverse kinematics queries, Panda among seven boxes", ""]
    lines += ["| measure | value |", "|---|---|"]
    lines += [f"| {name} | {value:.3g} |" for name, value in metrics.items()]
    text = "\n".join([*lines, ""])
    write_measured(arguments.out, metrics, text)


if __name__ == "__main__":
    main()
