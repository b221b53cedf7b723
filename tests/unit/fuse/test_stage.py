"""The whole step on a scene of known blocks: exactly the right entities, the same bytes, what is refused."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.manifest import InputRecord, Manifest
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.segments import FrameSegments, Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.fuse.inputs import check_origin
from scenewright.stages.fuse.parameters import STAGE, FuseParameters
from scenewright.stages.fuse.stage import run
from scenewright.stages.fuse.testimony import BOUND, BY_MASKS, PIECE
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.kit.formats.ply_files import read_ply
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.fuse.scenes import CUP, SCENE, TABLE, class_id, orbit, write_scene


def fuse(
    output: Path, sequence: Sequence, segments: Segments, trajectory: Trajectory | None = None, **options: object
) -> PanopticMap:
    output.mkdir(parents=True)
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(sequence, segments, trajectory, parameters=FuseParameters(**options), context=context)


def digest(root: Path) -> str:
    lines = [f"{p.relative_to(root)} {hashlib.sha256(p.read_bytes()).hexdigest()}" for p in sorted(root.rglob("*.*"))]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sequence, Segments]:
    return write_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def panoptic_map(scene: tuple[Sequence, Segments], tmp_path_factory: pytest.TempPathFactory) -> PanopticMap:
    return fuse(tmp_path_factory.mktemp("map") / "map", *scene)


def test_exactly_the_right_entities(panoptic_map: PanopticMap) -> None:
    info = panoptic_map.info
    assert panoptic_map.outcome == "ok"
    assert sorted(e.class_name for e in info.entities) == ["cup", "cup", "floor", "table"]
    assert info.frames_integrated == 12 and info.segmentation == "true blocks"
    for block in SCENE[1:]:
        (entity,) = [
            e
            for e in info.entities
            if e.class_name == block.class_name
            and np.all(
                np.abs(np.add(e.box_minimum, e.box_maximum) / 2 - np.add(block.minimum, block.maximum) / 2) < 0.06
            )
        ]
        assert np.abs(np.array(entity.box_maximum) - block.maximum).max() < 0.045
        assert np.abs(np.array(entity.box_minimum)[:2] - np.array(block.minimum)[:2]).max() < 0.045
        assert entity.observations == 12 and entity.confidence > 0.95
    table = next(e for e in info.entities if e.class_name == "table")
    assert table.box_minimum[2] < 0.05, "down to the floor"


def test_files_agree(panoptic_map: PanopticMap) -> None:
    mesh = read_ply(panoptic_map.path("mesh.ply"))
    with np.load(panoptic_map.path("mesh_labels.npz"), allow_pickle=False) as labels:
        instance, class_ids, segment = labels["instance"], labels["class_id"], labels["segment"]
    assert len(mesh.vertices) == len(instance) == len(class_ids) == len(segment)
    assert {a.dtype for a in (instance, class_ids, segment)} == {np.dtype(np.int32)}
    entities = {e.instance: e for e in panoptic_map.info.entities}
    assert set(np.unique(instance)) - {0} == set(entities)
    for label, entity in entities.items():
        part = read_ply(panoptic_map.path(entity.mesh))
        assert (len(part.vertices), len(part.faces)) == (entity.vertices, entity.triangles)
        assert np.allclose(part.vertices.min(axis=0), entity.box_minimum, atol=1e-6)
        assert set(class_ids[instance == label]) == {class_id(entity.class_name)}
        assert bool(entity.segments) == (entity.class_name != "floor"), "geometry finds what bounds the room"
        assert not entity.segments or set(np.unique(segment[instance == label])) & set(entity.segments)
    faces = mesh.faces[(instance[mesh.faces] == instance[mesh.faces][:, :1]).all(axis=1)]
    assert sum(e.triangles for e in entities.values()) >= len(faces[instance[faces[:, 0]] > 0])
    with np.load(panoptic_map.path("counts.npz"), allow_pickle=False) as counts:
        assert (counts["count"] > 0).all() and len(set(counts["instance"].tolist())) == 3
        cup = counts["class_id"] == class_id("cup")
        assert counts["count"][cup].sum() == 24, "two cups in twelve frames"
    with np.load(panoptic_map.path("volume.npz"), allow_pickle=False) as volume:
        blocks = volume["block_coordinates"]
        assert volume["tsdf"].shape == volume["weight"].shape == volume["segment"].shape == (len(blocks), 512)
        assert volume["color"].shape == (len(blocks), 512, 3)
        assert blocks.tolist() == sorted(blocks.tolist(), key=lambda c: c[::-1])
        assert set(np.unique(volume["segment"])) <= {0, *np.unique(segment), *range(1, 50)}


def test_every_entity_says_why_it_is_what_it_is(panoptic_map: PanopticMap) -> None:
    assert panoptic_map.because is not None and panoptic_map.because.dropped == ()
    reasons = {row.instance: row for row in panoptic_map.because.entities}
    for entity in panoptic_map.info.entities:
        because = reasons[entity.instance]
        assert because.looks == 12.0
        assert because.said == {entity.class_name: pytest.approx(1.0, abs=0.02)}
        is_floor = entity.class_name == "floor"
        assert because.shape == (BOUND if is_floor else BY_MASKS)
        assert (because.posterior is None, because.name == "") == (is_floor, is_floor)
        assert because.posterior is None or because.posterior > 0.9


def test_the_layout_lies_with_the_map(panoptic_map: PanopticMap) -> None:
    layout = panoptic_map.layout
    assert layout is not None and layout.floor == pytest.approx(0.0, abs=0.005)
    (floor,) = [plane for plane in layout.planes if plane.bounds]
    assert floor.kind == "floor" and floor.log_odds == pytest.approx(sum(floor.reasons.values()), abs=0.005)
    assert panoptic_map.summary["bounds"] == 1 and panoptic_map.summary["masks_dropped"] == 0


def test_labels_lie_where_the_blocks_are(panoptic_map: PanopticMap) -> None:
    mesh = read_ply(panoptic_map.path("mesh.ply"))
    with np.load(panoptic_map.path("mesh_labels.npz"), allow_pickle=False) as labels:
        class_ids = labels["class_id"]
    top = (np.abs(mesh.vertices[:, 2] - TABLE.maximum[2]) < 0.005) & (np.abs(mesh.vertices[:, 0]) > 0.45)
    assert top.sum() > 200 and (class_ids[top] == class_id("table")).mean() > 0.97
    lid = np.abs(mesh.vertices[:, 2] - CUP.maximum[2]) < 0.005
    assert lid.sum() > 20 and (class_ids[lid] == class_id("cup")).mean() > 0.97


def test_same_bytes_twice_and_with_another_number_of_threads(
    scene: tuple[Sequence, Segments], panoptic_map: PanopticMap, tmp_path: Path
) -> None:
    fuse(tmp_path / "again", *scene)
    assert digest(tmp_path / "again") == digest(panoptic_map.root)
    (tmp_path / "one").mkdir()
    program = (
        "from pathlib import Path; from scenewright.schemas.sequence import Sequence;"
        "from scenewright.schemas.segments import Segments;"
        "from scenewright.stages.fuse.parameters import STAGE, FuseParameters;"
        "from scenewright.stages.fuse.stage import run;"
        "from scenewright.stages.kit.progress import SilentProgress;"
        "from scenewright.stages.kit.stage import Context; import sys;"
        "run(Sequence(root=Path(sys.argv[1])), Segments(root=Path(sys.argv[2])), None, parameters=FuseParameters(),"
        "context=Context(output=Path(sys.argv[3]), seed=0, device='cpu', progress=SilentProgress()))"
    )
    arguments = [str(scene[0].root), str(scene[1].root), str(tmp_path / "one")]
    environment = {**os.environ, "NUMBA_NUM_THREADS": "1", "PYTHONHASHSEED": "7"}
    subprocess.run(
        [sys.executable, "-c", program, *arguments], check=True, env=environment, cwd=Path(__file__).parents[3]
    )
    assert digest(tmp_path / "one") == digest(panoptic_map.root)


def test_background_frames_cast_no_vote(tmp_path: Path) -> None:
    # In half of the frames the first cup is not predicted: it stays one thing with six observations, and as many looks
    # at so large a cup said nothing, it has no name.
    scene = write_scene(tmp_path / "s", background={index: (3,) for index in range(0, 12, 2)})
    info = fuse(tmp_path / "map", *scene).info
    things = sorted((e.observations, e.class_name) for e in info.entities if e.class_name != "floor")
    assert things == [(6, "object"), (12, "cup"), (12, "table")]
    # Never predicted: a piece that geometry cuts from the table.
    scene = write_scene(tmp_path / "n", background={index: (3,) for index in range(12)})
    made = fuse(tmp_path / "none", *scene)
    info = made.info
    assert sorted(e.class_name for e in info.entities) == ["cup", "floor", "object", "table"]
    (piece,) = [e for e in info.entities if e.class_name == "object"]
    assert np.allclose(np.add(piece.box_minimum, piece.box_maximum)[:2] / 2, (-0.3, 0.0), atol=0.03)
    assert made.because is not None
    (because,) = [row for row in made.because.entities if row.instance == piece.instance]
    assert (because.shape, because.name) == (PIECE, "nobody named it")


def test_frames_without_pose_or_depth_are_skipped_and_counted(tmp_path: Path) -> None:
    no_pose = write_scene(tmp_path / "a", frames=3, with_pose=False)
    result = fuse(tmp_path / "a_map", *no_pose)
    assert result.outcome == "empty" and result.summary["skipped_no_pose"] == 3
    assert result.info.entities == () and len(read_ply(result.path("mesh.ply")).vertices) == 0
    no_depth = write_scene(tmp_path / "b", frames=2, with_depth=False)
    result = fuse(tmp_path / "b_map", *no_depth)
    assert result.outcome == "empty" and result.summary["skipped_no_depth"] == 2


def test_trajectory_overrides_and_its_gaps_are_counted(tmp_path: Path) -> None:
    sequence, segments = write_scene(tmp_path / "s", frames=6, with_pose=False)
    folder = tmp_path / "trajectory"
    folder.mkdir()
    poses = np.array(orbit(6))
    write_tum(folder / "trajectory.tum", 0.1 * np.arange(6)[:5] + 0.004, poses[:5])
    result = fuse(tmp_path / "map", sequence, segments, Trajectory(root=folder))
    assert result.summary["frames"] == 5 and result.summary["skipped_no_pose"] == 1
    assert sorted(e.class_name for e in result.info.entities) == ["cup", "cup", "floor", "table"]


def test_every_second_frame(scene: tuple[Sequence, Segments], tmp_path: Path) -> None:
    assert fuse(tmp_path / "map", *scene, every=2).info.frames_integrated == 6


def test_frames_without_segments_add_geometry(tmp_path: Path) -> None:
    sequence, segments = write_scene(tmp_path / "s", frames=4)
    info = segments.info
    info.model_copy(update={"frames": info.frames[:2]}).write(segments.path("segments.json"))
    result = fuse(tmp_path / "map", sequence, segments)
    assert result.summary["frames"] == 4 and result.summary["frames_without_segments"] == 2


def test_refusals(tmp_path: Path) -> None:
    sequence, segments = write_scene(tmp_path / "s", frames=3)
    info, path = segments.info, segments.path("segments.json")

    def refused(message: str, **changes: object) -> None:
        info.model_copy(update=changes).write(path)
        with pytest.raises(BadInput, match=message):
            fuse(tmp_path / f"map{len(list(tmp_path.iterdir()))}", sequence, segments)
        info.write(path)

    refused("80x60, frames are 160x120", width=80, height=60)
    refused("frame 9 does not exist", frames=(*info.frames, FrameSegments(frame=9, segments=())))
    refused("lists frame 0 twice", frames=(*info.frames, info.frames[0]))
    bad_class = info.frames[0].segments[0].model_copy(update={"class_id": 999})
    refused("class id 999", frames=(FrameSegments(frame=0, segments=(bad_class,)),))
    double = FrameSegments(frame=0, segments=(info.frames[0].segments[0],) * 2)
    refused("ids of frame 0", frames=(double,))
    missing = FrameSegments(frame=0, segments=info.frames[0].segments[1:])
    refused("is in the panoptic image but not in segments.json", frames=(missing,))
    write_panoptic_zip(segments.path("panoptic.zip"), [(0, np.zeros((60, 80), np.int32))])
    refused("segments of the frame is 80x60")


def test_camera_outside_of_the_grid_is_refused(tmp_path: Path) -> None:
    sequence, segments = write_scene(tmp_path / "s", frames=2)
    folder = tmp_path / "trajectory"
    folder.mkdir()
    far = np.array(orbit(2))
    far[:, 0, 3] += 1e6
    write_tum(folder / "trajectory.tum", 0.1 * np.arange(2), far)
    with pytest.raises(BadInput, match="outside of the voxel grid"):
        fuse(tmp_path / "map", sequence, segments, Trajectory(root=folder))


def test_depth_range_must_hold_something() -> None:
    assert STAGE.check is not None
    with pytest.raises(UsageError, match="minimum-depth 3.0 is not below"):
        STAGE.check(
            FuseParameters(minimum_depth=3.0, maximum_depth=2.0), {"sequence": Path("s"), "segments": Path("t")}
        )
    STAGE.check(FuseParameters(), {"sequence": Path("s"), "segments": Path("t")})


def test_segments_of_another_sequence_are_refused(scene: tuple[Sequence, Segments]) -> None:
    def manifest(kind: str, digest: str, source: str = "") -> Manifest:
        inputs = (InputRecord(role="sequence", kind="sequence", digest=source, path="../x"),) if source else ()
        return Manifest(kind=kind, schema_version=1, stage="x", key="k", content_digest=digest, files=(), inputs=inputs)

    sequence = replace(scene[0], manifest=manifest("sequence", "aaa"))
    check_origin(sequence, replace(scene[1], manifest=manifest("segments", "bbb", "aaa")))
    check_origin(sequence, scene[1])
    with pytest.raises(BadInput, match="another sequence"):
        check_origin(sequence, replace(scene[1], manifest=manifest("segments", "bbb", "ccc")))
