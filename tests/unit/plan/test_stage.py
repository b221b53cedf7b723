"""The whole step in the handmade kitchen: executed in physics, the same bytes twice, reasons when it cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.plan import Plan
from scenewright.stages.ingest.messages.mcap_log import McapLog
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.plan.parameters import PlanParameters
from scenewright.stages.plan.stage import run

from tests.unit.simulation.handmade_scene import HandmadeBody, kitchen, write_scene


def plan(
    tmp_path: Path,
    scene: Path,
    ground_truth: Path | None = None,
    name: str = "plan",
    domain: Path | None = None,
    **options,
) -> Plan:
    output = tmp_path / name
    output.mkdir()
    options = {"image_width": 96, "video_rate": 0.2} | options
    return run(
        InteractiveScene(root=scene),
        None if ground_truth is None else GroundTruth(root=ground_truth),
        domain,
        parameters=PlanParameters(**options),
        context=Context(output=output, seed=0, device="cpu", progress=SilentProgress()),
    )


def shifted(bodies: list[HandmadeBody], offsets: dict[str, tuple[float, float, float]]) -> list[HandmadeBody]:
    for body in bodies:
        body.world_from_body[:3, 3] += offsets.get(body.name, (0.0, 0.0, 0.0))
    return bodies


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    """Planned in a scene that is centimetres off, executed in the true one."""
    root = tmp_path_factory.mktemp("executed")
    write_scene(root / "truth" / "room", kitchen())
    (root / "truth" / "graph.json").write_bytes((root / "truth" / "room" / "graph.json").read_bytes())
    offsets = {
        "bottle_7": (0.03, -0.02, 0.004),
        "table_3": (-0.02, 0.03, -0.015),
        "fridge_2": (0.02, 0.015, 0.0),
        "cup_5": (-0.02, 0.03, -0.015),
    }
    write_scene(root / "scene", shifted(kitchen(1.5), offsets))
    return plan(root, root / "scene", root / "truth")


def test_the_bottle_ends_on_the_table_and_the_door_is_shut(executed: Plan) -> None:
    found = executed.info
    assert executed.outcome == "ok", found.failures
    assert found.status == "executed"
    assert (found.planned_in, found.executed_in) == ("reconstructed", "ground_truth")
    assert found.goal == ("on(bottle_7, table_3)", "closed(fridge_2)")
    assert [check.condition for check in found.checks] == list(found.goal)
    assert all(check.holds for check in found.checks)
    on, shut = found.checks
    assert on.numbers["height"] == pytest.approx(0.75, abs=0.01)  # of the true table, not of the planned one
    assert on.numbers["speed"] < 0.02
    assert shut.numbers["fridge_2__hinge"] < 0.1
    names = [action.name for action in found.actions]
    assert names[:4] == ["drive", "pick", "drive", "place"] and names[-1] == "close"
    assert {match.body for match in found.matches} == {"bottle_7", "fridge_2", "table_3"}
    assert all(match.matched == match.body and match.distance < 0.06 for match in found.matches)
    assert any("saw pose" in text for text in found.assumptions)


def test_every_file_of_the_kind_is_there(executed: Plan) -> None:
    for name in (
        "plan.json",
        "domain.pddl",
        "problem.pddl",
        "plan.txt",
        "trajectory.npz",
        "execution.mcap",
        "graph.json",
    ):
        assert executed.path(name).stat().st_size > 100, name
    assert len(list(executed.path("keyframes").glob("*.png"))) >= 8
    text = executed.path("plan.txt").read_text()
    assert "yes on(bottle_7, table_3)" in text


def test_the_trajectory_is_continuous_and_covers_the_actions(executed: Plan) -> None:
    with np.load(executed.path("trajectory.npz"), allow_pickle=False) as arrays:
        rows = len(arrays["time"])
        assert arrays["joints"].shape == (rows, 9)
        assert arrays["world_from_base"].shape == (rows, 4, 4)
        assert np.abs(np.diff(arrays["joints"][:, :7], axis=0)).max() < 0.2
        assert np.abs(np.diff(arrays["world_from_base"][:, :2, 3], axis=0)).max() < 0.06
        ranges = [(action.start, action.end) for action in executed.info.actions]
        assert ranges[0][0] == 0 and ranges[-1][1] == rows
        assert all(end == start for (_, end), (start, _) in zip(ranges, ranges[1:], strict=False))
        executed_time = arrays["executed_time"]
        assert np.all(np.diff(executed_time) >= 0) and executed_time[-1] > 20


def test_the_graph_says_where_the_bottle_is_now(executed: Plan) -> None:
    graph = ContactGraphFile.read(executed.path("graph.json"))
    link = graph.parent_link("bottle_7")
    assert link is not None
    assert (link.source, link.relation) == ("table_3", "supports")
    box = graph.node("bottle_7").box
    assert box is not None
    assert box.center[0] < -0.5 and box.center[2] == pytest.approx(0.85, abs=0.03)
    assert graph.node("fridge_2").joints["hinge"] < 0.1
    assert graph.parent_link("cup_5").source == "table_3"  # type: ignore[union-attr]


def test_the_log_reads_back(executed: Plan) -> None:
    with McapLog(executed.path("execution.mcap")) as log:
        topics = {message.channel.topic for message in log.messages()}
    assert topics == {"/tf", "/camera/color", "/camera/calibration"}


@pytest.mark.slow
def test_open_loop_replay_of_an_exact_scene_and_the_same_bytes_twice(tmp_path: Path) -> None:
    write_scene(tmp_path / "scene", kitchen())
    with pytest.raises(UsageError, match="needs a"):
        plan(tmp_path, tmp_path / "scene", goal=("on(fridge_2, cup_5)",), name="wrong")
    outputs = []
    for name in ("first", "second"):
        result = plan(tmp_path, tmp_path / "scene", name=name, relocalize=False, goal=("holding(cup_5)",))
        assert result.outcome == "ok", result.info.failures
        assert result.info.executed_in == "reconstructed"
        outputs.append(
            {p.relative_to(result.root): p.read_bytes() for p in sorted(result.root.rglob("*")) if p.is_file()}
        )
    assert outputs[0] == outputs[1]


def test_an_impossible_goal_is_a_complete_artifact_with_a_named_reason(tmp_path: Path) -> None:
    write_scene(tmp_path / "scene", kitchen())
    result = plan(tmp_path, tmp_path / "scene", goal=("on(bottle_7, table_3)", "in(bottle_7, fridge_2)"))
    assert result.outcome == "infeasible"
    assert result.info.status == "infeasible" and result.info.actions == ()
    last = result.info.failures[-1]
    assert last.kind == "goal_unsatisfiable"
    assert {"bottle_7", "table_3", "fridge_2"} <= set(last.objects)
    assert "not all together" in last.message
    assert result.summary["reason"] == f"{last.kind}: {last.message}; `scenewright explain PLAN outcome` says all"
    for name in ("plan.json", "domain.pddl", "problem.pddl", "plan.txt", "trajectory.npz", "graph.json"):
        assert result.path(name).exists(), name


def test_a_scene_without_anything_to_fetch_says_so(tmp_path: Path) -> None:
    write_scene(tmp_path / "scene", [body for body in kitchen() if body.name != "bottle_7"])
    result = plan(tmp_path, tmp_path / "scene")
    assert result.outcome == "infeasible"
    assert result.info.failures[-1].kind == "no_goal"
    assert result.info.failures[-1].numbers == {"items_inside": 0.0, "tables": 1.0}


def test_an_item_that_is_not_there_fails_the_execution_by_name(tmp_path: Path) -> None:
    write_scene(tmp_path / "scene", kitchen())
    truth = [body for body in kitchen() if body.name != "bottle_7"]
    write_scene(tmp_path / "truth" / "room", truth)
    (tmp_path / "truth" / "graph.json").write_bytes((tmp_path / "truth" / "room" / "graph.json").read_bytes())
    result = plan(tmp_path, tmp_path / "scene", tmp_path / "truth", execution_attempts=1, video_rate=0)
    assert result.outcome == "execution_failed"
    kinds = [failure.kind for failure in result.info.failures]
    assert "not_found" in kinds and kinds[-1] == "condition_not_met"
    missing = next(failure for failure in result.info.failures if failure.kind == "not_found")
    assert missing.objects == ("bottle_7",)
    assert not result.info.checks[0].holds


def test_a_robot_that_would_start_inside_something_unseen_does_not_start(tmp_path: Path) -> None:
    """The true room is full of a crate that the planned scene does not show."""
    write_scene(tmp_path / "scene", kitchen())
    crate = HandmadeBody("bin_9", "bin", np.eye(4), [((0.0, 0.0, 0.2), (4.9, 4.9, 0.4))], "floor_1")
    write_scene(tmp_path / "truth" / "room", [kitchen()[0], crate])
    (tmp_path / "truth" / "graph.json").write_bytes((tmp_path / "truth" / "room" / "graph.json").read_bytes())
    result = plan(tmp_path, tmp_path / "scene", tmp_path / "truth", video_rate=0)
    assert result.outcome == "execution_failed"
    failure = next(entry for entry in result.info.failures if entry.kind == "start_in_collision")
    assert failure.objects == ("bin_9",)
    assert failure.numbers["depth"] > 0.005


def test_an_arm_that_does_not_drive_takes_what_it_reaches_from_where_it_stands(tmp_path: Path) -> None:
    write_scene(tmp_path / "scene", kitchen())
    with pytest.raises(UsageError, match="does not drive"):
        plan(tmp_path, tmp_path / "scene", name="nowhere", robot="ur5_bench", goal=("holding(cup_5)",))
    fixed = {"robot": "ur5_bench", "goal": ("holding(cup_5)",), "video_rate": 0.0}
    near = plan(tmp_path, tmp_path / "scene", name="near", stand=(-1.3, -0.1, -90.0), **fixed).info
    assert near.status == "executed", near.failures
    assert [action.name for action in near.actions] == ["pick"]
    far = plan(tmp_path, tmp_path / "scene", name="far", stand=(0.5, -1.0, 180.0), **fixed).info
    assert far.status == "infeasible" and far.failures
