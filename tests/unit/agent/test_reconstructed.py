"""Rooms of the chain as apartments: what a robot lives in, and what it knows of it."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.Log_pb2 import Log
from scenewright.schemas.agent_episode import AgentEpisode
from scenewright.schemas.apartment import Apartment
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Box, Joint
from scenewright.stages.agent.brains.words import understood
from scenewright.stages.agent.episode_log import LOG, MAP, SCENE, TRANSFORMS
from scenewright.stages.agent.episodes import write_episode
from scenewright.stages.agent.parameters import ReplayParameters
from scenewright.stages.agent.replay_stage import run as replay
from scenewright.stages.agent.trials import Setting, rules_brain, run_trial
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.reconstructed import apartment_of
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.kit.formats.indexed_mcap import IndexedMcap

from tests.unit.agent.test_sessions import NOTHING_FAILS, context

WORDS = "bring the bottle from the fridge to the table"
HINGE = Joint(
    name="fridge_1__hinge", type="revolute", part="fridge_1__door", origin=(0, 0, 0), axis=(0, 0, 1), lower=0, upper=1.8
)
Size = tuple[float, float, float]


def body(name: str, at: Size, size: Size, on: str | None = "floor_0", **more: object) -> SceneBody:
    """A body whose class is its name; `yaw` turns it."""
    yaw = float(str(more.pop("yaw", 0.0)))
    box = Box(center=at, size=size, orientation=(0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2))))
    pose = tuple(tuple(row) for row in np.eye(4).tolist())
    values = {"movable": False, "mass": 1.0, "world_from_body": pose, "parent": on, **more}
    return SceneBody(name=name, class_name=name.rsplit("_", 1)[0], box=box, **values)  # type: ignore[arg-type]


def room(*, shift: float = 0.0, bottle: bool = True) -> list[SceneBody]:
    """A room with a table, a fridge that stands open with a bottle in it, and a cup on a box on the table."""
    shelf = {"joints": (HINGE,), "joint_values": {HINGE.name: 1.7}, "contains": True}
    made = [
        body("floor_0", (0, 0, -0.05), (5, 5, 0.1), None),
        body("wall_0", (0, 2.5, 1.2), (5, 0.1, 2.4), None),
        body("table_1", (0.8 + shift, 0.4, 0.37), (0.8, 1.4, 0.74), yaw=pi / 2),
        body("fridge_1", (-1.9, 1.9, 0.85), (0.7, 0.7, 1.7), **shelf),
        body("box_1", (0.8, 0.4, 0.84), (0.15, 0.15, 0.2), "table_1", movable=True),
        body("cup_1", (0.8, 0.4, 0.99), (0.08, 0.08, 0.1), "box_1", movable=True),
        body("clock_1", (0, 2.4, 1.6), (0.3, 0.05, 0.3), "wall_0", relation="carries_on_wall"),
        body("lamp_1", (1.0, 0.6, 0.9), (0.2, 0.2, 0.3), "table_1", movable=True, furniture=True),
    ]
    inside = body("bottle_1", (-1.8, 1.75, 0.9), (0.07, 0.07, 0.25), "fridge_1", movable=True, relation="contains")
    return [*made, inside] if bottle else made


def test_a_scene_becomes_boxes_and_what_lies_on_them() -> None:
    made = apartment_of(room(), "a scene")
    pieces = {piece.name: piece for piece in made.furniture}
    assert set(pieces) == {"table_1", "fridge_1"} and pieces["table_1"].size == (1.4, 0.8)
    fridge = pieces["fridge_1"]
    assert fridge.door and fridge.opened and fridge.height == pytest.approx(0.775)
    assert {thing.name: thing.on for thing in made.things} == {
        "box_1": "table_1",
        "cup_1": "table_1",
        "bottle_1": "fridge_1",
    }
    x, y, _ = made.start
    assert abs(x) < 2 and abs(y) < 2 and not (0.1 < x < 1.5 and 0.0 < y < 0.8)


def test_a_scene_without_a_floor_is_refused_in_a_sentence() -> None:
    with pytest.raises(BadInput, match="a scene: no body is a floor"):
        apartment_of(room()[1:], "a scene")
    with pytest.raises(BadInput, match=r"the floor is 0\.5 x 0\.5 m"):
        apartment_of([body("floor_0", (0, 0, 0), (0.5, 0.5, 0.1), None)], "a scene")


def truth_and_map(**wrong: object) -> tuple[Apartment, Apartment]:
    return apartment_of(room(), "truth"), apartment_of(room(**wrong), "map")  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [{}, {"shift": 0.15}, {"bottle": False}])
def test_what_was_mapped_is_a_start_and_no_more(wrong: dict[str, object]) -> None:
    """A table that stands elsewhere or a bottle that is missing from the map is found by looking."""
    truth, known = truth_and_map(**wrong)
    setting = Setting(truth, WORDS, understood(WORDS), NOTHING_FAILS, 3, known=known)
    session, world = run_trial(setting, "ours")
    assert (session.end, world.root("bottle_1")) == ("done", "table_1")


def test_an_episode_in_a_mapped_room_replays_and_its_log_holds_the_turns(tmp_path: Path) -> None:
    truth, known = truth_and_map()
    setting = Setting(truth, WORDS, understood(WORDS), Rates(), 3, known=known)
    (tmp_path / "a").mkdir()
    made = write_episode(
        tmp_path / "a",
        setting,
        "ours",
        task="",
        impossible="",
        scales=(1.0, 1.0),
        brain=rules_brain(setting, "ours"),
        one_program=False,
        language=lambda: None,
        label="rules",
        width=300,
    )
    replay(
        AgentEpisode(tmp_path / "a"),
        None,
        parameters=ReplayParameters(image_width=300),
        context=context(tmp_path / "b"),
    )
    assert content_digest(record_files(tmp_path / "a", ())) == content_digest(record_files(tmp_path / "b", ()))
    with IndexedMcap(tmp_path / "a" / "episode.mcap") as log:
        topics = {channel.topic: number for number, channel in log.channels.items()}
        assert {TRANSFORMS, MAP, SCENE, LOG} <= set(topics)
        said = [Log.FromString(log.fetch(at)) for _, at in log.indexed(topics[LOG])]
        grids = [Grid.FromString(log.fetch(at)) for _, at in log.indexed(topics[MAP])]
    assert [entry.message.splitlines()[0] for entry in said] == [
        f"{number}. {turn.reason}" for number, turn in enumerate(made.info.turns, 1)
    ]
    assert all(len(grid.data) % grid.row_stride == 0 and set(grid.data) <= {0, 1, 2} for grid in grids)
