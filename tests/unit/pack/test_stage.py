"""The step: its files, the same bytes twice, problems of the user's own and what is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.packing import Packing, PackingFile
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.pack.arm import FixedArm
from scenewright.stages.pack.parameters import STAGE, PackParameters, Suite
from scenewright.stages.pack.problem_file import from_file, read_problem, to_file
from scenewright.stages.pack.stage import run

from benchmarks.experiments.llm3.arms import HARD, PUBLISHED
from tests.unit.language.stub_server import replies, serving, status

PROBLEM: dict[str, Any] = {
    "boxes": [
        {"name": "tin", "width": 0.08, "length": 0.06, "height": 0.1, "x": 0.4, "y": -0.2},
        {"name": "carton", "width": 0.12, "length": 0.09, "height": 0.05, "x": 0.42, "y": 0.25, "yaw": 0.3},
    ],
    "basket": {"low": [0.55, -0.08], "high": [0.75, 0.08]},
}


def pack(folder: Path, problem: Path | None = None, **options: Any) -> Packing:
    folder.mkdir()
    context = Context(output=folder, seed=0, device="cpu", progress=SilentProgress())
    return run(problem, None, parameters=PackParameters(**({"image_width": 240} | options)), context=context)


def test_the_step_writes_the_same_bytes_twice(tmp_path: Path) -> None:
    results = [pack(tmp_path / name, suite="hard/unreachable", instance=1) for name in ("a", "b")]
    assert results[0].outcome == "ok" and results[0].info.success
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert {"packing.json", "instance.json", "plan.txt", "trajectory.npz", "layout.png", "scene.png"} <= set(names)
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    with np.load(tmp_path / "a" / "trajectory.npz", allow_pickle=False) as arrays:
        actions = sum(len(attempt.steps) for attempt in results[0].info.attempts[-1:])
        assert arrays["joints"].shape == (len(arrays["action"]), 7)
        assert set(arrays["action"].tolist()) == set(range(actions))


def test_the_usual_arm_packs_as_it_ever_did(tmp_path: Path) -> None:
    """Beside the golden packing: the same plans, reasons and joint values."""
    golden = Path(__file__).resolve().parents[2] / "golden" / "v1" / "packing"
    packed = pack(tmp_path / "again", suite="hard/obstacles", instance=2)
    assert packed.info == PackingFile.read(golden / "packing.json")
    assert packed.path("plan.txt").read_text() == (golden / "plan.txt").read_text()
    with (
        np.load(golden / "trajectory.npz", allow_pickle=False) as old,
        np.load(tmp_path / "again" / "trajectory.npz", allow_pickle=False) as new,
    ):
        np.testing.assert_array_equal(new["action"], old["action"])
        np.testing.assert_allclose(new["joints"], old["joints"], atol=1e-9)


def test_another_arm_packs_the_same_problem(tmp_path: Path) -> None:
    packed = pack(tmp_path / "a", suite="published/easy", robot="xarm7")
    assert packed.outcome == "ok" and packed.info.robot == "xarm7"
    with np.load(tmp_path / "a" / "trajectory.npz", allow_pickle=False) as arrays:
        assert arrays["joints"].shape == (len(arrays["action"]), 7) and len(arrays["action"]) > 50


def test_a_problem_of_ones_own_and_one_without_a_solution(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(PROBLEM))
    solved = pack(tmp_path / "a", path)
    assert solved.outcome == "ok" and solved.info.name == "mine"
    path.write_text(json.dumps(PROBLEM | {"basket": {"low": [0.55, -0.03], "high": [0.63, 0.03]}}))
    unsolved = pack(tmp_path / "b", path, iterations=2)
    assert unsolved.outcome == "not_packed" and not unsolved.info.success
    assert "not packed" in (tmp_path / "b" / "plan.txt").read_text()


def test_the_scripted_stand_in_is_recorded(tmp_path: Path) -> None:
    result = pack(tmp_path / "a", proposer="backtrack")
    assert result.info.proposer_calls >= 1 and (tmp_path / "a" / "transcript.jsonl").stat().st_size > 0


def test_a_model_that_never_answered_ends_the_step_and_one_that_stopped_leaves_what_there_is(tmp_path: Path) -> None:
    asked: dict[str, Any] = {"proposer": "scratch", "language": "openai", "model": "stub", "retries": 0}
    with serving(status(401)) as server, pytest.raises(LanguageFailed) as failed:
        pack(tmp_path / "a", base_url=server.base_url, **asked)
    assert failed.value.exit_code == BadInput.exit_code and not (tmp_path / "a" / "packing.json").exists()
    with serving(replies({"reasoning": "", "plan": []}), status(401)) as server:
        result = pack(tmp_path / "b", base_url=server.base_url, **asked)
    assert result.outcome == "not_packed" and len(result.info.attempts) == 1
    assert result.info.stopped is not None and result.info.stopped.kind == "refused"
    assert len((tmp_path / "b" / "transcript.jsonl").read_text().splitlines()) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"boxes": []}, "boxes"),
        ({"basket": {"low": [0.5, 0.0], "high": [0.5, 0.2]}}, "basket"),
        ({"boxes": [PROBLEM["boxes"][0], PROBLEM["boxes"][0]]}, "tin"),
        ({"boxes": [PROBLEM["boxes"][0] | {"width": -1}]}, "width"),
        ({"boxes": [PROBLEM["boxes"][0] | {"x": 1.2}]}, "tin cannot be picked where it starts"),
        ({"boxes": [PROBLEM["boxes"][0], PROBLEM["boxes"][1] | {"x": 0.41, "y": -0.2}]}, "start"),
        ({"basket": {"low": [-0.6, -0.1], "high": [-0.5, 0.1]}}, "basket: places are within"),
        ({"surprise": 1}, "surprise"),
        ({"boxes": [PROBLEM["boxes"][0] | {"name": "../x"}]}, "name"),
    ],
)
def test_wrong_problems_are_refused_in_one_line(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(PROBLEM | change))
    with pytest.raises(BadInput) as refused:
        read_problem(path, FixedArm())
    assert said in str(refused.value) and "\n" not in str(refused.value) and refused.value.hint


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_a_problem_or_bad_input(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("problem") / "p.json"
    path.write_bytes(data)
    with pytest.raises(BadInput):
        read_problem(path, FixedArm())


def test_a_problem_is_the_same_after_a_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(PROBLEM))
    instance = read_problem(path, FixedArm())
    assert from_file(to_file(instance), "mine") == instance


def test_the_declaration_names_every_suite_and_refuses_idle_transcripts() -> None:
    assert set(get_args(Suite)) == {*PUBLISHED, *HARD}
    assert STAGE.check is not None
    with pytest.raises(UsageError):
        STAGE.check(PackParameters(), {"transcript": Path("t.jsonl")})
    STAGE.check(PackParameters(proposer="symbolic"), {"transcript": Path("t.jsonl")})
