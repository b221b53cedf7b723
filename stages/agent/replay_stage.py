"""The step `agent replay`: an episode again, with the programs that it holds."""

from __future__ import annotations

import shutil

from scenewright.schemas.agent_episode import AgentEpisode
from scenewright.schemas.apartment import Apartment
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.stages.agent.arms.registry import ARMS
from scenewright.stages.agent.brains.open_loop import OpenLoopBrain
from scenewright.stages.agent.episodes import RecordedBrain, write_episode
from scenewright.stages.agent.parameters import ReplayParameters
from scenewright.stages.agent.session import Limits
from scenewright.stages.agent.tasks import TASKS
from scenewright.stages.agent.trials import Setting, goals_of
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.reconstructed import lived_in, truth_of
from scenewright.stages.kit.acting.errors import segmenter_rates
from scenewright.stages.kit.acting.eyes.identity import identity_of
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.stage import Context


def run(
    episode: AgentEpisode, truth: GroundTruth | None = None, *, parameters: ReplayParameters, context: Context
) -> AgentEpisode:
    """Carry out the programs of an episode in its world once more: in the room of `truth`, where it was in one."""
    file = episode.info
    if file.arm not in ARMS or (file.task and file.task not in TASKS):
        raise BadInput(f"{episode.root}: no arm {file.arm!r}, or no task {file.task!r}", hint="run it again")
    identity = identity_of(parameters.segmenter)
    if identity != file.segmenter:
        raise BadInput(
            f"{episode.root}: seen by {file.segmenter or 'the oracle with errors'}, not by {identity or 'it'}",
            hint="give --segmenter with the address of that service" if file.segmenter else "leave --segmenter out",
        )
    name = load_robot(parameters.robot).name
    if name != file.robot:
        raise BadInput(
            f"{episode.root}: done by the robot {file.robot}, not by {name}",
            hint=f"give --robot {file.robot}, or its description",
        )
    if truth_of(truth) != file.room:
        where = f"the room of the truth {file.room[:12]}" if file.room else "an apartment that it holds"
        raise BadInput(
            f"{episode.root}: it was in {where}, not in {truth.root if truth else 'an apartment'}",
            hint="give --truth with that ground truth" if file.room else "leave --truth out",
        )
    task = TASKS.get(file.task)
    setting = Setting(
        episode.apartment,
        file.words,
        task.goals if task else goals_of(file.words),
        Rates(segmenter_rates(file.segmenter_errors)).scaled(file.failures, file.perception),
        file.seed,
        Limits(turns=file.most_turns),
        world=file.simulation,
        known=Apartment.read(episode.path("known.json")) if episode.path("known.json").is_file() else None,
        segmenter=parameters.segmenter,
        robot=parameters.robot,
        room=lived_in(truth)[1] if truth is not None and file.room else None,
    )
    replayed = write_episode(
        context.output,
        setting,
        file.arm,
        task=file.task,
        impossible=task.impossible if task else "",
        scales=(file.failures, file.perception),
        brain=RecordedBrain(file),
        one_program=file.brain == OpenLoopBrain.label,
        language=lambda: file.language,
        label=file.brain,
        width=parameters.image_width,
        segmenter=identity,
        segmenter_errors=file.segmenter_errors,
        robot=name,
        room=file.room,
    )
    if episode.path("transcript.jsonl").is_file():
        shutil.copyfile(episode.path("transcript.jsonl"), context.output / "transcript.jsonl")
    if replayed.info != file:
        return AgentEpisode(root=replayed.root, outcome="differs", summary=replayed.summary)
    return replayed
