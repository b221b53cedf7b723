"""A tray on a table that the map took for another one: what cameras before it show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.acting.errors import Luck, SegmenterErrors, segmenter_rates
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.simulation.robot import Configuration
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.world import load_scene, read_scene_bodies
from scenewright.stages.plan.affordances import has_rim
from scenewright.stages.plan.camera_eyes import CameraEyes, Look
from scenewright.stages.plan.eyes import Room
from scenewright.stages.plan.pictures import RoomPictures
from scenewright.stages.plan.room_segmenter import room_segmenter
from scenewright.stages.plan.world_model import WorldModel

from tests.unit.plan.test_tray_loading import tray
from tests.unit.simulation.handmade_scene import floor, table, write_scene

NEVER = SegmenterErrors(segmenter_rates("thesis").times(0.0), Luck(0), ())
PANDA = load_robot("panda")


@pytest.fixture
def sight(tmp_path: Path) -> Iterator[SimpleNamespace]:
    """The room has a tray of 36 cm x 28 cm, its rim 5 cm high; it is believed longer, turned, its rim 1 cm high."""
    true, believed = tmp_path / "true", tmp_path / "believed"
    longer = [(center, (size[0] * 1.3, size[1], size[2])) for center, size in tray(0.01).boxes]
    turned = transform_from_yaw(0.7, np.array([0.02, 0.01, 0.75]))
    for folder, own in ((true, tray()), (believed, replace(tray(0.01), boxes=longer, world_from_body=turned))):
        folder.mkdir()
        write_scene(folder, [floor(), table(0.0, 0.0), own])
    model = WorldModel(believed, ContactGraphFile.read(believed / "graph.json"), PANDA, 0.004)
    bodies = read_scene_bodies(true)
    records, texts = {name: record for name, (record, _) in bodies.items()}, {n: t for n, (_, t) in bodies.items()}
    room = Room(records, texts, {name: () for name in bodies})
    with load_scene(true) as world:
        start = Configuration(np.array([0.0, -0.8, np.pi / 2]), PANDA.carry, PANDA.opening)
        robot = ErringRobot(world, PANDA, start, 1.0, np.random.default_rng(0))
        pictures = RoomPictures(world, records, texts, PANDA)
        eyes = CameraEyes(model, pictures, robot, room_segmenter(room, world, NEVER), np.random.default_rng(0), 0.5)
        yield SimpleNamespace(model=model, world=world, robot=robot, eyes=eyes)
    model.close()


def look(sight: SimpleNamespace) -> np.ndarray:
    """Take over what the eyes see of the tray; return the corners of its bounds (2, 3) along its true sides."""
    seen = sight.eyes.seen("tray_6", "")
    assert seen is not None
    sight.model.see("tray_6", *seen)
    points = apply(sight.model.pose("tray_6"), sight.model.points("tray_6"))
    local = apply(inverse(tray().world_from_body), points)
    return np.array([local.min(axis=0), local.max(axis=0)])


def test_its_shape_is_what_is_seen_from_before_it(sight: SimpleNamespace) -> None:
    assert not has_rim(sight.model, "tray_6", 0.0)
    low, high = look(sight)
    assert low == pytest.approx([-0.18, -0.14, 0.0], abs=0.012)
    assert high == pytest.approx([0.18, 0.14, 0.05], abs=0.012)
    assert has_rim(sight.model, "tray_6", 0.0)


def test_from_afar_the_shape_stays_as_believed(sight: SimpleNamespace) -> None:
    before = sight.model.text("tray_6")
    sight.robot.put(Configuration(np.array([0.0, -2.0, np.pi / 2]), PANDA.carry, PANDA.opening))
    look(sight)
    assert sight.model.text("tray_6") == before


def test_what_hides_a_part_of_it_does_not_make_it_smaller(
    sight: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, text = look(sight), sight.model.text("tray_6")
    points = CameraEyes._look_for

    def hidden(self: CameraEyes, body: str, class_name: str, *, closely: bool = False) -> Look:
        found = points(self, body, class_name, closely=closely)
        return replace(found, points=found.points[apply(inverse(tray().world_from_body), found.points)[:, 0] < 0.08])

    monkeypatch.setattr(CameraEyes, "_look_for", hidden)
    part = look(sight)
    assert sight.model.text("tray_6") == text
    assert part == pytest.approx(whole, abs=0.012)
