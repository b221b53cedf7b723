"""Motion primitives, wound, thread, jaws, perception model, state machine and the trials' tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.suture_trial import SutureRun
from scenewright.stages.suture.evaluation.trial_figures import metrics, table
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.constants import OpenConstants, cinch_length
from scenewright.stages.suture.motion.needle import SWAGE, TIP, from_ends, point_at, turned, upright
from scenewright.stages.suture.rig import NEEDLE_RADIUS
from scenewright.stages.suture.robot.arms import ARMS
from scenewright.stages.suture.trials.belief import START_ANGLE, as_planned, believed
from scenewright.stages.suture.trials.bench import CORNER, HOME, Bench, loaded
from scenewright.stages.suture.trials.drawing import draw_strip, whole_suture
from scenewright.stages.suture.trials.gripping import close
from scenewright.stages.suture.trials.machine import Outcome, run_trial
from scenewright.stages.suture.trials.ours.extraction import grasp_point, left_to_turn
from scenewright.stages.suture.trials.ours.handover import middle, turned_about
from scenewright.stages.suture.trials.ours.pose_correction import fused, in_driver
from scenewright.stages.suture.trials.perception import (
    FOLDER,
    Errors,
    Eyes,
    PerceptionModel,
    Seen,
    Shares,
    farther_end,
    nearer_end,
    perception_model,
)
from scenewright.stages.suture.trials.places import GRASPING
from scenewright.stages.suture.trials.policies import POLICIES, THESIS
from scenewright.stages.suture.trials.recording import Recorder
from scenewright.stages.suture.trials.rope import PARTICLES, drape, line, winding
from scenewright.stages.suture.trials.settings import World
from scenewright.stages.suture.trials.thesis.handover import NormalUnchanged
from scenewright.stages.suture.trials.thread import Thread, draw, pull_on, pull_through
from scenewright.stages.suture.trials.wound import CHORD, HOLE_HEIGHT, entry, exit_, passage

STILL_WORLD = World(
    thread_shortest=0.30,
    thread_longest=0.30,
    loading_normal=0,
    loading_in_plane=0,
    hand_eye=0,
    closing_normal=0,
    closing_in_plane=0,
    insertion_slip=0,
    knock=0,
    knock_held=0,
    stitch_noise=0,
    sweep_height_noise=0,
)


def perfect(name: str = "ours") -> PerceptionModel:
    model = perception_model(FOLDER / f"perception_{name}.toml")
    every = Shares(corner_left=1, corner_right=1, elsewhere=1, tissue=1)
    return model.model_copy(
        update={
            "right_share": every,
            "right": Errors(normal_degrees=0.01, end_millimetres=0.01),
            "thread_length_error": 0.0,
        }
    )


def nominal_needle(suture: int) -> np.ndarray:
    """Return the pose (4, 4) of a needle that is ready for insertion as planned, its tip at the entry."""
    centre = (entry(suture) + exit_(suture)) / 2.0
    centre = np.array([centre[0] - CHORD, centre[1], HOLE_HEIGHT + NEEDLE_RADIUS * np.cos(START_ANGLE)])
    needle = upright(centre, START_ANGLE)
    return needle


def insertion_of(needle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tips and directions along the insertion of suture 0 that is planned for the nominal needle."""
    nominal = nominal_needle(0)
    tool = HOME["right"]
    path = primitives.insertion(tool, exit_(0) - entry(0), nominal[:3, 2], nominal[:3, 3])
    needles = path @ np.linalg.inv(tool) @ needle
    return needles[:, :3, :3] @ TIP + needles[:, :3, 3], -needles[:, :3, 1]


def test_insertion_turns_by_45_degrees_about_the_normal_after_the_push() -> None:
    tips, directions = insertion_of(nominal_needle(0))
    assert np.allclose(tips[primitives.STEPS - 1], exit_(0), atol=1e-12)
    angle = np.arccos(directions[-1] @ directions[0])
    assert np.isclose(np.degrees(angle), 45.0)
    centre = nominal_needle(0)[:3, 3] + exit_(0) - entry(0)
    assert np.allclose(np.linalg.norm(tips[primitives.STEPS :] - centre, axis=1), NEEDLE_RADIUS)
    assert tips[-1, 2] > tips[primitives.STEPS, 2]


def test_45_degrees_of_the_needle_span_entry_and_exit() -> None:
    assert np.isclose(np.linalg.norm(exit_(0) - entry(0)), CHORD)
    pushed = nominal_needle(2)
    assert np.allclose(point_at(pushed, 0.0), entry(2), atol=1e-9)
    pushed[:3, 3] += exit_(2) - entry(2)
    assert np.allclose(point_at(pushed, 0.0), exit_(2), atol=1e-9)
    assert np.allclose(point_at(pushed, np.pi / 4), entry(2), atol=1e-9)


@pytest.mark.parametrize(
    ("shift", "tilt", "fault"),
    [
        ([0, 0, 0], 0.0, None),
        ([0, 0, -0.003], 0.0, "not the wound"),
        ([0, 0.004, 0], 0.0, "not the wound"),
        ([0, 0, 0.006], 0.0, "missed"),
        ([0, 0, 0], 40.0, "slid off"),
        ([0, 0, 0.0015], -12.0, None),
    ],
)
def test_what_a_tip_path_comes_to(shift: list[float], tilt: float, fault: str | None) -> None:
    needle = nominal_needle(0)
    needle[:3, 3] += shift
    tip = point_at(needle, 0.0)
    needle = turned(needle, np.array([0.0, 1.0, 0.0]), -np.radians(tilt), tip)
    found = passage(*insertion_of(needle), 0)
    assert (found.fault is None) if fault is None else (found.fault is not None and fault in found.fault)


def test_extraction_approaches_from_a_centimetre_and_advances_by_one_and_a_half() -> None:
    point = np.array([0.011, 0.0, 0.008])
    path = primitives.approach(point, GRASPING, 0.015)
    assert np.isclose(np.linalg.norm(path[0, :3, 3] - point), 0.010)
    assert np.isclose(path[0, 2, 3], path[-1, 2, 3])
    assert np.isclose(np.linalg.norm(path[-1, :3, 3] - path[0, :3, 3]), 0.015)
    turn = primitives.rotating_out(path[-1], np.array([0.0, 1.0, 0.0]), np.zeros(3))
    cosine = (np.trace(turn[-1, :3, :3] @ turn[0, :3, :3].T) - 1) / 2
    assert np.isclose(np.degrees(np.arccos(cosine)), 80.0)


def test_cinch_length_is_the_thesis_formula() -> None:
    constants = OpenConstants(desired_length=0.1, length_each=0.02)
    assert [round(cinch_length(k, constants), 6) for k in range(6)] == [0.1, 0.08, 0.06, 0.04, 0.02, 0.0]


def test_extraction_takes_the_nearer_end_and_handover_the_farther_one() -> None:
    seen = Seen(np.array([0.0, 1.0, 0.0]), np.array([0.01, 0, 0]), np.array([-0.01, 0, 0]), True)
    left = np.array([0.05, 0.0, 0.05])
    assert nearer_end(seen, left) is seen.tip
    assert farther_end(seen, left) is seen.swage


def test_normal_to_y_and_the_final_turn() -> None:
    normal = np.array([0.3, 0.9, -0.2]) / np.linalg.norm([0.3, 0.9, -0.2])
    after = primitives.normal_to_y(CORNER, normal)
    assert np.allclose(after[:3, :3] @ CORNER[:3, :3].T @ normal, [0, 1, 0])
    assert np.allclose(after[:3, 3], CORNER[:3, 3])
    assert np.allclose(primitives.final_turn(CORNER)[-1][:3, 2], [0.0, 0.0, -1.0])


def test_both_arms_reach_home_corner_and_wound() -> None:
    assert all(ARMS[name].reaches(pose) for name, pose in HOME.items())
    assert ARMS["right"].reaches(CORNER)
    far = CORNER.copy()
    far[0, 3] += 0.2
    assert not ARMS["right"].reaches(far)


def test_a_hanging_rope_keeps_its_length_and_stays_off_pad_and_driver() -> None:
    start, end = np.array([-0.03, 0.02, 0.03]), np.array([0.03, 0.02, 0.03])
    points, steps, length = line(start, end), 150, 0.12
    capsules = np.zeros((steps, 1, 7))
    capsules[:, 0, :3], capsules[:, 0, 3:6], capsules[:, 0, 6] = [-0.02, 0.0, 0.012], [-0.02, 0.05, 0.012], 0.004
    rest = np.linspace(0.06, length, steps)
    drape(points, rest, np.tile(start, (steps, 1)), np.tile(end, (steps, 1)), True, capsules, 0.005, 0.005)
    assert np.allclose(points[[0, -1]], [start, end])
    assert np.isclose(np.linalg.norm(np.diff(points, axis=0), axis=1).sum(), length, rtol=0.05)
    inner = points[1:-1]
    assert inner[:, 2].min() > -1e-4
    assert ((inner[:, 0] / 0.005) ** 2 + (inner[:, 2] / 0.005) ** 2).min() > 0.9
    assert np.hypot(inner[:, 0] + 0.02, inner[:, 2] - 0.012).min() > 0.0035


def test_crossing_threads_lie_on_each_other() -> None:
    angle = np.linspace(0, 2 * np.pi, PARTICLES)
    points = np.column_stack([0.02 * np.cos(angle), 0.02 * np.sin(2 * angle), 0.01 + 0 * angle])
    points[:, 2] += 1e-5 * np.sin(angle)
    steps = 30
    rest = np.full(steps, np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    ends = np.tile(points[0], (steps, 1)), np.tile(points[-1], (steps, 1))
    drape(points, rest, *ends, True, np.zeros((steps, 1, 7)), 0.005, 0.005)
    quarter, three = PARTICLES // 4, 3 * PARTICLES // 4
    gaps = np.linalg.norm(points[quarter - 4 : quarter + 4, None] - points[None, three - 4 : three + 4], axis=2)
    assert gaps.min() > 1.5e-4


def test_winding_counts_turns() -> None:
    angle = np.linspace(0, 3 * np.pi, PARTICLES)
    helix = np.column_stack([0.005 * np.cos(angle), 0.005 * np.sin(angle), np.linspace(0.002, 0.02, PARTICLES)])
    assert np.isclose(winding(helix, np.zeros(3), np.array([0.0, 0.0, 1.0])), 1.5, atol=0.05)
    assert winding(helix + [0.02, 0, 0], np.zeros(3), np.array([0.0, 0.0, 1.0])) < 0.2


def test_thread_is_neither_made_nor_lost() -> None:
    world, thread, used, loose = World(), Thread(0.30), 0.0, 0.0
    for suture, distance in enumerate((0.10, 0.08, 0.09, 0.05)):
        assert not pull_through(thread, suture, distance, 10.0, 0.0, world).lost
        used += thread.used_by(suture, 0.0)
        loose += thread.slack
        assert np.isclose(thread.working + thread.tail + used + loose, 0.30)
        assert np.isclose(thread.working, distance)
    assert loose > 0.01
    assert thread.through == 4


def test_thread_that_holds_is_short_and_one_that_ends_is_lost() -> None:
    world = World()
    thread = Thread(0.05, tail=0.10, through=4)
    assert np.isclose(draw(thread, 0.06, 0.1, world).short, 0.01)
    assert draw(thread, 0.30, 1e3, world).lost
    assert draw(thread, 0.06, 1e3, world).short == 0.0
    assert np.isclose(thread.tail, 0.09)


def test_jaws_catch_flatten_and_miss() -> None:
    world, random = STILL_WORLD, np.random.default_rng(0)
    needle = upright(np.array([0.0, 0.0, 0.02]), np.radians(67.5))
    path = primitives.approach(point_at(needle, 0.0), GRASPING, 0.015)
    tilted = turned(needle, np.array([1.0, 0.0, 0.0]), np.radians(15.0), point_at(needle, 0.0))
    closing = close(path[-1], tilted, world, random)
    assert closing.caught is not None and 0.3 < closing.quality < 1.0
    away = path[-1].copy()
    away[1, 3] += 0.01
    assert close(away, needle, world, random).caught is None


def test_estimates_are_as_often_right_as_the_model_says() -> None:
    model = perception_model(FOLDER / "perception_thesis.toml")
    eyes = Eyes(model, np.random.default_rng(5))
    random = np.random.default_rng(6)
    errors = []
    for _ in range(1500):
        needle = upright(random.standard_normal(3), 0.3)
        seen = eyes.look(needle, "corner_right")
        assert seen is not None
        if seen.right:
            errors.append(seen.tip - point_at(needle, 0.0))
    assert abs(eyes.right / eyes.looks - 0.70) < 0.04
    assert np.isclose(np.std(errors), model.right.end_millimetres / 1000, rtol=0.1)


def test_ends_that_are_taken_for_each_other_do_not_stray() -> None:
    model = perfect()
    never = Shares(corner_left=0, corner_right=0, elsewhere=0, tissue=0)
    swaps = model.right.model_copy(update={"swapped_share": 1.0})
    eyes = Eyes(
        model.model_copy(update={"right_share": never, "abstained_share": never, "wrong": swaps}),
        np.random.default_rng(1),
    )
    needle = upright(np.zeros(3), 0.3)
    seen = eyes.look(needle, "tissue")
    assert seen is not None and not seen.right
    assert np.allclose(seen.tip, point_at(needle, np.pi), atol=1e-4) and seen.normal @ needle[:3, 2] < -0.99


def test_a_needle_that_stays_shares_its_error() -> None:
    model = perception_model(FOLDER / "perception_thesis.toml").model_copy(
        update={"persistence": 1.0, "systematic": 1.0}
    )
    eyes = Eyes(model, np.random.default_rng(1))
    needle = upright(np.zeros(3), 0.3)
    first, second = eyes.look(needle, "elsewhere"), eyes.look(needle, "elsewhere")
    assert first is not None and second is not None
    assert np.allclose(first.tip, second.tip)


def test_ends_and_normal_give_the_pose() -> None:
    needle = upright(np.array([0.01, 0.02, 0.03]), 1.1)
    ends = needle[:3, :3] @ np.column_stack([TIP, SWAGE]) + needle[:3, 3:4]
    assert np.allclose(from_ends(needle[:3, 2], ends[:, 0], ends[:, 1]), needle)


@pytest.mark.parametrize("text", ["", "name = 'x'", "[[", "name = 'x'\nright_share = 3"])
def test_a_file_that_is_no_perception_model(tmp_path: Path, text: str) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match=r"model\.toml: (no perception model|Invalid)") as caught:
        perception_model(path)
    assert "perception_thesis.toml" in str(caught.value.hint)


@pytest.mark.parametrize(("arm", "length"), [("thesis", 0.30), ("ours", 0.30), ("ours", 0.22), ("ours", 0.40)])
def test_without_errors_six_sutures_close_the_wound(arm: str, length: float) -> None:
    policy = replace(POLICIES[arm], constants=replace(POLICIES[arm].constants, desired_length=0.115))
    world = replace(STILL_WORLD, hold=20.0, thread_shortest=length, thread_longest=length)
    outcome = run_trial(policy, 0, world, perfect())
    assert outcome.errors == []
    assert outcome.sutures == outcome.sutures_neutral == outcome.attempts == 6
    assert outcome.stopped_short == 0


def bench_holding(recorder: Recorder | None = None) -> Bench:
    """A bench whose right driver holds the needle in the corner."""
    needle, hold = loaded(STILL_WORLD, np.random.default_rng(0))
    eyes = Eyes(perfect(), np.random.default_rng(1))
    bench = Bench(STILL_WORLD, eyes, np.random.default_rng(2), np.zeros(3), Thread(0.3), needle, hold, recorder)
    bench.tools["right"] = CORNER.copy()
    return bench


def shifted(pose: np.ndarray, *metres: float) -> np.ndarray:
    moved = pose.copy()
    moved[:3, 3] += metres
    return moved


def test_each_driver_has_its_clock() -> None:
    recorder = Recorder()
    ours, thesis = POLICIES["ours"].coordination, POLICIES["thesis"].coordination
    bench = bench_holding(recorder)
    ours.wait_at(bench, "left", shifted(HOME["left"], 0.0, 0.0, -0.014))
    assert bench.seconds == 0.0
    bench.record("under way")
    bench.go("right", shifted(CORNER, 0.007, 0.0, 0.0))
    assert np.isclose(bench.seconds, 1.0)
    bench.go("left", HOME["left"])
    assert np.isclose(bench.seconds, 4.0)
    motions = recorder.motions()
    assert (np.diff(motions["seconds"]) >= 0).all() and np.isclose(motions["seconds"][-1], 4.0)
    swages = motions["world_from_needle"][:, :3, 3]
    assert (np.diff(swages[:, 0]) >= -1e-12).all() and np.isclose(np.ptp(swages[:, 0]), 0.007)
    assert np.linalg.norm(recorder.tools[0][1][:3, 3] - HOME["left"][:3, 3]) < 0.004
    other = bench_holding()
    thesis.wait_at(other, "left", shifted(HOME["left"], 0.0, 0.0, -0.014))
    assert np.allclose(other.tools["left"], HOME["left"])
    thesis.withdraw(other, "left", shifted(HOME["left"], 0.0, 0.0, -0.014))
    assert np.isclose(other.seconds, 2.0)


def test_a_needle_seen_where_it_cannot_be_is_not_believed() -> None:
    away = np.array([[0.05, 0.05, 0.05]])
    for arm, trusted in (("ours", False), ("thesis", True)):
        bench, trust = bench_holding(), POLICIES[arm].trust
        assert (trust.look(bench, "corner_right", away) is not None) is trusted
        assert trust.look(bench, "corner_right", bench.jaws("right")) is not None


def test_a_turn_that_was_cut_short_is_finished() -> None:
    def seen(turned_out: float) -> Seen:
        needle = upright(np.zeros(3), np.radians(22.5 + 45.0 + turned_out))
        return Seen(needle[:3, 2], point_at(needle, 0.0), point_at(needle, np.pi), True)

    assert np.allclose(np.degrees([left_to_turn(seen(angle)) for angle in (0.0, 30.0, 79.0)]), [80.0, 50.0, 10.0])
    inwards = grasp_point(seen(0.0), 0.3)
    assert np.isclose(np.linalg.norm(inwards), NEEDLE_RADIUS)
    assert np.isclose(np.linalg.norm(inwards - seen(0.0).tip), 2 * NEEDLE_RADIUS * np.sin(0.15))


def test_jaws_that_hold_turn_normal_and_end() -> None:
    holder, up = np.array([0.02, 0.0, 0.04]), np.array([0.0, 0.0, 1.0])
    needle = upright(np.array([0.008, 0.0, 0.04]), 1.2)

    def seen(pose: np.ndarray, sign: float = 1.0) -> Seen:
        return Seen(sign * pose[:3, 2], point_at(pose, 0.0), point_at(pose, np.pi), True)

    after = turned(needle, up, np.radians(15.0), holder)
    assert np.allclose(np.degrees(turned_about(seen(needle), seen(after, -1.0), holder)), 15.0)
    strange = Seen(np.array([0.0, 0.0, 1.0]), *(np.full(3, 9.0),) * 2, False)
    held = middle([seen(needle), strange, seen(needle, -1.0)])
    assert np.allclose(held.normal, needle[:3, 2]) and np.allclose(held.tip, point_at(needle, 0.0))


def test_looks_from_several_poses_count_together() -> None:
    needle, hold = loaded(STILL_WORLD, np.random.default_rng(0))
    kept = []
    for error, turn in ((0.001, 0.0), (-0.001, 0.4)):
        tool = turned(CORNER, np.array([0.0, 1.0, 0.0]), turn, CORNER[:3, 3])
        pose = tool @ hold.grip
        offset = tool[:3, :3] @ np.array([0.0, 0.0, error])
        look = Seen(pose[:3, 2], point_at(pose, 0.0) + offset, point_at(pose, np.pi) + offset, True)
        kept.append(in_driver([look] * 3, tool))
    normal, far, near = fused(kept, CORNER)
    assert np.allclose(normal, needle[:3, 2]) and np.allclose(far, point_at(needle, 0.0))
    assert np.allclose(near, point_at(needle, np.pi))


def test_the_needle_is_expected_where_its_insertion_was_planned() -> None:
    nominal, tool = nominal_needle(1), HOME["right"]
    ends = point_at(nominal, 0.0), point_at(nominal, np.pi)
    belief = believed(tool, tool[:3, :3], nominal[:3, 2], ends)
    path = primitives.insertion(tool, exit_(1) - entry(1), nominal[:3, 2], nominal[:3, 3])
    after = path[-1] @ np.linalg.inv(tool) @ nominal
    expected = as_planned(belief, path[-1])
    assert np.allclose(expected.pose, after)
    assert np.isclose(left_to_turn(expected), np.radians(80.0))


def test_pulling_on_takes_slack_before_tail() -> None:
    world, thread = World(), Thread(0.06, tail=0.10, slack=0.008, through=2)
    assert pull_on(thread, 0.005, 10.0, world).short == 0.0
    assert np.allclose([thread.working, thread.slack, thread.tail], [0.065, 0.003, 0.10])
    assert pull_on(thread, 0.005, 10.0, world).short == 0.0
    assert np.allclose([thread.working, thread.slack, thread.tail], [0.070, 0.0, 0.098])
    assert np.isclose(pull_on(thread, 0.005, 0.1, world).short, 0.005)


def test_both_readings_of_the_handover_test() -> None:
    ends = np.array([0.01, 0, 0]), np.array([-0.01, 0, 0])
    still = Seen(np.array([0.0, 1.0, 0.0]), *ends, True)
    turned_by_30 = Seen(np.array([0.5, np.sqrt(0.75), 0.0]), *ends, True)
    flipped = Seen(np.array([0.0, -1.0, 0.0]), *ends, True)
    used, other = THESIS.handover_test, NormalUnchanged()
    holder, constants = np.zeros(3), THESIS.constants
    for after, changed in ((still, False), (flipped, False), (turned_by_30, True)):
        assert used.passed(still, after, holder, constants) is changed
        assert other.passed(still, after, holder, constants) is not changed


def test_a_trial_is_its_seed_and_ends_with_an_error_or_a_closed_wound() -> None:
    for seed in range(3):
        first, second = run_trial(POLICIES["thesis"], seed), run_trial(POLICIES["thesis"], seed)
        assert first == second
        assert first.closed != bool(first.errors)
        assert first.sutures_neutral <= first.sutures <= first.attempts


def test_a_supervised_trial_has_at_most_two_interventions() -> None:
    outcome = run_trial(POLICIES["thesis_supervised"], 1)
    assert len(outcome.errors) <= 3 and outcome.interventions <= 2
    assert outcome.closed or len(outcome.errors) == 3


def test_frames_are_recorded_and_drawn(tmp_path: Path) -> None:
    recorder = Recorder()
    run_trial(POLICIES["thesis"], 0, STILL_WORLD, perfect(), recorder)
    recorder.write(tmp_path / "frames.npz")
    with np.load(tmp_path / "frames.npz", allow_pickle=False) as frames:
        arrays = {name: frames[name] for name in frames.files}
    assert {"a: pushed in", "b: inserted", "c: swept", "e: turned out", "g: both hold", "k: 90 degrees about y"} <= set(
        arrays["panel"]
    )
    assert arrays["thread"].shape == (len(arrays["panel"]), PARTICLES, 3)
    assert draw_strip(tmp_path / "strip.png", arrays, suture=0, most=3) == 3
    assert (tmp_path / "strip.png").stat().st_size > 5000
    shown = [str(arrays["panel"][row])[0] for row in whole_suture(arrays)]
    assert "".join(dict.fromkeys(shown)) == "abcdefghijk" and shown == sorted(shown)
    few = {name: array[:3] for name, array in arrays.items()}
    assert list(whole_suture(few)) == [0, 1, 2]
    with pytest.raises(ValueError, match="no frame"):
        draw_strip(tmp_path / "none.png", arrays, suture=9)


def test_tables_count_as_they_say() -> None:
    def run(arm: str, seed: int, sutures: int, errors: str) -> SutureRun:
        return SutureRun(
            arm=arm,
            seed=seed,
            sutures=sutures,
            sutures_neutral=sutures,
            attempts=sutures + len(errors),
            seconds=100.0,
            errors=errors,
            reasons=("why",) * len(errors),
            interventions=0,
            looks=10,
            right=4,
            abstained=0,
            stopped_short=0,
            thread_length=0.3,
        )

    runs = [
        run("thesis", 1000, 3, "I"),
        run("thesis", 1001, 1, "E"),
        run("ours", 1000, 6, ""),
        run("ours", 1001, 4, "T"),
    ]
    figures = metrics(runs)
    assert figures["thesis/trials/sutures_to_failure"] == 2.0
    assert np.isclose(figures["thesis/trials/single_suture_rate"], 4 / 6, atol=1e-5)
    assert figures["thesis/trials/errors_i"] == figures["ours/trials/errors_t"] == 1.0
    assert figures["ours/trials/sutures_ratio"] == 2.5
    assert np.isclose(figures["ours/trials/seconds_ratio"], (200 / 11) / (200 / 6), atol=1e-5)
    assert np.isclose(figures["ours/trials/seconds_completed_ratio"], 0.4)
    assert figures["ours/trials/sutures_ratio_low"] == 2.0 and figures["ours/trials/sutures_ratio_high"] == 4.0
    assert "| ours / thesis | 2.50 [2.00, 4.00] |" in table(runs)
    assert figures["ours/trials/full_wound_rate"] == 0.5
    assert "| ours | T | why | 1 |" in table(runs) and "printed" not in table(runs)
    assert Outcome(sutures=6).closed
