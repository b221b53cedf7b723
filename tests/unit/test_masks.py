"""The panoptic zip: what is written is read back, the same images give the same bytes, damage is refused."""

from __future__ import annotations

import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scenewright.stages.kit.formats.masks import PanopticReader, encode_panoptic_png, write_panoptic_zip


@given(
    arrays(np.int32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(0, (1 << 24) - 1)),
    st.integers(0, 10**7),
)
@settings(max_examples=60, deadline=None)
def test_round_trip(tmp_path_factory: pytest.TempPathFactory, ids: np.ndarray, frame: int) -> None:
    path = tmp_path_factory.mktemp("masks") / "panoptic.zip"
    write_panoptic_zip(path, [(frame, ids), (frame + 1, np.zeros((2, 3), dtype=np.int32))])
    with PanopticReader(path) as reader:
        assert reader.frame_indices() == [frame, frame + 1]
        back = reader.read(frame)
        assert back.dtype == np.int32 and np.array_equal(back, ids)
        assert not reader.read(frame + 1).any()


def test_channel_order_is_that_of_coco() -> None:
    image = cv2.imdecode(np.frombuffer(encode_panoptic_png(np.array([[1 + 256 * 2 + 65536 * 3]])), np.uint8), 1)
    assert image[0, 0].tolist() == [3, 2, 1]  # OpenCV: blue, green, red


def test_same_images_give_the_same_bytes(tmp_path: Path) -> None:
    images = [(i, np.full((4, 5), 1000 * i, dtype=np.int32)) for i in range(3)]
    write_panoptic_zip(tmp_path / "a.zip", images)
    write_panoptic_zip(tmp_path / "b.zip", iter(images))
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert all(entry.compress_type == zipfile.ZIP_STORED for entry in archive.infolist())
        assert archive.namelist() == ["000000.png", "000001.png", "000002.png"]


@pytest.mark.parametrize("ids", [np.array([[-1]]), np.array([[1 << 24]]), np.zeros((2, 2, 3), int), np.zeros((0, 4))])
def test_ids_that_do_not_fit_are_refused(ids: np.ndarray) -> None:
    with pytest.raises(ValueError):
        encode_panoptic_png(ids)


def test_a_frame_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="twice"):
        write_panoptic_zip(tmp_path / "a.zip", [(1, np.zeros((1, 1))), (1, np.zeros((1, 1)))])
