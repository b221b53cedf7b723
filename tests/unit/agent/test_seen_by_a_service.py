"""A segmentation service as the robot's eyes in physics: masks, words, the same episode again, what does not fit."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.stages.agent import replay_stage, run_stage
from scenewright.stages.agent.goals import FURNITURE
from scenewright.stages.agent.goals import THINGS as THINGS_KNOWN
from scenewright.stages.agent.parameters import ReplayParameters, RunParameters, check_run
from scenewright.stages.agent.segmenter_identity import versions
from scenewright.stages.agent.world.physics import looking
from scenewright.stages.agent.world.physics.apartment_room import ApartmentRoom
from scenewright.stages.agent.world.physics.body import PhysicsBody
from scenewright.stages.kit.acting.eyes.asked import AskedSegmenter, word_of
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.rendering.object_views import Picture
from scenewright.stages.kit.services.receiving import BoundedHandler, BoundedServer
from scenewright.stages.kit.services.segmentation_protocol import (
    INFO_PATH,
    SEGMENT_PATH,
    Category,
    Reply,
    ReplySegment,
    ServiceInfo,
    encode_info,
    encode_reply,
    parse_request,
)
from scenewright.stages.kit.stage import Context

from tests.unit.agent.test_physics import ABOVE, APARTMENT, NO_ERRORS, TABLE, THINGS

KNOWN = (*THINGS_KNOWN, *FURNITURE)
CHROMA = {"apple": (1.0, 0.16, 0.13), "cup": (0.13, 0.3, 1.0), "dining table": (1.0, 0.79, 0.54)}
INFO = ServiceInfo(
    "by colour",
    "r1",
    tuple(Category(id=k, name=name) for k, name in enumerate(CHROMA, 1)),
    ("color", "depth", "pose"),
    ("color",),
)


class ByColor(BoundedHandler):
    """Names pixels by the nearest chroma, as a network would that was taught these three classes."""

    def info(self) -> None:
        self.answer(200, encode_info(INFO))

    def segment(self) -> None:
        body = self.body()
        assert body is not None
        color = parse_request(body, self.headers["Content-Type"]).frame.color
        assert color is not None
        chroma = color / np.maximum(color.max(axis=2, keepdims=True), 1)
        away = np.stack([np.abs(chroma - np.array(wanted)).max(axis=2) for wanted in CHROMA.values()])
        ids = np.where(away.min(axis=0) < 0.2, away.argmin(axis=0) + 1, 0).astype(np.int32)
        there = {int(k): ReplySegment(int(k), True, 1.0) for k in np.unique(ids) if k}
        self.answer(200, encode_reply(Reply(ids, there)))
        self.done()

    routes = {INFO_PATH: {"GET": info}, SEGMENT_PATH: {"POST": segment}}


@pytest.fixture
def address() -> Iterator[str]:
    with serving() as url:
        yield url


@contextlib.contextmanager
def serving() -> Iterator[str]:
    server = BoundedServer("127.0.0.1", 0, ByColor)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server.address
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def test_the_robot_sees_by_the_masks_and_by_nothing_true(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def untold(*arguments: Any) -> Picture:
        picture = take(*arguments)
        return replace(picture, instance=np.zeros_like(picture.instance))

    take = looking.take
    monkeypatch.setattr(looking, "take", untold)
    asked = AskedSegmenter(address, 3, KNOWN)
    body = PhysicsBody(ApartmentRoom(APARTMENT), ("apple", "plate"), NO_ERRORS, 3, asked)
    try:
        tables = [piece for piece in body.sweep().furniture if piece.label == "table"]
        assert any(np.allclose(piece.centre, TABLE.centre, atol=0.08) for piece in tables)
        seen = {d.label: d for d in body.look(ABOVE, close=False).detections}
        assert set(seen) == {"apple", "cup"} and seen["cup"].color == "blue"  # nobody told it what a plate is
        for thing in THINGS[:2]:
            assert np.hypot(*np.subtract(seen[thing.label].position[:2], thing.at)) < 0.03
        assert body.grasp(seen["apple"].position, "apple", 0).ok
        held = body.look_at_hand(0)
        assert held is not None and held.label == "apple"
    finally:
        body.close()


def test_words_of_services_become_those_of_the_robot() -> None:
    names = ("dining table", "Couch", "wine_glass", "apple", "teddy bear", "object")
    assert [word_of(name, KNOWN) for name in names] == ["table", "sofa", "cup", "apple", "teddy bear", "object"]


def context(folder: Path) -> Context:
    folder.mkdir()
    return Context(output=folder, seed=1, device="cpu", progress=SilentProgress())


def test_an_episode_names_its_eyes_and_comes_out_again_by_them_alone(address: str, tmp_path: Path) -> None:
    APARTMENT.write(tmp_path / "world.json")
    parameters = RunParameters(task="place_fruit", simulation="physics", segmenter=address, turns=3, image_width=300)
    given = {"scene": None, "truth": None, "transcript": None}
    episode = run_stage.run(
        tmp_path / "world.json", **given, parameters=parameters, context=context(tmp_path / "episode")
    )
    assert episode.info.segmenter == INFO.identity and episode.info.turns
    same = ReplayParameters(segmenter=address, image_width=300)
    again = replay_stage.run(episode, parameters=same, context=context(tmp_path / "again"))
    assert again.outcome == episode.outcome
    for file in ("episode.json", "maps.json", "views.png"):
        assert (again.root / file).read_bytes() == (episode.root / file).read_bytes()
    with pytest.raises(BadInput, match=r"seen by by colour r1 .*--segmenter"):
        replay_stage.run(episode, parameters=ReplayParameters(), context=context(tmp_path / "blind"))


def test_what_does_not_fit_is_said_before_anything_works(address: str) -> None:
    for options in ({}, {"simulation": "physics", "arm": "oracle"}, {"simulation": "physics", "perception": 2.0}):
        with pytest.raises(UsageError, match="--segmenter"):
            check_run(RunParameters(segmenter=address, **options), {})
    with pytest.raises(ValueError, match="not the address of a service"):
        RunParameters(segmenter="network")
    assert versions(RunParameters(segmenter=address)) == {f"service {address}": INFO.identity}
    assert versions(RunParameters()) == {}


def test_nobody_answers() -> None:
    with serving() as gone:
        pass
    with pytest.raises(MissingDependency, match="no segmentation service answers"):
        versions(RunParameters(segmenter=gone))
