"""Partial maps: what the map would be if this frame were the last, and no trace of it in the map that goes on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.panoptic_map import SNAPSHOTS, PanopticMap
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.stage import run
from scenewright.stages.kit.formats.trajectories import read_tum, write_tum
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.fuse.scenes import write_scene


def contents(root: Path) -> dict[str, bytes]:
    files = {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*.*")) if path.is_file()}
    return {name: data for name, data in files.items() if not name.startswith(SNAPSHOTS)}


def test_a_snapshot_is_the_map_of_the_frames_so_far(tmp_path: Path) -> None:
    sequence, segments = write_scene(tmp_path / "scene")

    def fuse(name: str, trajectory: Trajectory, **options: int) -> PanopticMap:
        (tmp_path / name).mkdir()
        context = Context(output=tmp_path / name, seed=0, device="cpu", progress=SilentProgress())
        return run(sequence, segments, trajectory, parameters=FuseParameters(**options), context=context)

    every = Trajectory(sequence.root)
    whole, grown = fuse("whole", every), fuse("grown", every, snapshot_every=6)
    assert grown.info.frames_integrated == 12, "of the last frame there is the map itself"
    assert contents(whole.root) == contents(grown.root) and whole.snapshots() == ()
    assert [snapshot.root.name for snapshot in grown.snapshots()] == ["000006"]
    times, poses = read_tum(sequence.path("trajectory.tum"))
    for snapshot in grown.snapshots():
        count = snapshot.info.frames_integrated
        folder = tmp_path / f"first_{count}"
        folder.mkdir()
        write_tum(folder / "trajectory.tum", np.asarray(times)[:count], poses[:count])
        first = contents(fuse(f"map_{count}", Trajectory(folder)).root)
        kept = contents(snapshot.root)
        assert {"entities.json", "mesh.ply"} < set(kept) and len(kept) > 4
        assert kept == {name: first[name] for name in kept}
