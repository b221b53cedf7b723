"""disparity.mcap: what is written is read back, what is damaged is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.disparity_file import DisparityReader, DisparityWriter
from scenewright.stages.kit.stereo.disparity_map import DisparityMap


def written(path: Path) -> tuple[Path, DisparityMap]:
    disparity = np.linspace(0.1, 60, 12, dtype=np.float32).reshape(3, 4)
    disparity[1, 2] = np.nan
    found = DisparityMap(disparity, np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4))
    with DisparityWriter(path, ["camera", "other"]) as writer:
        writer.write(1_000_000, "camera", found)
        writer.write(2_000_000, "other", found)
    return path, found


def test_maps_come_back(tmp_path: Path) -> None:
    path, found = written(tmp_path / "disparity.mcap")
    with DisparityReader(path) as reader:
        assert len(reader) == 2 and reader.stamps == [1_000_000, 2_000_000]
        back = reader.read(2_000_000)
        np.testing.assert_array_equal(back.disparity, found.disparity)
        np.testing.assert_allclose(back.confidence, found.confidence, atol=0.5 / 255)
        with pytest.raises(KeyError):
            reader.read(3)
    assert path.read_bytes() == written(tmp_path / "again.mcap")[0].read_bytes()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_torn_files_are_refused(tmp_path: Path, share: float) -> None:
    path, _ = written(tmp_path / "disparity.mcap")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(BadInput), DisparityReader(path) as reader:
        reader.read(1_000_000)
