"""The step `agent run`: one task in one apartment, by one arm and one brain."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.agent_episode import AgentEpisode
from scenewright.schemas.apartment import Apartment
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.outside import LARGEST_SETTINGS
from scenewright.stages.agent.arms.registry import ARMS
from scenewright.stages.agent.brains.brain import Brain
from scenewright.stages.agent.brains.language import LanguageBrain
from scenewright.stages.agent.episodes import write_episode
from scenewright.stages.agent.parameters import RunParameters
from scenewright.stages.agent.session import Limits
from scenewright.stages.agent.tasks import TASKS, make_apartment, make_household
from scenewright.stages.agent.trials import Setting, goals_of, rules_brain
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.reconstructed import apartment_of, lived_in, truth_of
from scenewright.stages.kit.acting.errors import segmenter_rates
from scenewright.stages.kit.acting.eyes.identity import identity_of
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.language.scripted import ScriptedBackend
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT
from scenewright.stages.kit.stage import Context


def run(
    world: Path | None,
    scene: InteractiveScene | None,
    truth: GroundTruth | None,
    transcript: Path | None,
    *,
    parameters: RunParameters,
    context: Context,
) -> AgentEpisode:
    """Let the robot do what it is told: in the true room of `truth`, of which it knows `scene` from the start where
    that is given, in `world`, or in an apartment of the seed."""
    task = TASKS.get(parameters.task)
    words = task.words if task else parameters.task
    known_apartment = None if scene is None else apartment_of(scene.info.bodies, str(scene.root))
    room = None
    if truth is not None:
        apartment, room = lived_in(truth)
    elif world is not None:
        apartment = Apartment.read(world, largest=LARGEST_SETTINGS, hint="see docs/AGENT.md")
    else:
        apartment = make_apartment(task, context.seed) if task else make_household(context.seed)
    setting = Setting(
        apartment,
        words,
        task.goals if task else goals_of(words),
        Rates(segmenter_rates(parameters.segmenter_errors)).scaled(parameters.failures, parameters.perception),
        context.seed,
        Limits(turns=parameters.turns),
        world=parameters.simulation,
        known=known_apartment,
        segmenter=parameters.segmenter,
        robot=parameters.robot,
        room=room,
    )
    chat = _chat(parameters, transcript, context) if parameters.brain == "language" else None
    brain: Brain = LanguageBrain(words, chat) if chat is not None else rules_brain(setting, parameters.arm)
    if chat is None:
        context.logger.info("no language model is asked: rules of ours write the programs")
    with context.progress.step("session"):
        return write_episode(
            context.output,
            setting,
            parameters.arm,
            task=task.name if task else "",
            impossible=task.impossible if task else "",
            scales=(parameters.failures, parameters.perception),
            brain=brain,
            one_program=chat is None and ARMS[parameters.arm].one_program,
            language=lambda: chat.record if chat is not None else None,
            label=brain.label,
            width=parameters.image_width,
            segmenter=identity_of(parameters.segmenter),
            segmenter_errors=parameters.segmenter_errors,
            robot=load_robot(parameters.robot).name if parameters.simulation == "physics" else USUAL_ROBOT,
            room=truth_of(truth) if parameters.simulation == "physics" else "",
        )


def _chat(parameters: RunParameters, transcript: Path | None, context: Context) -> Chat:
    nobody = ScriptedBackend("nobody", lambda request: "")  # refused before: --brain language needs somebody to ask
    return open_chat(parameters, scripted=nobody, transcript=transcript, record=context.output / "transcript.jsonl")
