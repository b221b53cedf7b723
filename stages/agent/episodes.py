"""A trial as an artifact: what was said and done, what the robot knew after each turn, and the same once more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
from scenewright.schemas.agent_episode import (
    AgentEpisode,
    EpisodeCall,
    EpisodeFile,
    EpisodeMaps,
    EpisodeScore,
    EpisodeTurn,
    MapSnapshot,
    MapThing,
)
from scenewright.schemas.language import LanguageRecord
from scenewright.stages.agent.arms.skills import CommonSkills
from scenewright.stages.agent.brains.brain import Brain, Reply
from scenewright.stages.agent.episode_log import Moment, write_log
from scenewright.stages.agent.judging import score
from scenewright.stages.agent.language.interpreter import Called, Ran
from scenewright.stages.agent.language.values import as_text
from scenewright.stages.agent.obstacle_map import CELL, UNKNOWN
from scenewright.stages.agent.pictures import Panel, animate_map, draw_growing_map, write_views
from scenewright.stages.agent.scene_map import SceneMap
from scenewright.stages.agent.session import Session, Turn
from scenewright.stages.agent.trials import Setting, run_trial
from scenewright.stages.agent.world.truth import World
from scenewright.stages.kit.acting.eyes.options import SegmenterName
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT


class RecordedBrain:
    """Says again what the brain of an episode said, and stops where it stopped."""

    def __init__(self, file: EpisodeFile) -> None:
        self._file, self._next = file, 0

    @property
    def label(self) -> str:
        """That of the brain of the episode."""
        return self._file.brain

    def reply(self, last: Ran | None) -> Reply:
        """Return the next recorded program. Raises LanguageFailed as in the episode."""
        if self._next >= len(self._file.turns):
            failure = self._file.stopped
            raise LanguageFailed(failure.kind, failure.message) if failure else LanguageFailed("end", "no more")
        turn = self._file.turns[self._next]
        self._next += 1
        return Reply(turn.reason, turn.code)


class Watching:
    """Takes down the robot's map after every turn that changed it."""

    def __init__(self) -> None:
        self.snapshots: list[MapSnapshot] = []
        self.panels: list[Panel] = []
        self.moments: list[Moment] = []
        self._views: list[np.ndarray] = []
        self._turn = 0
        self._way: list[tuple[float, float]] = []

    def see(self, turn: Turn, skills: CommonSkills, world: World) -> None:
        """Look at one turn."""
        self._turn += 1
        scene = skills.scene
        self._way.append((turn.base.x, turn.base.y))
        area = round(float(np.count_nonzero(scene.obstacles.window != UNKNOWN)) * CELL**2, 2)
        things = _things(scene)
        views = [picture for _, picture in world.pictures]
        fresh = tuple(v for v in views if not any(v is earlier for earlier in self._views))
        self._views = views
        window, origin = scene.obstacles.window.copy(), scene.obstacles.origin
        text = turn_text(self._turn, _turn(turn))
        self.moments.append(Moment(turn.seconds, turn.base, text, window, origin, things, fresh))
        if self.snapshots and self.snapshots[-1].things == things and self.snapshots[-1].known_area == area:
            return
        self.snapshots.append(MapSnapshot(turn=self._turn, known_area=area, things=things))
        title = f"turn {self._turn}: {turn.reply.code.splitlines()[0] if turn.reply.code else ''}"
        self.panels.append(Panel(title, window, origin, things, tuple(self._way), turn.base))


def write_episode(
    output: Path,
    setting: Setting,
    arm: str,
    *,
    task: str,
    impossible: str,
    scales: tuple[float, float],
    brain: Brain | None,
    one_program: bool,
    language: Callable[[], LanguageRecord | None],
    label: str,
    width: int,
    segmenter: str = "",
    segmenter_errors: SegmenterName = "thesis",
    robot: str = USUAL_ROBOT,
    room: str = "",
) -> AgentEpisode:
    """Run a trial and write it down. `language` says, when it is over, what was asked of a model; `segmenter` is what
    the service that was asked for masks says it is, `segmenter_errors` whose errors a simulated one made, `robot` the
    name that its description has, `room` the digest of the truth whose room it was in."""
    watching = Watching()
    session, world = run_trial(setting, arm, brain, one_program=one_program, watch=watching.see)
    scored = score(setting.goals, impossible, session, world)
    write_views(output / "views.png", world.pictures)
    world.close()
    file = EpisodeFile(
        words=setting.words,
        task=task,
        arm=arm,
        brain=label,
        seed=setting.seed,
        simulation=setting.world,
        failures=scales[0],
        perception=scales[1],
        segmenter=segmenter,
        segmenter_errors=segmenter_errors,
        robot=robot,
        room=room,
        most_turns=setting.limits.turns,
        end=session.end,
        said=session.words,
        stopped=session.stopped,
        understood=bool(setting.goals),
        turns=tuple(_turn(turn) for turn in session.turns),
        score=EpisodeScore(**asdict(scored)),
        language=language(),
    )
    file.write(output / "episode.json")
    setting.apartment.write(output / "apartment.json")
    if setting.known is not None:
        setting.known.write(output / "known.json")
    EpisodeMaps(snapshots=tuple(watching.snapshots)).write(output / "maps.json")
    output.joinpath("episode.txt").write_text(episode_text(file), encoding="utf-8")
    write_log(output / "episode.mcap", watching.moments)
    draw_growing_map(output / "map.png", watching.panels, width)
    animate_map(output / "map.gif", watching.panels, width // 2)
    success = scored.success if setting.goals else session.end == "done"
    return AgentEpisode(root=output, outcome=_outcome(session, success), summary=_summary(file))


def _outcome(session: Session, success: bool) -> str:
    if success and session.end == "done":
        return "ok"
    return {"done": "not_done", "give_up": "gave_up", "ask": "asked"}.get(session.end, "stopped")


def _summary(file: EpisodeFile) -> dict[str, object]:
    return {
        "brain": file.brain if file.language else f"{file.brain} (no language model)",
        "end": file.end,
        "said": file.said[:200],
        "calls": file.score.calls,
        "seconds": round(file.score.seconds, 1),
        "metres": round(file.score.metres, 1),
    }


def _turn(turn: Turn) -> EpisodeTurn:
    return EpisodeTurn(
        reason=turn.reply.reason,
        code=turn.reply.code,
        calls=tuple(_call(called) for called in turn.ran.calls),
        printed=tuple(turn.ran.printed),
        error=turn.ran.error,
        seconds=round(turn.seconds, 3),
        base=(round(turn.base.x, 4), round(turn.base.y, 4), round(turn.base.yaw, 4)),
        holding=turn.holding,
    )


def _call(called: Called) -> EpisodeCall:
    returned = "" if called.error is not None else as_text(called.value)
    return EpisodeCall(name=called.name, arguments=called.arguments, returned=returned, error=called.error)


def _things(scene: SceneMap) -> tuple[MapThing, ...]:
    mapped_things = [
        MapThing(
            key=key,
            label=piece.label,
            place="",
            on="",
            position=(round(piece.centre[0], 3), round(piece.centre[1], 3), piece.height),
            size=piece.size,
            views=1,
        )
        for key, piece in scene.furniture.items()
    ]
    mapped_things += [
        MapThing(
            key=item.key,
            label=item.label,
            place=item.place,
            on=scene.carrier_of(item),
            position=(round(item.position[0], 3), round(item.position[1], 3), round(item.position[2], 3)),
            size=(2 * item.radius, 2 * item.radius),
            views=len(item.votes),
        )
        for item in scene.items.values()
    ]
    return tuple(mapped_things)


def episode_text(file: EpisodeFile) -> str:
    """Return the session as people read it."""
    lines = [f"{file.words}", f"arm {file.arm}, brain {file.brain}"]
    lines += [] if file.language else ["No language model was asked: the programs are written by rules."]
    for number, turn in enumerate(file.turns, 1):
        lines += ["", turn_text(number, turn)]
    scored = file.score
    truly = ("It is done." if scored.success else "It is not done.") if file.understood else "No judge knows."
    lines += ["", f"end: {file.end}{f': {file.said}' if file.said else ''}. {truly}"]
    lines.append(f"{scored.calls} calls, {scored.executed} of {scored.executions} executions did what they were to do,")
    lines.append(f"{scored.recovered} of {scored.replanned} tried again; {scored.seconds:.0f} s, {scored.metres:.0f} m")
    return "\n".join(lines) + "\n"


def turn_text(number: int, turn: EpisodeTurn) -> str:
    """Return a turn as people read it: why, the program, what its calls returned."""
    lines = [f"{number}. {turn.reason}", *(f"    {line}" for line in turn.code.splitlines())]
    for call in turn.calls:
        came = call.error.message if call.error is not None else call.returned
        lines.append(f"  {call.name}({', '.join(call.arguments)}): {came}")
    lines += [f"  printed: {text}" for text in turn.printed]
    lines += [f"  error: {turn.error.message}"] if turn.error is not None and not turn.calls else []
    return "\n".join(lines)
