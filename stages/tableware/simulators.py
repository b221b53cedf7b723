"""Where a table is cleared: the simulators by the names of the command line. Physics are loaded when asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.tableware_plan import TimesOfActions
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.tableware.parameters import SimulateParameters
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.choice import as_times, chances_of, time_model
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.simulation.arm_times import arm_times
from scenewright.stages.tableware.simulation.fast import FastWorld
from scenewright.stages.tableware.simulation.trial import Done, World
from scenewright.stages.tableware.table_pictures import write_animation
from scenewright.stages.tableware.world.items import Table
from scenewright.stages.tableware.world.setting import Gripper, Setting

ANIMATION_WIDTH = 560
"""Largest width of an animation [px]; by eye."""
SIMULATION = "scenewright.stages.tableware.simulation"
"""Package whose modules of physics are loaded only when they are asked for."""
Again = Callable[[Table, Done, int], Action]
"""Decides in the policy's place after actions that changed nothing (trial.run_in)."""


class Simulator(Protocol):
    """One table in one world."""

    times: TimeModel
    """By which the policy plans."""
    chances: Chances
    """What the policy is told of what goes wrong."""
    again: Again | None
    recorded_times: TimesOfActions | None
    """As the artifact keeps them; None where time is what the world takes."""
    recorded_chances: str
    recorded_robot: str

    def open(self, table: Table, seed: int, setting: Setting) -> World:
        """Return the world with a table in it."""
        ...

    def close(self) -> None:
        """Free what the world holds."""
        ...

    def draw(self, done: Sequence[Done], folder: Path, width: int) -> None:
        """Write clearing.gif, and what else there is to see; strips are `width` [px] wide."""
        ...


class FastSimulator:
    """The fitted time model."""

    again: Again | None = None

    def __init__(self, parameters: SimulateParameters) -> None:
        self.times, self.chances = time_model(parameters), chances_of(parameters.chances)
        self.recorded_times: TimesOfActions | None = as_times(self.times)
        self.recorded_chances: str = parameters.chances
        self.recorded_robot = ""

    def open(self, table: Table, seed: int, setting: Setting) -> World:
        """Return the fast world."""
        return FastWorld(table, self.times, self.chances, seed, setting)

    def close(self) -> None:
        """Nothing is held."""

    def draw(self, done: Sequence[Done], folder: Path, width: int) -> None:
        """Write clearing.gif."""
        moving = [(each.action, each.before, each.after, f"{each.start:.0f} s: {each.action.words}") for each in done]
        write_animation(folder / "clearing.gif", moving, min(ANIMATION_WIDTH, width))


class PhysicsSimulator:
    """Contact physics; the arm's own times, but for those that are given explicitly. Raises MissingDependency where
    there is no physics, and as `fitting_robot` does."""

    recorded_times: TimesOfActions | None = None
    recorded_chances: str = "contact"

    def __init__(self, parameters: SimulateParameters) -> None:
        given_seconds = {
            "trip": parameters.trip_seconds,
            "stack": parameters.stack_seconds,
            "pull": parameters.pull_seconds,
        }
        arm = arm_times(parameters.delay)
        self.times = replace(arm, **{name: value for name, value in given_seconds.items() if value is not None})
        self.chances = replace(chances_of(parameters.chances), spills=True)
        self.again: Again | None = physics_part("physics_trial").alone
        self._robot: RobotDescription = physics_part("hand_fit").fitting_robot(parameters.robot)
        self.recorded_robot = self._robot.name
        self._recording = physics_part("recording").Recording()
        self._world: Any = None

    def open(self, table: Table, seed: int, setting: Setting) -> World:
        """Return the world of bodies. Raises BadInput for another hand than the one that is modelled."""
        if setting.gripper != Gripper():
            raise BadInput(
                "the arm in physics has the standard hand, the scene's dishes.toml has another",
                hint="--simulator fast, or a dishes.toml without [gripper]",
            )
        self._world = physics_part("physics").PhysicsTable(table, robot=self._robot, record=self._recording)
        world: World = self._world
        return world

    def close(self) -> None:
        """Free the physics engine."""
        if self._world is not None:
            self._world.close()

    def draw(self, done: Sequence[Done], folder: Path, width: int) -> None:
        """Write physics.png and clearing.gif from what was recorded."""
        frames: dict[str, np.ndarray] = self._recording.arrays()
        pictures = physics_part("physics_pictures")
        words = [
            next((each.action.words for each in done if each.start <= seconds <= each.end + 1e-6), "")
            for seconds in frames["seconds"]
        ]
        pictures.draw_physics_strip(frames, words, width, self._robot).save(folder / "physics.png")
        pictures.write_physics_animation(
            folder / "clearing.gif", frames, words, min(ANIMATION_WIDTH, width), self._robot
        )


SIMULATORS: dict[str, Callable[[SimulateParameters], Simulator]] = {"fast": FastSimulator, "physics": PhysicsSimulator}


def physics_part(name: str) -> Any:
    """Return a module of the simulation that needs a physics engine. Raises MissingDependency where there is none."""
    try:
        return importlib.import_module(f"{SIMULATION}.{name}")
    except ImportError as error:
        raise MissingDependency(f"tableware has no physics here: {error}", hint="--simulator fast") from None
