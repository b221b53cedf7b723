"""The backend on small sequences: twice the same, with and without colour, and with weights that are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.segment.backends.network.backend import camera_of_points, shows_something
from scenewright.stages.segment.choice import BackendRequest, choose_backend, chosen_backends, fitting
from scenewright.stages.segment.parameters import SegmentParameters

from tests.unit.segment.network.test_weights import tiny_checkpoint
from tests.unit.segment.test_box_masks import WIDE
from tests.unit.segment.test_stage import Written, payload, segment, write_sequence


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_sequence(tmp_path_factory.mktemp("room") / "sequence", frames=2)


def test_the_bundled_network_segments_twice_the_same(room: Written, tmp_path: Path) -> None:
    made = segment(room.sequence, tmp_path / "a", backend="network")
    assert made.info.backend == "network" and made.info.label == "own network, trained on generated rooms"
    assert made.outcome == "ok" and any(frame.segments for frame in made.info.frames)
    assert payload(made) == payload(segment(room.sequence, tmp_path / "b", backend="network"))


def test_auto_is_the_network(room: Written, tmp_path: Path) -> None:
    assert segment(room.sequence, tmp_path / "a", backend="auto").info.backend == "network"


def test_given_weights_are_used_and_named(room: Written, tmp_path: Path) -> None:
    tiny_checkpoint(tmp_path / "tiny.safetensors")
    made = segment(room.sequence, tmp_path / "a", backend="network", weights=tmp_path / "tiny.safetensors")
    assert made.info.label == "network tiny"


def test_weights_of_another_backend_are_refused(room: Written, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not a checkpoint of the network of our own"):
        segment(room.sequence, tmp_path / "a", backend="network", weights=tmp_path / "yolox.onnx")
    (tmp_path / "torn.safetensors").write_bytes(b"123")
    with pytest.raises(BadInput, match=r"torn\.safetensors"):
        segment(room.sequence, tmp_path / "b", backend="network", weights=tmp_path / "torn.safetensors")


def test_without_depth_the_step_says_so(tmp_path: Path) -> None:
    blind = write_sequence(tmp_path / "blind", depth=False, frames=2)
    with pytest.raises(BadInput, match="depth"):
        segment(blind.sequence, tmp_path / "a", backend="network")


def test_colour_may_be_missing_in_the_log_and_in_a_frame(room: Written) -> None:
    parameters = SegmentParameters(backend="network")
    with FrameReader(room.sequence.path("frames.mcap")) as reader:
        backend = choose_backend(BackendRequest(parameters, sequence=room.sequence, reader=reader))
        frame = reader.read(0, streams=("depth",))
        from scenewright.stages.segment.geometric import segment_depth

        assert frame.color is None and frame.depth is not None
        geometric = segment_depth(frame.depth, WIDE)
        found = backend(frame, geometric, np.random.default_rng(0))
        assert found.masks and set(np.unique(found.ids)) - {0} == set(found.masks)
        # A service knows neither reader nor sequence; the camera is that of the points.
        served = choose_backend(BackendRequest(parameters))(frame, geometric, np.random.default_rng(0))
        assert served.ids.shape == frame.depth.shape


def test_night_and_lens_caps_show_nothing() -> None:
    random = np.random.default_rng(0)
    night = random.integers(0, 6, (120, 160, 3)).astype(np.uint8)
    assert not shows_something(night) and not shows_something(np.full((120, 160, 3), 255, np.uint8))
    night[:, 80:] = 60
    assert shows_something(night)


def test_auto_takes_no_detector_for_a_log_without_colour(room: Written, tmp_path: Path) -> None:
    parameters = SegmentParameters(backend="auto")
    asked = BackendRequest(parameters, weights=tmp_path / "yolox.onnx", sequence=room.sequence)
    assert fitting(asked).weights == asked.weights and chosen_backends(fitting(asked))[0].name == "detector"
    dark = Sequence(tmp_path / "dark")
    (tmp_path / "dark").mkdir()
    streams = tuple(name for name in room.sequence.info.streams if name != "color")
    room.sequence.info.model_copy(update={"streams": streams}).write(dark.path("sequence.json"))
    fitted = fitting(BackendRequest(parameters, weights=tmp_path / "yolox.onnx", sequence=dark))
    assert fitted.weights is None and chosen_backends(fitted)[0].name == "network"


def test_the_camera_of_points_is_found_again() -> None:
    depth = np.random.default_rng(0).uniform(0.5, 3.0, (WIDE.height, WIDE.width)).astype(np.float32)
    depth[::3] = 0
    found = camera_of_points(back_project(depth, WIDE))
    assert found is not None
    assert (found.fx, found.fy, found.cx, found.cy) == pytest.approx((WIDE.fx, WIDE.fy, WIDE.cx, WIDE.cy), rel=1e-4)
    assert camera_of_points(np.zeros((8, 8, 3), np.float32)) is None
