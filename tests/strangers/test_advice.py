"""Advice is tried: what a message tells to do is done, and then it has to be right.

Further advice is followed in test_logs.py (depth unit, scale of poses, up, stereo, scans) and in test_masks.py.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import write_open3d_log

from tests.strangers import rooms
from tests.strangers.calls import Said, advised, call, inspect
from tests.strangers.importing import Added, add, hinge, is_size, write
from tests.strangers.logs import STEP, stamps, units, write_bag, write_images, write_nerfstudio, write_tum
from tests.strangers.pictures import COUNT, NAMES, TRUE, overlaps, segment, write_ids
from tests.strangers.rooms import CAMERA, depth_error, path, shots
from tests.strangers.test_logs import BASELINE, EYES, ingest, read, stereo_depth_is_right, write_stereo_folder
from tests.strangers.test_masks import plain, runs, write_coco
from tests.unit.ingest.message_logs import RosRecorder, recorder
from tests.unit.ingest.tiny_room import jpeg

assert plain  # a fixture
POSES = path(12)
K = ("--fx", str(CAMERA.fx), "--fy", str(CAMERA.fy), "--cx", str(CAMERA.cx), "--cy", str(CAMERA.cy))


def frames_of(sequence: Path) -> tuple[int, int]:
    """Return how many frames a sequence has, and how many with a pose."""
    with FrameReader(sequence / "frames.mcap") as reader:
        poses = [frame.world_from_camera is not None for frame in reader.frames(streams=())]
    return len(poses), sum(poses)


# ---- logs ------------------------------------------------------------------------------------------------------------


def test_intrinsics_are_asked_for(tmp_path: Path) -> None:
    """Pictures and depth without a calibration: --fx --fy --cx --cy are asked for, and given they make it right
    (F2Wang/ObjectDatasetTools #84)."""
    log = write_images(tmp_path / "log", shots(POSES), intrinsics=False)
    said = ingest(log, tmp_path / "none")
    assert said.code == 3 and said.names("--fx", "--fy", "--cx", "--cy"), said.text
    read(log, tmp_path / "sequence", *K)
    assert depth_error(tmp_path / "sequence", POSES) < 0.003


def test_a_camera_info_of_another_size(tmp_path: Path) -> None:
    """A node scaled the pictures to a quarter and passed the camera_info on: it is scaled, or its size is named
    (HKUST-Aerial-Robotics/MVDepthNet #2)."""
    k = CAMERA
    matrix = [4 * k.fx, 0.0, 4 * (k.cx + 0.5) - 0.5, 0.0, 4 * k.fy, 4 * (k.cy + 0.5) - 0.5, 0.0, 0.0, 1.0]
    projection = [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0]
    log = write_bag(tmp_path / "log", shots(POSES), K=matrix, P=projection, width=4 * k.width, height=4 * k.height)
    read(log, tmp_path / "sequence")
    assert depth_error(tmp_path / "sequence", POSES) < 0.005


def conventions_are_mended(log: Path, tmp_path: Path) -> None:
    if ingest(log, tmp_path / "sequence").code == 0 and depth_error(tmp_path / "sequence", POSES) < 0.003:
        return
    report, said = inspect(log, "--frames", "8")
    text = said.err + " ".join(str(finding["fix"]) for finding in report["findings"])
    values = advised(text, "--pose-convention")
    assert report["verdict"] == "wasted" and values, text
    read(log, tmp_path / "again", "--pose-convention", values[0])
    assert depth_error(tmp_path / "again", POSES) < 0.003


def test_transforms_json_with_axes_of_opencv(tmp_path: Path) -> None:
    """transforms.json whose matrices have OpenCV's axes: the convention is named, and taken it is right
    (alievk/npbg #4, facebookresearch/localrf #53)."""
    conventions_are_mended(write_nerfstudio(tmp_path / "log", shots(POSES), opengl=False), tmp_path)


def test_a_trajectory_log_of_extrinsics(tmp_path: Path) -> None:
    """Redwood's trajectory.log with world to camera, as Open3D's extrinsics are (isl-org/Open3D #1340, #2778):
    `inverse` is named, and taken it is right."""
    log = write_images(tmp_path / "log", shots(POSES), posed=False, intrinsics=False)
    (log / "rgb").rename(log / "image")
    matrix = [CAMERA.fx, 0, 0, 0, CAMERA.fy, 0, CAMERA.cx, CAMERA.cy, 1]
    document = {"width": CAMERA.width, "height": CAMERA.height, "intrinsic_matrix": matrix}
    (log / "camera_intrinsic.json").write_text(json.dumps(document))
    write_open3d_log(log / "trajectory.log", np.linalg.inv(POSES))
    conventions_are_mended(log, tmp_path)


def test_poses_of_a_left_handed_world(tmp_path: Path) -> None:
    """ICL-NUIM's left-handed camera poses in a folder of one's own (yenchenlin/nerf-pytorch #80): the convention is
    named, and taken it is right; or the poses are said to contradict the depth."""
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    recorded = [(color, depth, mirror @ pose @ mirror) for color, depth, pose in shots(POSES)]
    log = write_images(tmp_path / "log", recorded)
    conventions_are_mended(log, tmp_path)


def test_poses_come_at_one_hertz(tmp_path: Path) -> None:
    """Transforms once a second, pictures ten times: what is left out names the option, and 5 s of it take all
    (DarrenWong's and zhanglei1997's question, IPNL-POLYU/UrbanNavDataset #18)."""
    count = 21
    poses = path(count)
    # Straight motion, so that interpolation over a second is exact.
    poses[:, :3, :3] = poses[0, :3, :3]
    poses[:, :3, 3] = poses[0, :3, 3] + np.linspace(0, 1, count)[:, None] * [0.6, 0.5, 0.0]
    first = stamps(1)[0]

    def slow(log: RosRecorder, stamp: int, pose: np.ndarray) -> None:
        if (stamp - first) % (10 * STEP) == 0:
            log.transform("/tf", stamp, "map", "camera_optical", pose)

    log = write_bag(tmp_path / "log", shots(poses), transforms=slow)
    said = read(log, tmp_path / "sequence")
    if frames_of(tmp_path / "sequence") != (count, count):
        assert said.names("--maximum-transform-gap"), said.text
        read(log, tmp_path / "sequence2", "--maximum-transform-gap", "5")
        assert frames_of(tmp_path / "sequence2") == (count, count)
        assert depth_error(tmp_path / "sequence2", poses) < 0.003
    else:
        assert depth_error(tmp_path / "sequence", poses) < 0.003


def test_colour_and_depth_are_not_of_one_moment(tmp_path: Path) -> None:
    """Depth comes 40 ms after colour: what is left out names the option, and 0.05 takes all
    (introlab/rtabmap_ros #93)."""
    log = write_tum(tmp_path / "log", shots(POSES))
    rows = []
    for file in sorted((log / "rgb").iterdir()):
        earlier = f"{float(file.stem) - 0.04:.6f}"
        file.rename(file.with_name(f"{earlier}.png"))
        rows.append(f"{earlier} rgb/{earlier}.png")
    (log / "rgb.txt").write_text("\n".join(rows) + "\n")
    said = ingest(log, tmp_path / "sequence")
    if said.code == 0 and frames_of(tmp_path / "sequence") == (12, 12):
        return
    assert said.names("--maximum-time-difference"), said.text
    read(log, tmp_path / "again", "--maximum-time-difference", "0.05")
    assert frames_of(tmp_path / "again") == (12, 12) and depth_error(tmp_path / "again", POSES) < 0.003


def test_the_other_camera_of_a_log(tmp_path: Path) -> None:
    """Two cameras in one bag: the other is named, and --camera with that name takes it
    (youkely/InfrasCal #9 has six)."""
    with recorder(tmp_path / "log") as log:
        for k, (stamp, pose) in enumerate(zip(stamps(12), POSES, strict=True)):
            for name, shown in (("front", pose), ("wrist", POSES[11 - k])):
                color, depth, _ = rooms.seen(shown)
                frame = f"{name}_optical"
                log.transform("/tf", stamp, "map", frame, shown)
                log.info(f"/{name}/color/camera_info", stamp, frame, CAMERA)
                log.compressed(f"/{name}/color/image_raw/compressed", stamp, jpeg(color), "jpeg", frame)
                log.image(f"/{name}/aligned_depth_to_color/image_raw", stamp, units(depth, 1000), "16UC1", frame)
        bag = log.path
    said = read(bag, tmp_path / "sequence")
    taken = depth_error(tmp_path / "sequence", POSES) < 0.003
    other = "wrist" if taken else "front"
    assert said.names(other), said.text
    read(bag, tmp_path / "other", "--camera", other)
    assert depth_error(tmp_path / "other", POSES[::-1] if taken else POSES) < 0.003


def test_exchanged_folders_of_a_pair(tmp_path: Path) -> None:
    """left/ and right/ are exchanged, the calibration is right: it is said, and what it says is done, by options
    and by folders, and gives the depth (ZYangChen/MoCha-Stereo #19, ros-perception/image_pipeline #497)."""
    log = write_stereo_folder(tmp_path / "log", ("right", "left"))
    for name, shift in (("left", 0.0), ("right", -EYES.fx * BASELINE)):
        k = EYES
        (log / f"{name}.yaml").write_text(
            f"image_width: {k.width}\nimage_height: {k.height}\n"
            f"camera_matrix: {{rows: 3, cols: 3, data: [{k.fx}, 0, {k.cx}, 0, {k.fy}, {k.cy}, 0, 0, 1]}}\n"
            "distortion_model: plumb_bob\ndistortion_coefficients: {data: [0, 0, 0, 0, 0]}\n"
            "rectification_matrix: {data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
            f"projection_matrix: {{data: [{k.fx}, 0, {k.cx}, {shift}, 0, {k.fy}, {k.cy}, 0, 0, 0, 1, 0]}}\n"
        )
    said = ingest(log, tmp_path / "sequence")
    if said.code == 0:
        said = call("disparity", "--sequence", tmp_path / "sequence", "--out", tmp_path / "disparity")
    assert said.code == 3 and said.names("swap|exchang"), said.text
    if said.names("--color-topic"):
        values = [*advised(said.text, "--color-topic")[:1], *advised(said.text, "--right-topic")[:1]]
        color, right = values if len(values) == 2 else ("right", "left")  # none are said: the folders' names
        read(log, tmp_path / "by_options", "--color-topic", color, "--right-topic", right)
        assert stereo_depth_is_right(tmp_path / "by_options", tmp_path / "d_by_options")
    shutil.move(log / "left", log / "middle")
    shutil.move(log / "right", log / "left")
    shutil.move(log / "middle", log / "right")
    read(log, tmp_path / "by_folders")
    assert stereo_depth_is_right(tmp_path / "by_folders", tmp_path / "d_by_folders")


# ---- models ----------------------------------------------------------------------------------------------------------


def carcass(scale: float) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((0.4, 0.3, 0.6))
    mesh.apply_translation([0, 0, 0.3])
    mesh.apply_scale(scale)
    return mesh


def unit_is_followed(folder: Path, tmp_path: Path, unit: str) -> None:
    """The unit is named, and following it: 0.40 x 0.32 x 0.60 m, the hinge where the description has it; or it is
    right at once."""
    added = add(folder, tmp_path / "out")
    try:
        is_the_cabinet(added.only)
        return
    except AssertionError:
        pass
    values = advised(added.text, "--unit")
    assert unit in values, added.text
    is_the_cabinet(add(folder, tmp_path / "again", "--unit", values[values.index(unit)]).only)


def is_the_cabinet(model: dict[str, Any]) -> None:
    is_size(model, 0.40, 0.32, 0.60)
    hinge(model, "hinge", (-0.2, -0.14, 0.3), (0, 0, 1))


def test_meshes_in_millimetres_in_sdf(tmp_path: Path) -> None:
    """SDF with a mesh in mm and no <scale>, its door a box in metres: --unit mm, and the hinge stays
    (gazebosim/gz-sim #2656, iory/scikit-robot #770)."""
    folder = tmp_path / "in"
    write(folder / "meshes" / "carcass.obj", "")
    carcass(1000).export(folder / "meshes" / "carcass.obj")
    mesh = "<geometry><mesh><uri>meshes/carcass.obj</uri></mesh></geometry>"
    box = "<geometry><box><size>0.4 0.02 0.56</size></box></geometry>"
    links = [
        f'<link name="{name}"><pose>{pose}</pose>'
        + "".join(f'<{k} name="{k}"><pose>{inner}</pose>{shape}</{k}>' for k in ("visual", "collision"))
        + "</link>"
        for name, pose, inner, shape in (
            ("carcass", "0 0 0 0 0 0", "0 0 0 0 0 0", mesh),
            ("door", "-0.2 -0.15 0.3 0 0 0", "0.2 -0.01 0 0 0 0", box),
        )
    ]
    joint = (
        '<joint name="hinge" type="revolute"><parent>carcass</parent><child>door</child><axis><xyz>0 0 1</xyz>'
        "<limit><lower>0</lower><upper>1.57</upper></limit></axis></joint>"
    )
    write(folder / "cabinet.sdf", f'<sdf version="1.7"><model name="cabinet">{"".join(links)}{joint}</model></sdf>')
    unit_is_followed(folder, tmp_path, "mm")


def test_meshes_in_centimetres_in_mjcf(tmp_path: Path) -> None:
    """MJCF with a mesh in cm and no scale, its door a box in metres: --unit cm, and the hinge stays
    (newton-physics/mujoco-usd-converter #79 is of such meshes)."""
    folder = tmp_path / "in"
    folder.mkdir()
    carcass(100).export(folder / "carcass.stl")
    write(
        folder / "cabinet.xml",
        '<mujoco model="cabinet"><asset><mesh name="carcass" file="carcass.stl"/></asset><worldbody>'
        '<body name="cabinet"><geom type="mesh" mesh="carcass"/><body name="door" pos="-0.2 -0.15 0.3">'
        '<joint name="hinge" axis="0 0 1" range="0 90"/><geom type="box" pos="0.2 -0.01 0" size="0.2 0.01 0.28"/>'
        "</body></body></worldbody></mujoco>",
    )
    unit_is_followed(folder, tmp_path, "cm")


def test_meshes_in_inches_in_urdf_with_a_slide(tmp_path: Path) -> None:
    """URDF with meshes in inches and a drawer that slides 0.25 m: --unit inch leaves the way it goes
    (yanshil/Fusion2PyBullet #2)."""
    folder = tmp_path / "in"
    write(folder / "meshes" / "body.obj", "")
    carcass(1 / 0.0254).export(folder / "meshes" / "body.obj")
    drawer = trimesh.creation.box((0.36 / 0.0254, 0.02 / 0.0254, 0.2 / 0.0254))
    drawer.export(folder / "meshes" / "drawer.obj")

    def shape(name: str) -> str:
        geometry = f'<geometry><mesh filename="meshes/{name}.obj"/></geometry>'
        return f"<visual>{geometry}</visual><collision>{geometry}</collision>"

    write(
        folder / "cabinet.urdf",
        f'<robot name="cabinet"><link name="body">{shape("body")}</link><link name="drawer">{shape("drawer")}</link>'
        '<joint name="slide" type="prismatic"><parent link="body"/><child link="drawer"/>'
        '<origin xyz="0 -0.16 0.4"/><axis xyz="0 -1 0"/><limit lower="0" upper="0.25" effort="1" velocity="1"/></joint>'
        "</robot>",
    )

    def right(model: dict[str, Any]) -> None:
        is_size(model, 0.40, 0.32, 0.60)
        (slide,) = model["joints"]
        assert abs(slide["upper"] - 0.25) < 1e-6
        low = min(state["box_minimum"][1] for state in model["states"])
        assert abs(low + 0.16 + 0.25) < 1e-3, low
        high = max(state["box_maximum"][2] for state in model["states"])
        assert abs(high - 0.6) < 1e-3

    added = add(folder, tmp_path / "out")
    if "inch" in advised(added.text, "--unit"):
        right(add(folder, tmp_path / "again", "--unit", "inch").only)
    else:
        right(added.only)


@pytest.mark.parametrize("option", ["--class-name", "--unknown", "--mapping"])
def test_a_class_that_nothing_tells(tmp_path: Path, option: str) -> None:
    """A CAD export called assembly_v3: three ways are named, each brings it in (yanshil/Fusion2PyBullet #2)."""
    folder = tmp_path / "in"
    folder.mkdir()
    carcass(1).export(folder / "assembly_v3.stl")
    added = add(folder, tmp_path / "out")
    assert not added.models and added.names(option), added.text
    if option == "--mapping":
        value = str(write(tmp_path / "classes.toml", '[models]\n"assembly_v3*" = "cabinet"\n'))
    else:
        value = {"--class-name": "cabinet", "--unknown": "object"}[option]
    model = add(folder, tmp_path / "again", option, value).only
    assert model["class_name"] == ("object" if option == "--unknown" else "cabinet")
    is_size(model, 0.4, 0.3, 0.6)


def test_a_buffer_of_gltf_that_is_not_there(tmp_path: Path) -> None:
    """scene.gltf came without scene.bin (Siccity/GLTFUtility #209 is of such sets): the missing file is named, and
    with it the model is right."""
    folder = tmp_path / "in" / "table"
    folder.mkdir(parents=True)
    mesh = trimesh.creation.box(bounds=((-0.4, 0.0, -0.3), (0.4, 0.75, 0.3)))
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh)).items():
        (folder / name.replace("model", "table")).write_bytes(data)
    buffer = min(folder.glob("*.bin"))
    hidden = tmp_path / buffer.name
    shutil.move(buffer, hidden)
    added = add(tmp_path / "in", tmp_path / "out")
    assert not added.models and added.names(buffer.name), added.text
    shutil.move(hidden, buffer)
    is_size(add(tmp_path / "in", tmp_path / "again").only, 0.8, 0.6, 0.75)


def no_exception_is_passed_on(added: Added) -> None:
    for word in ("KeyError", "IndexError", "ValueError", "TypeError", "struct.error", "JSONDecodeError", "out of range",
                 "NoneType", "unpack", "buffer"):  # fmt: skip
        assert word not in added.text, added.text


@pytest.mark.parametrize("damage", ["html instead of the model", "a pointer of git lfs", "cut in the middle"])
def test_files_that_are_no_models(tmp_path: Path, damage: str) -> None:
    """A download page, a pointer of Git LFS or half a file under a model's name (RobotLocomotion/drake #7701 has such
    pointers): said for what it is, no exception of a library passed on."""
    folder = tmp_path / "in" / "table"
    folder.mkdir(parents=True)
    whole = trimesh.Scene(trimesh.creation.box((0.8, 0.6, 0.75))).export(file_type="glb")
    data = {
        "html instead of the model": b"<!DOCTYPE html><html><body>404</body></html>\n",
        "a pointer of git lfs": b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n",
        "cut in the middle": whole[: len(whole) // 2],
    }[damage]
    (folder / "table.glb").write_bytes(data)
    added = add(tmp_path / "in", tmp_path / "out")
    assert not added.models and added.names("table.glb"), added.text
    no_exception_is_passed_on(added)


# ---- masks -----------------------------------------------------------------------------------------------------------


def test_results_without_names_of_classes(plain: Path, tmp_path: Path) -> None:
    """COCO's list of results has category ids and no names: a class file is asked for, and with it they are right
    (facebookresearch/detectron2 #347)."""
    root = tmp_path / "masks"
    root.mkdir()
    rows = [
        {"image_id": k, "category_id": number, "segmentation": runs(TRUE[k] == number), "score": 0.9}
        for k in range(COUNT)
        for number in np.unique(TRUE[k]).tolist()
    ]
    (root / "results.json").write_text(json.dumps([row | {"category_id": row["category_id"] + 500} for row in rows]))
    said = segment(plain, root, tmp_path / "none")
    assert said.code == 3 and said.names(r"classes\.(json|txt)"), said.text
    (root / "classes.json").write_text(json.dumps({str(number + 500): name for number, name in NAMES.items()}))
    assert segment(plain, root, tmp_path / "segments").code == 0
    assert min(overlaps(tmp_path / "segments").values()) > 0.8


def test_masks_of_the_network_s_size(plain: Path, tmp_path: Path) -> None:
    """Masks at half the size of the pictures: the message says how to scale them, and scaled so they are right
    (open-mmlab/mmsegmentation #1485)."""
    import cv2

    root = tmp_path / "masks"
    for k, image in enumerate(TRUE):
        write_ids(root / f"{k:06d}.png", image[::2, ::2].astype(np.uint8))
    (root / "classes.json").write_text(json.dumps({str(number): name for number, name in NAMES.items()}))
    said = segment(plain, root, tmp_path / "none")
    if said.code != 0:
        assert said.names("80x60|80 x 60", "160x120|160 x 120", "nearest"), said.text
        for k, image in enumerate(TRUE):
            small = image[::2, ::2].astype(np.uint8)
            size = (image.shape[1], image.shape[0])
            write_ids(root / f"{k:06d}.png", cv2.resize(small, size, interpolation=cv2.INTER_NEAREST))
        said = segment(plain, root, tmp_path / "segments")
        assert said.code == 0, said.text
    assert min(overlaps(tmp_path / ("segments" if (tmp_path / "segments").exists() else "none")).values()) > 0.75


def test_a_polygon_is_written_as_the_message_says(plain: Path, tmp_path: Path) -> None:
    """The call that the message names for polygons is made with pycocotools, and what it gives is read and right; or
    polygons are read (cvat-ai/cvat #6014)."""
    coco = pytest.importorskip("pycocotools.mask")
    from tests.strangers.pictures import outline

    images = [{"id": k, "file_name": f"{k:06d}.jpg", "height": 120, "width": 160} for k in range(COUNT)]

    def written(root: Path, encode: Any) -> Said:
        rows = []
        for k in range(COUNT):
            for number in np.unique(TRUE[k]).tolist():
                mask = TRUE[k] == number
                polygons = [part.reshape(-1).tolist() for part in outline(mask)]
                shape = encode(polygons) if number != 1 else runs(mask)
                rows.append({"id": len(rows) + 1, "image_id": k, "category_id": number, "segmentation": shape,
                             "iscrowd": 0, "score": 1.0})  # fmt: skip
        write_coco(root, images, rows)
        return segment(plain, root, tmp_path / f"segments_{root.name}")

    said = written(tmp_path / "polygons", lambda polygons: polygons)
    if said.code == 0:
        assert min(overlaps(tmp_path / "segments_polygons").values()) > 0.8
        return
    assert said.names("frPyObjects", "merge"), f"encode takes no polygon: {said.text}"

    def merged(polygons: list[list[float]]) -> dict[str, Any]:
        code = coco.merge(coco.frPyObjects(polygons, 120, 160))
        return {"size": [120, 160], "counts": code["counts"].decode()}

    assert written(tmp_path / "runs", merged).code == 0
    assert min(overlaps(tmp_path / "segments_runs").values()) > 0.8
