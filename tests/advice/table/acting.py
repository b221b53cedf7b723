"""Robots: `agent`, `plan`, `predicates`, `pack`."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from scenewright.cli.main import run

from tests.advice.inputs import golden
from tests.advice.rows import NotTried, Tried
from tests.advice.table.kit import given_transcript

AGENT = "stages/agent/parameters.py"
RUN = "agent run --task place_fruit --out a --dry-run "
SCENE = "--scene {golden}/interactive_scene --truth {golden}/ground_truth "
RECORDED = "--language recorded --transcript t.jsonl"
SEGMENTER = "--simulation physics --segmenter http://127.0.0.1:9 "
PLAN = "plan --scene {golden}/interactive_scene --out p "
ON = '--goal "on(bottle_10, table_52)" '
LEARNED = "{golden}/learned_domain"


def agent(says: str, first: str, then: str, **options: object) -> Tried:
    """Return the row of options of `agent run`."""
    return Tried(AGENT, says, RUN + first, RUN + then, **options)  # type: ignore[arg-type]


def seen_by(identity: str, file: str = "") -> Callable[[], int]:
    """Return what replays an episode with the eyes of a service."""

    def replay() -> int:
        with mock.patch("scenewright.stages.agent.replay_stage.identity_of", return_value=identity):
            return run(["agent", "replay", "--episode", file or f"{golden()}/agent_episode", "--out", "again"])

    return replay


def given_seen_episode(folder: Path) -> None:
    """An episode that was seen by a service."""
    from tests.unit.viewing.artifacts import seal

    shutil.copytree(Path(golden()) / "agent_episode", folder / "seen")
    document = json.loads((folder / "seen" / "episode.json").read_text())
    (folder / "seen" / "episode.json").write_text(json.dumps(document | {"segmenter": "by colour r1"}))
    seal(folder / "seen", "agent_episode")


def without_draws() -> int:
    """Draw no apartment at all."""
    with mock.patch("scenewright.stages.agent.world.generation.TRIES", 0):
        return run(["agent", "run", "--task", "place_fruit", "--out", "a"])


def bare_scene() -> object:
    """Take a scene without a floor for an apartment."""
    from scenewright.stages.agent.world.reconstructed import apartment_of

    return apartment_of([], "scene")


def scan_lived_in() -> object:
    """Live in the room of a scan."""
    from scenewright.schemas.ground_truth import GroundTruth
    from scenewright.stages.agent.world.reconstructed import lived_in

    Path("scan").mkdir()
    about = GroundTruth(Path(golden()) / "ground_truth").info.model_copy(update={"source": "scan"})
    about.write(Path("scan") / "ground_truth.json")
    return lived_in(GroundTruth(Path("scan")))


def given_episode_in_a_room(folder: Path) -> None:
    """An episode in the room of the golden truth."""
    from tests.unit.viewing.artifacts import seal

    shutil.copytree(Path(golden()) / "agent_episode", folder / "lived")
    manifest = json.loads((Path(golden()) / "ground_truth" / "manifest.json").read_text())
    document = json.loads((folder / "lived" / "episode.json").read_text())
    document |= {"simulation": "physics", "room": manifest["content_digest"]}
    (folder / "lived" / "episode.json").write_text(json.dumps(document))
    seal(folder / "lived", "agent_episode")


def goal_in_words() -> object:
    """Read a goal in words of one's own."""
    from scenewright.schemas.contact_graph import ContactGraphFile
    from scenewright.stages.plan.open_goals import named_goal

    graph = ContactGraphFile.read(Path(golden()) / "contact_graph" / "graph.json")
    return named_goal(('on("red mug","table")',), {}, graph, None)


def without_tries() -> int:
    """Draw no packing problem at all."""
    with mock.patch("scenewright.stages.pack.hard_suites.TRIES", 0):
        return run(["pack", "--suite", "hard/fill", "--out", "p"])


def given_learned_in_rooms(folder: Path) -> None:
    """A domain that says of itself that it was learned in rooms."""
    from tests.unit.viewing.artifacts import seal

    shutil.copytree(Path(golden()) / "learned_domain", folder / "rooms")
    document = json.loads((folder / "rooms" / "domain.json").read_text())
    nothing: dict[str, list[str]] = {name: [] for name, value in document.items() if isinstance(value, list)}
    document |= {**nothing, "setting": "room", "domain": "room"}
    (folder / "rooms" / "domain.json").write_text(json.dumps(document))
    seal(folder / "rooms", "learned_domain")


def given_torn_memory(folder: Path) -> None:
    """A domain, an action of which leads to a state that is not there."""
    from tests.unit.viewing.artifacts import seal

    shutil.copytree(Path(golden()) / "learned_domain", folder / "torn")
    document = json.loads((folder / "torn" / "domain.json").read_text())
    document["transitions"][0]["after"] = 10_000
    (folder / "torn" / "domain.json").write_text(json.dumps(document))
    seal(folder / "torn", "learned_domain")


TEACH = "predicates teach --out l --dry-run"
EVALUATE = "predicates evaluate --out e --each 1 --states 10 "
ROWS = [
    Tried(AGENT, "--task is empty", "agent run --task ' ' --out a --dry-run", RUN),
    agent("--scene is what the robot knows of a room", "--scene {golden}/interactive_scene", SCENE),
    agent("--world and --truth are two rooms", SCENE + "--world {golden}/agent_episode/apartment.json", SCENE),
    agent("give --simulation physics too", "--segmenter http://127.0.0.1:9", SEGMENTER + "--arm ours", then_code=5),
    agent("--segmenter errs as it does", SEGMENTER + "--arm oracle", "--simulation physics --arm oracle"),
    agent("give --brain language too", RECORDED, "--brain language " + RECORDED, given=given_transcript),
    agent(
        "--brain language needs somebody", "--brain language", "--brain language " + RECORDED, given=given_transcript
    ),
    Tried(
        "stages/agent/replay_stage.py",
        "leave --segmenter out",
        seen_by("by colour r1"),
        "agent replay --episode {golden}/agent_episode --out again --accept differs",
        code=3,
    ),
    Tried(
        "stages/agent/replay_stage.py",
        "give --segmenter with the address",
        "agent replay --episode seen --out again",
        "agent replay --episode seen --out again --segmenter http://127.0.0.1:9 --dry-run",
        code=3,
        then_code=5,
        given=given_seen_episode,
        shows="no segmentation service answers",
    ),
    Tried(
        "stages/agent/replay_stage.py",
        "leave --truth out",
        "agent replay --episode {golden}/agent_episode --truth {golden}/ground_truth --out again",
        "agent replay --episode {golden}/agent_episode --out again --accept differs",
        code=3,
    ),
    Tried(
        "stages/agent/replay_stage.py",
        "give --truth with that ground truth",
        "agent replay --episode lived --out again",
        "agent replay --episode lived --truth {golden}/ground_truth --out again --dry-run",
        code=3,
        given=given_episode_in_a_room,
    ),
    Tried(
        "stages/agent/world/reconstructed.py",
        "the truth of a scan has no room",
        scan_lived_in,
        RUN + "--truth {golden}/ground_truth",
        code=3,
    ),
    Tried("stages/agent/world/generation.py", "choose another --seed", without_draws, RUN + "--seed 1"),
    Tried(
        "stages/agent/world/reconstructed.py",
        "or use --world",
        bare_scene,
        RUN + "--world {golden}/agent_episode/apartment.json",
        code=3,
    ),
    Tried(
        "stages/pack/hard_suites.py", "choose another --instance", without_tries, "pack --instance 1 --out p --dry-run"
    ),
    Tried(
        "stages/pack/parameters.py",
        "reads no --transcript",
        "pack --out p --dry-run " + RECORDED,
        "pack --out p --dry-run --proposer symbolic " + RECORDED,
        given=given_transcript,
    ),
    Tried(
        "stages/plan/given_domain.py",
        "predicates teach --scene",
        PLAN + "--domain " + LEARNED,
        TEACH + " --scene {golden}",
        code=3,
    ),
    Tried(
        "stages/plan/parameters.py",
        "--goal and --task cannot be given",
        PLAN + ON + "--task tidy-the-desk --dry-run",
        PLAN + ON + "--dry-run",
    ),
    Tried(
        "stages/plan/parameters.py",
        "with --eyes true nothing is segmented",
        PLAN + ON + "--segmenter-errors detector --dry-run",
        PLAN + ON + "--segmenter-errors detector --eyes camera --dry-run",
    ),
    Tried(
        "stages/plan/parameters.py",
        "--planner fast-downward plans in",
        PLAN + "--domain own.pddl --planner fast-downward --dry-run",
        PLAN + "--planner fast-downward --dry-run",
    ),
    Tried(
        "stages/plan/parameters.py",
        "--stand",
        PLAN + "--stand 1 --stand 2 --dry-run",
        PLAN + "--stand 1 --stand 2 --stand 90 --dry-run",
    ),
    NotTried(
        "stages/plan/tasks.py",
        "declared with --assume",
        "a planned task of minutes: tests/unit/plan/test_tasks_and_checks.py",
    ),
    Tried(
        "stages/plan/open_goals.py",
        "give --language",
        goal_in_words,
        PLAN + """--goal 'on("red mug","table")' --language {golden}/language_map --dry-run""",
    ),
    Tried(
        "stages/predicates/evaluate_stage.py",
        "leave --scene out",
        EVALUATE + "--learned " + LEARNED + " --scene {golden}",
        EVALUATE + "--learned " + LEARNED + " --dry-run",
        code=3,
    ),
    Tried(
        "stages/predicates/evaluate_stage.py",
        "--scene FOLDER",
        EVALUATE + "--learned rooms",
        EVALUATE + "--learned rooms --scene {golden} --dry-run",
        code=3,
        given=given_learned_in_rooms,
    ),
    Tried(
        "stages/predicates/learning/records.py",
        "scenewright predicates teach",
        "predicates plan --learned torn --out p",
        TEACH,
        code=3,
        given=given_torn_memory,
    ),
    Tried(
        "stages/predicates/parameters.py",
        "--goal: more than 2000",
        "predicates plan --learned " + LEARNED + " --out p --dry-run --goal '" + "cup on table and " * 200 + "'",
        "predicates plan --learned " + LEARNED + " --out p --dry-run --goal 'cup on table'",
    ),
    Tried(
        "stages/predicates/plan_stage.py",
        "scenewright plan --domain",
        "predicates plan --learned rooms --out p",
        PLAN + "--domain rooms --dry-run",
        code=3,
        given=given_learned_in_rooms,
    ),
    Tried(
        "stages/predicates/teach_stage.py",
        "begin without --learned",
        "predicates teach --learned rooms --out l",
        TEACH,
        code=3,
        given=given_learned_in_rooms,
    ),
    Tried(
        "stages/predicates/teacher/opening.py",
        "did you mean --teacher terminal?",
        "predicates teach --out l --dialogue teacher.jsonl",
        "predicates teach --out l --dialogue teacher.jsonl --teacher terminal --dry-run",
        given=lambda folder: (folder / "teacher.jsonl").write_text('{"question": "May I?", "answer": "yes"}\n'),
    ),
    Tried(
        "stages/predicates/teacher/opening.py",
        "or give --dialogue teacher.jsonl",
        "predicates teach --out l --teacher terminal",
        "predicates teach --out l --dialogue teacher.jsonl --teacher terminal --dry-run",
        given=lambda folder: (folder / "teacher.jsonl").write_text('{"question": "May I?", "answer": "yes"}\n'),
    ),
    NotTried(
        "stages/predicates/teacher/terminal.py", "or --teacher terminal in a terminal", "there is no terminal here"
    ),
]
