"""What cases start from: a small artifact of every kind, each made by its step, and files as people bring them.

`python -m tests.fuzz.commands.base FOLDER` makes them (some minutes); what is up to date stays. With
--keep, what the corpus needs of them goes into the repository.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.fuzz.harness import CORPUS

REPOSITORY = Path(__file__).resolve().parents[3]
SMALL = "--width 96 --height 72 --seed 3 --clutter low"
ALL = (
    "--ground-truth @truth --sequence @sequence --segments @segments --panoptic-map @map --contact-graph @graph "
    "--cad-scene @cad --cad-library @library --interactive-scene @urdf --plan @plan"
)
SEEN = "--sequence @needle_scene"


@dataclass(frozen=True)
class Run:
    """One command line; its `--out` is the folder `name`, and a word `@name` in it the output of another."""

    name: str
    step: str
    options: str = ""


RUNS = (
    Run("library", "library build", "--shapes-per-class 2 --small-shapes-per-class 2 --seed 1"),
    Run("truth", "synthesize", f"--library @library --frames 8 {SMALL}"),
    Run("stereo", "synthesize", f"--library @library --frames 2 {SMALL} --stereo-baseline 0.1"),
    Run("sequence", "ingest", "--log @truth/log.mcap"),
    Run("stereo_sequence", "ingest", "--log @stereo/log.mcap"),
    Run("disparity", "disparity", "--sequence @stereo_sequence"),
    Run("segments", "segment", "--sequence @sequence --backend ground-truth --corruption 0.1"),
    Run("map", "fuse", "--sequence @sequence --segments @segments --voxel-size 0.08 --snapshot-every 4"),
    Run("graph", "graph", "--panoptic-map @map"),
    Run("cad", "cad", "--contact-graph @graph --panoptic-map @map --library @library"),
    Run("urdf", "urdf", "--cad-scene @cad"),
    Run("plan", "plan", "--scene @urdf --ground-truth @truth"),
    Run("evaluation", "evaluate", ALL),
    Run("report", "report", f"{ALL} --evaluation @evaluation"),
    Run("poses", "poses", "--sequence @sequence"),
    Run("tum", "export", "--sequence @sequence --layout tum"),
    Run("scene_sdf", "export scene", "--to sdf --scene @urdf"),
    Run("packing", "pack", "--proposer backtrack --seed 3"),
    Run("table", "tableware scene", "--tier tier0_cups --seed 5"),
    Run("seen", "tableware detect", "@table"),
    Run("table_plan", "tableware plan", "--detections @seen --draws 2 --image-width 300"),
    Run("table_trial", "tableware simulate", "--scene @table --plan @table_plan --image-width 300"),
    Run("table_evaluation", "tableware evaluate", "--tier tier2 --scenes 1 --draws 1 --chances thesis_spills"),
    Run("needle_scene", "suture scene", "--frames 1 --seed 2000"),
    Run("needle_disparity", "disparity", SEEN),
    Run("needle", "suture needle", f"{SEEN} --disparity @needle_disparity"),
    Run("thread", "suture thread", f"{SEEN} --needle @needle"),
    Run("trial", "suture simulate", "--seed 3"),
    Run("suture_evaluation", "suture evaluate", "--trials @trial --scene @needle_scene --needle @needle"),
)
FOREIGN = "foreign"
"""Folder of what people bring; its parts are named like the artifacts."""


KEPT = ("sequence", "segments", "urdf")
"""What the cases of the corpus start from, kept in the repository."""
ARCHIVE = CORPUS / "base.zip"
FIXED_TIME = (1980, 1, 1, 0, 0, 0)


def keep(folder: Path) -> None:
    """Put what the corpus starts from into the repository (by hand, when a schema version was raised)."""
    with zipfile.ZipFile(ARCHIVE, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for path in sorted(path for name in KEPT for path in (folder / name).rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), FIXED_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, path.read_bytes())


def take(folder: Path) -> None:
    """Lay out what the corpus starts from."""
    with zipfile.ZipFile(ARCHIVE) as archive:
        for name in archive.namelist():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(archive.read(name))


def make(folder: Path) -> None:
    """Make whatever is missing under `folder`. Raises RuntimeError when a step fails."""
    folder.mkdir(parents=True, exist_ok=True)
    for run in RUNS:
        words = [str(folder / word[1:]) if word.startswith("@") else word for word in run.options.split()]
        command = [
            sys.executable,
            "-m",
            "scenewright",
            *run.step.split(),
            *words,
            "--out",
            str(folder / run.name),
            "--quiet",
        ]
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
        done = subprocess.run(command, cwd=REPOSITORY, env=environment, capture_output=True, text=True)
        if done.returncode not in (0, 4):
            raise RuntimeError(f"{run.name}: exit {done.returncode}: {done.stderr[-500:]}")
        print(f"{run.name}: exit {done.returncode}", file=sys.stderr, flush=True)
    make_foreign(folder)


def make_foreign(folder: Path) -> None:
    """Write what people bring, out of the artifacts."""
    foreign = folder / FOREIGN
    shutil.rmtree(foreign, ignore_errors=True)
    for writer in (_models, _settings, _packing, _supports, _masks, _scan):
        writer(folder, foreign)


def _models(folder: Path, foreign: Path) -> None:
    import trimesh

    models = foreign / "models"
    library = folder / "library" / "models"
    names = sorted(path.name for path in library.iterdir())
    chosen = [next(name for name in names if name.startswith(start)) for start in ("fridge", "cup", "table")]
    for name in chosen:
        shutil.copytree(library / name, models / name)
    box = trimesh.creation.box((0.4, 0.3, 0.2))
    (models / "crate").mkdir()
    box.export(models / "crate" / "model.obj")
    (models / "ball").mkdir()
    trimesh.creation.icosphere(1, 0.1).export(models / "ball" / "model.stl")
    (models / "stool").mkdir()
    trimesh.creation.cylinder(0.2, 0.5).export(models / "stool" / "model.glb")
    (models / "lamp").mkdir()
    trimesh.creation.cone(0.2, 0.5).export(models / "lamp" / "model.ply")
    (models / "desk").mkdir()
    (models / "desk" / "desk.xml").write_text(
        '<mujoco><worldbody><body name="desk"><geom type="box" size="0.5 0.3 0.02" pos="0 0 0.7"/>'
        '<body name="drawer" pos="0 -0.1 0.6"><joint name="slide" type="slide" axis="0 -1 0" range="0 0.3"/>'
        '<geom type="box" size="0.2 0.2 0.05"/></body></body></worldbody></mujoco>'
    )
    (foreign / "mapping").mkdir()
    (foreign / "mapping" / "mapping.toml").write_text(
        '[crate]\nclass = "bin"\nunit = 1.0\nup = "z"\nfront = "-y"\n[ball]\nclass = "vase"\n[stool]\nclass = "chair"\n'
    )


def _settings(folder: Path, foreign: Path) -> None:
    settings = foreign / "settings"
    settings.mkdir(parents=True)
    (settings / "batch.toml").write_text(
        'pipeline = "demo"\nseeds = "1-2"\nseed_variable = "seed"\nshuffle_seed = 0\n[set]\nframes = 3\n'
        '[[parameters]]\nname = "coarse"\nset = { voxel_size = 0.04 }\n[limits]\ntime = "20 min"\nmemory = "4 GiB"\n'
        'grace = "10 s"\nstop_after_failures = 20\n[executor]\nkind = "local"\njobs = 1\nthreads = 1\n'
    )
    shutil.copy(REPOSITORY / "data" / "pipelines" / "demo.toml", settings / "chain.toml")
    (settings / "config.toml").write_text("every = 1\n")
    shutil.copy(REPOSITORY / "data" / "stitch" / "perception_ours.toml", settings / "perception.toml")
    shutil.copy(REPOSITORY / "data" / "labels" / "words.toml", settings / "labels.toml")
    (settings / "words.txt").write_text("chair\ntable\nfloor\n")


def _packing(folder: Path, foreign: Path) -> None:
    problem = {
        "boxes": [{"name": "tin", "width": 0.08, "length": 0.06, "height": 0.1, "x": 0.4, "y": -0.2, "yaw": 0.0}],
        "basket": {"low": [0.55, -0.08], "high": [0.75, 0.08]},
        "obstacles": [{"name": "post", "low": [0.6, 0.0], "high": [0.62, 0.03], "top": 0.1}],
    }
    (foreign / "packing").mkdir(parents=True)
    (foreign / "packing" / "problem.json").write_text(json.dumps(problem))
    transcript = folder / "packing" / "transcript.jsonl"
    if transcript.exists():
        shutil.copy(transcript, foreign / "packing" / "transcript.jsonl")


def _supports(folder: Path, foreign: Path) -> None:
    (foreign / "supports").mkdir(parents=True)
    box = {"center": [0, 0, 0], "size": [5, 4, 0.1]}
    table = {"center": [1, 0, 0.4], "size": [1.4, 0.8, 0.8], "yaw_degrees": 30}
    annotation = {
        "format": "scenewright-supports",
        "version": 1,
        "scene": "kitchen",
        "made": {"by": "Ada", "how": "by eye", "date": "2026-11-22"},
        "nodes": [
            {"name": "floor", "class": "floor", "find": {"box": box}},
            {"name": "table", "class": "table", "find": {"box": table}},
            {"name": "mug", "class": "cup", "find": {"box": {"center": [1, 0, 0.9], "size": [0.2, 0.2, 0.2]}}},
        ],
        "relations": [
            {"child": "table", "parent": "floor"},
            {"child": "mug", "parent": "table", "leans_on": ["table"]},
        ],
    }
    (foreign / "supports" / "supports.json").write_text(json.dumps(annotation))


def _masks(folder: Path, foreign: Path) -> None:
    import cv2

    masks, stacks, eyes = foreign / "masks", foreign / "stacks", foreign / "eyes"
    for place in (masks, stacks, eyes):
        place.mkdir(parents=True)
    ids = np.zeros((72, 96), np.uint8)
    ids[20:50, 30:60], ids[50:, :] = 1, 2
    for frame in range(8):
        cv2.imwrite(str(masks / f"{frame:06d}.png"), ids)
        np.savez_compressed(
            stacks / f"{frame:06d}.npz",
            masks=np.stack([ids == 1, ids == 2]),
            classes=np.array(["chair", "floor"]),
            scores=np.array([0.9, 0.8]),
        )
    (masks / "classes.json").write_text(json.dumps({"1": "chair", "2": "floor"}))
    from scenewright.stages.engine.loading import load, payload

    sequence = load(folder / "needle_scene")
    with payload(sequence, "frames.mcap") as reader:
        shape = reader.read(0, ("color",)).color.shape[:2]
    for side in ("left", "right"):
        seen = np.zeros(shape, np.uint8)
        seen[shape[0] // 2 - 20 : shape[0] // 2 + 20, shape[1] // 2 - 30 : shape[1] // 2 + 30] = 255
        cv2.imwrite(str(eyes / f"000000_{side}.png"), seen)


def _scan(folder: Path, foreign: Path) -> None:
    """Points that others annotated, and SceneNN's mesh with its labels."""
    from tests.unit.truth import scenenn_folder

    (foreign / "scan").mkdir(parents=True)
    rng = np.random.default_rng(0)
    floor = rng.uniform((-1, -1, 0), (1, 1, 0.01), (400, 3))
    box = rng.uniform((0, 0, 0), (0.4, 0.4, 0.4), (400, 3))
    np.savez_compressed(
        foreign / "scan" / "points.npz",
        points=np.concatenate([floor, box]).astype(np.float32),
        instance=np.repeat([1, 2], 400).astype(np.int32),
        id=np.array([1, 2], np.int32),
        classes=np.array(["floor", "box"]),
    )
    (foreign / "scenenn").mkdir()
    (foreign / "scenenn" / "011.xml").write_text(scenenn_folder.annotation())
    (foreign / "scenenn" / "011.ply").write_bytes(scenenn_folder.ply_bytes(*scenenn_folder.labelled_mesh(), text=True))


def names_of(folder: Path) -> list[str]:
    """Return the names of everything that a case may read."""
    return [run.name for run in RUNS] + sorted(path.name for path in (folder / FOREIGN).iterdir())


def place_of(folder: Path, name: str) -> Path:
    """Return where a base artifact, or a thing from outside, stands."""
    return folder / FOREIGN / name if (folder / FOREIGN / name).exists() else folder / name


if __name__ == "__main__":
    make(Path(sys.argv[1]).resolve())
    if "--keep" in sys.argv[2:]:
        keep(Path(sys.argv[1]).resolve())
