"""What a log shows in two states becomes a joint; what merely comes, goes or stays becomes none."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.errors import BadInput
from scenewright.stages.articulate.parameters import ArticulateParameters
from scenewright.stages.articulate.stage import run
from scenewright.stages.fuse.outdated import Outdated
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.articulate.scenes import (
    CAMERA,
    FRONT,
    HIGH,
    WIDTH,
    block,
    depth_of,
    poses,
    with_door,
    with_drawer,
    write_sequence,
)


def articulated(folder, states, **options):
    sequence = write_sequence(folder / "sequence", states, **options)
    output = folder / "articulations"
    output.mkdir()
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(sequence, parameters=ArticulateParameters.model_validate({}), context=context)


def degrees(a, b):
    return np.degrees(np.arccos(np.clip(np.dot(a, b), -1, 1)))


@pytest.mark.parametrize(("first", "second"), [(0.0, 1.5), (0.0, 0.6), (1.9, 0.0), (0.4, 1.4)])
def test_a_door_turns_about_its_hinge(tmp_path, first, second):
    found = articulated(tmp_path, [with_door(first), with_door(second)])
    assert found.outcome == "ok"
    (door,) = found.info.articulations
    assert door.type == "revolute"
    assert degrees(door.axis, (0, 0, -np.sign(second - first))) < 1.0
    assert door.travel == pytest.approx(abs(second - first), abs=0.04)
    assert np.linalg.norm(np.subtract(door.origin, (0, FRONT, 0))[:2]) < 0.04
    assert door.last_before < 12 <= door.first_after
    assert door.overlap > 0.7


@pytest.mark.parametrize(("first", "second"), [(0.0, 0.3), (0.0, 0.1), (0.35, 0.0)])
def test_a_drawer_slides_along_the_normal_of_its_front(tmp_path, first, second):
    found = articulated(tmp_path, [with_drawer(first), with_drawer(second)])
    (drawer,) = found.info.articulations
    assert drawer.type == "prismatic"
    assert degrees(drawer.axis, (0, -np.sign(second - first), 0)) < 1.0
    assert drawer.travel == pytest.approx(abs(second - first), abs=0.01)


def test_a_door_and_a_drawer_are_two_joints(tmp_path):
    def both(angle, out):
        shift = np.array([0.9, 0.0, 0.0])
        return [*with_door(angle), *(mesh.copy().apply_translation(shift) for mesh in with_drawer(out)[:-4])] + [
            mesh.copy().apply_translation(shift) for mesh in with_drawer(out)[-5:]
        ]

    found = articulated(tmp_path, [both(0.0, 0.0), both(1.2, 0.25)])
    assert sorted(entry.type for entry in found.info.articulations) == ["prismatic", "revolute"]


def test_what_is_opened_and_shut_again_is_seen_too(tmp_path):
    found = articulated(tmp_path, [with_door(0.0), with_door(1.3), with_door(0.0)])
    assert [entry.type for entry in found.info.articulations] == ["revolute"]


BOX = block((0.1, FRONT - 0.4, 0.0), (0.5, FRONT - 0.1, 0.35))
"""Stands before the shut door."""


@pytest.mark.parametrize(
    "states",
    [
        [with_door(0.0), with_door(0.0)],
        [with_door(0.0), [*with_door(0.0), BOX]],
        [[*with_door(0.0), BOX], with_door(0.0)],
        [with_door(0.0), [*with_door(0.0), block((-0.6, 0.4, 0.0), (-0.2, 0.7, 1.7))], with_door(0.0)],
    ],
    ids=["nothing", "a box came", "a box went", "somebody walked by"],
)
def test_what_no_joint_explains_is_none(tmp_path, states):
    found = articulated(tmp_path, states)
    assert found.outcome == "ok" and not found.info.articulations
    assert not len(Outdated(found).points)


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    runs = [articulated(tmp_path / name, [with_drawer(0.0), with_drawer(0.2)]) for name in ("a", "b")]
    for file in ("articulations.json", "changes.npz"):
        assert runs[0].path(file).read_bytes() == runs[1].path(file).read_bytes()


def test_outdated_depth_is_left_out_and_nothing_else(tmp_path):
    found = articulated(tmp_path, [with_door(0.0), with_door(1.5)])
    outdated, pose = Outdated(found), poses(12)[3]
    before = depth_of(with_door(0.0), pose)
    kept = outdated.without(before, CAMERA, pose, 3)
    assert np.all((kept == 0) | (kept == before))
    after, gone = depth_of(with_door(1.5), pose), (kept == 0) & (before > 0)
    changed = np.abs(after - before) > 0.1  # the shut leaf, and what is hidden by the open one now
    assert gone[changed].mean() > 0.9 and gone[~changed].mean() < 0.1
    assert np.array_equal(outdated.without(after, CAMERA, pose, 15), after)


def test_without_depth_or_frames_nothing_breaks(tmp_path):
    with pytest.raises(BadInput, match="no depth"):
        articulated(tmp_path / "blind", [with_door(0.0)], depth=False)
    found = articulated(tmp_path / "one", [with_door(0.0)], frames=1)
    assert found.outcome == "ok" and not found.info.articulations
    assert articulated(tmp_path / "none", [[block((9, 9, 9), (9.1, 9.1, 9.1))]]).outcome == "empty"


def test_a_drawer_is_no_flap_and_its_size_is_its_front(tmp_path):
    (drawer,) = articulated(tmp_path, [with_drawer(0.0), with_drawer(0.3)]).info.articulations
    corners = np.array(drawer.leaf_after)
    sides = sorted(np.linalg.norm(np.diff(corners, axis=0)[:2], axis=1))
    assert sides == pytest.approx([0.22, WIDTH - 0.02], abs=0.05)
    assert corners[:, 2].max() < HIGH


@pytest.mark.parametrize(
    ("entry", "value"), [("leaf", []), ("travel", 0.0), ("type", "ball"), ("overlap", 2.0), ("axis", [0, 1])], ids=str
)
def test_a_document_that_says_no_joint_is_refused(tmp_path, entry, value):
    found = articulated(tmp_path, [with_door(0.0), with_door(1.5)])
    file = found.path("articulations.json")
    document = json.loads(file.read_text())
    document["articulations"][0][entry] = value
    file.write_text(json.dumps(document))
    with pytest.raises(BadInput, match=r"articulations\.json"):
        Articulations(found.root).info  # noqa: B018


def test_damaged_changes_are_refused(tmp_path):
    found = articulated(tmp_path, [with_door(0.0), with_door(1.5)])
    np.savez(found.path("changes.npz"), points=np.zeros((3, 2)), until=np.zeros(3))
    with pytest.raises(BadInput, match=r"changes\.npz"):
        Outdated(found)
    found.path("changes.npz").write_bytes(b"PK not a file")
    with pytest.raises(BadInput, match=r"changes\.npz"):
        Outdated(found)
