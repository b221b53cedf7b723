"""One trial from a task, an arm and a seed: the apartment, the world, the arm's calls, the brain, the session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from scenewright.schemas.apartment import Apartment
from scenewright.stages.agent.arms.registry import ARMS
from scenewright.stages.agent.arms.skills import CommonSkills
from scenewright.stages.agent.brains.brain import Brain
from scenewright.stages.agent.brains.open_loop import OpenLoopBrain
from scenewright.stages.agent.brains.rules import RulesBrain
from scenewright.stages.agent.brains.slips import Slips
from scenewright.stages.agent.brains.words import NotUnderstood, understood
from scenewright.stages.agent.goals import FURNITURE, THINGS, Goal, sought
from scenewright.stages.agent.session import Limits, Session, Turn, run_session
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.fast import FastWorld
from scenewright.stages.agent.world.floor import Floor
from scenewright.stages.agent.world.reconstructed import mapped
from scenewright.stages.agent.world.truth import World
from scenewright.stages.kit.acting.errors import Luck
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT

WorldName = Literal["fast", "physics"]


@dataclass(frozen=True)
class Setting:
    """What a trial is made of."""

    apartment: Apartment
    words: str
    goals: tuple[Goal, ...]
    """What the judge asks for."""
    rates: Rates
    seed: int
    limits: Limits = Limits()
    floor: Floor | None = None
    """Of the apartment, where several trials share it."""
    world: WorldName = "fast"
    known: Apartment | None = None
    """What was mapped of it before the robot came, as far as it is right."""
    room: Path | None = None
    """Folder of the true scene that `apartment` describes: in physics the robot lives in its bodies as they are."""
    segmenter: str = ""
    """Address of the segmentation service that the eyes ask in physics; empty: the oracle with errors."""
    robot: str = USUAL_ROBOT
    """Of data/robots/, or the path of a description; only in physics."""


def goals_of(words: str) -> tuple[Goal, ...]:
    """Return the goals of a user's words for the judge; none where we do not understand them."""
    try:
        return understood(words)
    except NotUnderstood:
        return ()


def open_world(setting: Setting, arm: str) -> World:
    """Return the world of a trial: its eyes are prompted with the classes that the goals name. Close it.

    Raises as AskedSegmenter does for a segmentation service.
    """
    rates = setting.rates.with_true_eyes() if ARMS[arm].true_eyes else setting.rates
    if setting.world == "physics":
        from scenewright.stages.agent.world.physics.apartment_room import ApartmentRoom  # heavy: pybullet and Open3D
        from scenewright.stages.agent.world.physics.body import PhysicsBody
        from scenewright.stages.agent.world.physics.scene_room import SceneRoom

        segmenter = None
        if setting.segmenter:
            from scenewright.stages.kit.acting.eyes.asked import AskedSegmenter

            segmenter = AskedSegmenter(setting.segmenter, setting.seed, (*THINGS, *FURNITURE))
        apartment = setting.apartment
        room = ApartmentRoom(apartment) if setting.room is None else SceneRoom(setting.room, apartment)
        return PhysicsBody(room, sought(setting.goals), rates, setting.seed, segmenter, setting.robot)
    return FastWorld(setting.apartment, sought(setting.goals), rates, setting.seed, setting.floor)


def rules_brain(setting: Setting, arm: str) -> Brain:
    """Return the brain without a language model; it writes calls down wrongly at the rate of the failure table."""
    luck = Luck(setting.seed)

    def happens(key: int) -> float | None:
        return luck.uniform("which", key) if luck.happens(setting.rates.api, "api", key) else None

    if ARMS[arm].one_program:
        return OpenLoopBrain(setting.words, Slips(happens))
    return RulesBrain(setting.words, ARMS[arm].style, Slips(happens))


def run_trial(
    setting: Setting,
    arm: str,
    brain: Brain | None = None,
    *,
    one_program: bool = False,
    watch: Callable[[Turn, CommonSkills, World], None] | None = None,
) -> tuple[Session, World]:
    """Run one trial; close its world. A brain that is given answers turn by turn, unless it is to say `one_program`."""
    world = open_world(setting, arm)
    skills = ARMS[arm].skills(world)
    if setting.known is not None:
        skills.scene.know(mapped(setting.known))

    def see(turn: Turn) -> None:
        if watch is not None:
            watch(turn, skills, world)

    single_program = one_program or (brain is None and ARMS[arm].one_program)
    session = run_session(
        brain or rules_brain(setting, arm), skills, world, setting.limits, one_program=single_program, watch=see
    )
    return session, world
