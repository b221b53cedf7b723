"""The steps of `cutting`."""

from __future__ import annotations

import json
from pathlib import Path

from tests.advice.rows import Tried

OPTIONS, WORDS = "stages/cutting/parameters.py", "stages/cutting/words.py"
MENDING = "stages/cutting/world/mending.py"
PLANNING = "cutting plan --model {golden}/cutting_model --out out --image-width 300"
DEMONSTRATED = f"{PLANNING} --demonstrations {{cut}}/demonstrations"
LOAF = f"{PLANNING} --goal '2 slices' --mesh {{cut}}/"
SIMULATING = "cutting simulate --model {golden}/cutting_model --out out --image-width 300"


def goal(says: str, first: str, then: str) -> Tried:
    """A goal in words that is not planned for, and one that is."""
    return Tried(WORDS, says, f"{PLANNING} --dry-run --goal '{first}'", f"{PLANNING} --dry-run --goal '{then}'")


def two_slices(folder: Path) -> None:
    """Of 0.12 x 0.04 x 0.04 m."""
    wanted = json.loads((folder / "out/plan.json").read_text())["wanted"]
    assert [round(1e6 * fragment["volume"], 3) for fragment in wanted] == [96, 96], wanted


def two_trials(folder: Path) -> None:
    assert len(json.loads((folder / "out/demonstrations.json").read_text())["trials"]) == 2


def empty_recording(folder: Path) -> None:
    (folder / "empty.json").write_text('{"trials": []}')
    (folder / "other.json").write_text('{"cuts": 3}')


ROWS = [
    goal("is not a number with a category", "some slices", "6 slices, 8 cubes"),
    goal("there is no category", "6 wedges", "6 cubes"),
    goal("are named twice", "2 slices, 3 slices", "5 slices"),
    goal("--goal: 0 ", "2 slices and 0 cubes", "2 slices"),
    goal("at most", "300 cubes", "200 cubes"),
    *(
        Tried(OPTIONS, "nothing is wanted", f"{PLANNING} --dry-run", f"{PLANNING} --dry-run {given}")
        for given in (
            "--goal '6 slices'",
            "--goal-meshes {cut}",
            "--goal-pictures {cut}",
            "--demonstrations {cut}/demonstrations",
        )
    ),
    Tried(
        OPTIONS,
        "for fragments, not for words",
        f"{PLANNING} --dry-run --goal '6 slices' --method bc",
        f"{PLANNING} --dry-run --goal '6 slices' --method ours",
    ),
    Tried(
        OPTIONS,
        "--together",
        f"{DEMONSTRATED} --dry-run --together --method bc",
        f"{DEMONSTRATED} --dry-run --together --method ours",
    ),
    Tried(
        OPTIONS,
        "both set the object",
        f"{DEMONSTRATED} --dry-run --mesh {{cut}}/loaf.stl",
        f"{PLANNING} --dry-run --goal '6 slices' --mesh {{cut}}/loaf.stl",
    ),
    Tried(
        OPTIONS,
        "--cameras",
        f"{SIMULATING} --dry-run --plan {{golden}}/cutting_plan --cameras --method bc",
        f"{SIMULATING} --dry-run --plan {{golden}}/cutting_plan --cameras --method ours",
    ),
    Tried(MENDING, "millimetres", f"{LOAF}loaf_mm.stl", f"{LOAF}loaf_mm.stl --unit mm", code=3, right=two_slices),
    Tried(
        MENDING, "is it in metres", f"{LOAF}loaf.stl --unit mm", f"{LOAF}loaf.stl --unit m", code=3, right=two_slices
    ),
    Tried(
        "stages/cutting/demonstrations/records.py",
        "--trial",
        f"{DEMONSTRATED} --trial 7",
        f"{DEMONSTRATED} --trial 1",
        code=3,
    ),
    Tried(
        "stages/cutting/demonstrate_stage.py",
        "nothing was cut",
        "cutting demonstrate --record empty.json --out out",
        "cutting demonstrate --record {cut}/cuts.json --out out --image-width 300",
        code=3,
        given=empty_recording,
        right=two_trials,
    ),
    Tried(
        "stages/cutting/recording/session.py",
        "scenewright cutting record",
        "cutting demonstrate --record other.json --out out",
        "cutting demonstrate --record {cut}/cuts.json --out out --image-width 300",
        code=3,
        given=empty_recording,
        right=two_trials,
    ),
    Tried(
        "stages/cutting/methods.py",
        "scenewright cutting learn",
        f"{DEMONSTRATED} --method bc",
        "cutting learn --methods bc --demonstrations {cut}/demonstrations --out model --dry-run",
    ),
    Tried(
        "stages/cutting/simulate_stage.py",
        "the plan's goal is words",
        f"{SIMULATING} --plan {{golden}}/cutting_plan --method bc",
        f"{SIMULATING} --plan {{golden}}/cutting_plan --method ours",
    ),
]
