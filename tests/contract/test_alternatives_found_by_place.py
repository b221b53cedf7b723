"""What lies in its folder is found: backends, layouts, formats, exporters, actions. Nothing else is edited."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from scenewright.stages.kit.declared import declared_in
from scenewright.stages.segment.registry import BackendDeclaration, all_backends

REPOSITORY = Path(__file__).resolve().parents[2]


def with_plugin(package: str, folder: Path, code: str) -> str:
    """Run code in a process of its own in which `folder` belongs to `package` too; return what it prints."""
    opened = f"import {package} as package; package.__path__.append({str(folder)!r})\n"
    done = subprocess.run([sys.executable, "-c", opened + code], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def help_of(command: str) -> str:
    """Code that prints the help of a command."""
    return f"from scenewright.cli.main import run; run([{command!r}, '--help'])\n"


def write(folder: Path, **modules: str) -> Path:
    """Write a package of modules."""
    folder.mkdir()
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)
    return folder


def test_a_backend(tmp_path: Path) -> None:
    write(
        tmp_path / "two_spots",
        __init__="""
from pydantic import Field
from scenewright.stages.kit.stage import Extra, Parameters
from scenewright.stages.segment.registry import BackendDeclaration
class SpotParameters(Parameters):
    spot_size: int = Field(3, ge=1, description="Diameter of a spot [pixels]")
BACKEND = BackendDeclaration(
    name="two-spots", summary="two spots a frame", order=1, automatic=True, weights="a file of spots",
    parameters=SpotParameters, exclusive=("spot_size",), libraries=("spotlib",),
    extras=(Extra("spotlib", "spotlib", "segment --backend two-spots: make some spots"),),
)
""",
        backend="""
from scenewright.stages.segment.backends.two_spots import SpotParameters
class Spots:
    name, label, streams = "two-spots", "", ("depth",)
def open_backend(request):
    backend = Spots()
    backend.label = f"spots of {request.own(SpotParameters).spot_size}"
    return backend
""",
    )
    printed = with_plugin(
        "scenewright.stages.segment.backends",
        tmp_path,
        help_of("segment")
        + """
import scenewright.stages.engine.diagnosis as diagnosis
diagnosis.CORE, diagnosis.EXTRAS = {}, {}
print([check.remedy for check in diagnosis.diagnose() if check.name == "spotlib"])
from scenewright.schemas.errors import UsageError
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.parameters import STAGE, SegmentParameters
from scenewright.stages.segment.registry import versions
from scenewright.stages.kit.configuration import parameters_for
for name in ("two-spots", "auto"):
    parameters = SegmentParameters(backend=name, spot_size=5)
    print(choose_backend(BackendRequest(parameters)).label, versions(parameters))
for given in ({"backend": "two-spot"}, {"backend": "geometric", "spot_size": 4}):
    try:
        choose_backend(BackendRequest(parameters_for(STAGE, given)))
    except UsageError as error:
        print(error.message)
""",
    )
    words = " ".join(printed.split())
    assert "`two-spots`: two spots a frame" in words and "--spot-size" in words and "Diameter of a spot" in words
    assert "a file of spots (two-spots)" in words
    assert "['segment --backend two-spots: make some spots']" in words
    assert words.count("spots of 5 {'spotlib': 'absent'") == 2
    assert "did you mean two-spots? one of two-spots, " in words
    assert "--spot-size is for --backend two-spots alone" in words


def test_a_log_layout(tmp_path: Path) -> None:
    write(
        tmp_path / "crumbs",
        __init__="""
from scenewright.stages.ingest.registry import LogLayout
LAYOUT = LogLayout("crumbs", order=5, recognised_by="crumbs.txt", reader=f"{__name__}.reader")
""",
        reader="""
from scenewright.stages.ingest.source import LogSource
def matches(path):
    return "folder with crumbs.txt" if (path / "crumbs.txt").is_file() else None
def open_source(path, parameters, rule):
    return LogSource(format="crumbs", rule=rule, cameras=(), entries=())
""",
    )
    log, nothing = tmp_path / "log", tmp_path / "nothing"
    for folder in (log, nothing):
        folder.mkdir()
    (log / "crumbs.txt").write_text("")
    printed = with_plugin(
        "scenewright.stages.ingest.layouts",
        tmp_path,
        help_of("ingest")
        + f"""
from pathlib import Path
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
for name in ("auto", "crumbs"):
    print(open_log(Path({str(log)!r}), IngestParameters(format=name)).rule)
try:
    open_log(Path({str(nothing)!r}), IngestParameters())
except BadInput as error:
    print(error.message)
""",
    )
    words = " ".join(printed.split())
    assert "one of auto, crumbs, mcap," in words
    assert words.count("folder with crumbs.txt") == 2
    assert "in a format that is known (crumbs, mcap" in words


def test_an_export_format(tmp_path: Path) -> None:
    write(
        tmp_path / "pebbles",
        __init__="""
from scenewright.stages.export.registry import SequenceFormat
FORMAT = SequenceFormat("pebbles", order=99, layout="pebbles", summary="a line a frame", streams=("pose",), log="p.txt")
""",
        writer="""
def write(job):
    for frame in job.frames:
        job.tally.frames += 1
        job.tally.streams.add("pose")
    (job.root / "p.txt").write_text(str(job.tally.frames))
""",
    )
    printed = with_plugin(
        "scenewright.stages.export.formats",
        tmp_path,
        help_of("export")
        + f"""
from pathlib import Path
from tests.unit.export.sequences import export, write_sequence
made = export(write_sequence(Path({str(tmp_path)!r}) / "s"), Path({str(tmp_path)!r}) / "out", layout="pebbles")
print(made.info.layout, made.info.log, made.info.streams, made.path("p.txt").read_text() == str(made.info.frame_count))
""",
    )
    words = " ".join(printed.split())
    assert "one of tum, nerfstudio, mcap, coco, pebbles" in words
    assert "pebbles p.txt ('pose',) True" in words


def test_a_scene_exporter(tmp_path: Path) -> None:
    write(
        tmp_path / "exporters",
        names="""
from scenewright.stages.urdf.exports import SceneExporter
def _write(path, scene):
    path.write_text(" ".join(link.name for link in scene.urdf.links))
EXPORTER = SceneExporter("names", order=99, file="names.txt", write=_write)
""",
    )
    printed = with_plugin(
        "scenewright.stages.urdf.exporters",
        tmp_path / "exporters",
        f"""
from pathlib import Path
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.urdf.exports import scene_exporters, write_exports
root = Path({str(tmp_path)!r}) / "scene"
root.mkdir()
write_exports(root, write_scene_bundle(root, [], ContactGraphFile(nodes=(), links=())))
print([exporter.name for exporter in scene_exporters()], (root / "names.txt").read_text())
""",
    )
    assert "['srdf', 'glb', 'mcap', 'names'] world" in printed


def test_an_action_of_the_planner(tmp_path: Path) -> None:
    """Its symbols are in the domain, its motion in the refinement, its look at the room in the execution."""
    write(
        tmp_path / "actions",
        wipe="""
import numpy as np
from scenewright.schemas.plan import Check
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.action import PlanAction
from scenewright.stages.kit.motion.segments import Manipulation, Segment
class Wipe(PlanAction):
    name, order, predicates = "wipe", 90, {"wiped": ("support",)}
    goals = {"wiped": lambda goal: Check(condition=goal.literal, holds=True, detail="shines")}
    schemas = (Schema("wipe", (("?on", "support"),), (("near", "?on"), ("hand_empty",)), (("wiped", "?on"),), ()),)
    def manipulate(self, model, state, request):
        return (Manipulation(np.zeros(3), (Segment(np.zeros((1, 10)), 0.0, label=request.arguments[0]),)),)
    def check_effect(self, conduct, arguments):
        raise MotionFailed("condition_not_met", f"{arguments[0]} is dirty")
ACTION = Wipe()
""",
    )
    printed = with_plugin(
        "scenewright.stages.plan.actions",
        tmp_path / "actions",
        """
from types import SimpleNamespace
import numpy as np
from scenewright.schemas.plan import BodyMatch
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.tasks.strips import Problem, ground
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan import refinement
from scenewright.stages.plan.conduct import Conduct
from scenewright.stages.plan.domain import DOMAIN
from scenewright.stages.plan.goal_checks import check_goal
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.symbols import parse_goal
from scenewright.stages.plan.world_model import RobotState
OBJECTS = {"start": "spot", "table": "surface"}
at_start = frozenset({("near", "start"), ("hand_empty",), ("reachable", "table")})
problem = Problem("scene", OBJECTS, at_start, parse_goal(("wiped(table)",), OBJECTS)[0])
actions = plan_task(problem, ground(DOMAIN, problem), heuristic="max", limit=99).actions
print([action.text for action in actions])
refinement.drive_way = lambda *_: np.zeros((1, 3))
checker = SimpleNamespace(allow=lambda touch: None, put_down=lambda: None)
model = SimpleNamespace(snapshot=lambda: None, restore=lambda before: None, checker=checker, room=None)
state, random = RobotState(np.zeros(3), np.zeros(7)), np.random.default_rng(0)
world, match = SimpleNamespace(bodies={"desk": SimpleNamespace(joints=())}), BodyMatch(body="table", matched="desk")
print(check_goal(world, ("wiped(table)",), {"table": match}, {}, None, lambda literal: None)[0].detail)
for step in refinement.refine_plan(model, state, actions, Budgets(1, 1, 1, 1), random):
    print(step.text, step.segments[0].label)
    try:
        Conduct._check_effect(None, step.name, step.arguments)
    except MotionFailed as failed:
        print(failed.failure.message)
""",
    )
    assert "['drive(start, table)', 'wipe(table)']" in printed
    assert "wipe(table) table" in printed and "table is dirty" in printed and "shines" in printed


def test_a_training(tmp_path: Path) -> None:
    write(
        tmp_path / "spots",
        __init__="""
from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters
class SpotsTraining(TrainingParameters):
    rounds: int = Field(3, ge=1, description="Rounds")
TRAINING = TrainingDeclaration("spots", "spots of a kind", __name__, SpotsTraining)
""",
        train="def train(options, out):\n    (out / 'spots').write_text(f'{options.rounds} {options.quick}')\n",
    )
    made = tmp_path / "made"
    printed = with_plugin(
        "scenewright.stages.segment.training",
        tmp_path,
        f"""
import sys
from scenewright.cli.main import run
run(["train"]); run(["train", "spots", "--help"])
print([name for name in sys.modules if name.endswith(".train")])
assert run(["train", "spots", "--rounds", "0", "--out", {str(made)!r}]) == 2
assert run(["train", "spots", "--rounds", "5", "--quick", "--out", {str(made)!r}]) == 0
""",
    )
    assert "spots of a kind" in printed and "--rounds" in printed and "\n[]\n" in printed
    assert (made / "spots").read_text() == "5 True"


def test_what_declares_nothing_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import scenewright.stages.segment.backends as package

    write(tmp_path / "silent", __init__="")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    with pytest.raises(RuntimeError, match=r"backends\.silent declares no BACKEND"):
        declared_in("scenewright.stages.segment.backends", BackendDeclaration, "BACKEND", "scenewright.backends")
    (tmp_path / "silent" / "__init__.py").write_text("from scenewright.stages.segment.backends.onnx import BACKEND")
    sys.modules.pop("scenewright.stages.segment.backends.silent")
    with pytest.raises(RuntimeError, match="'onnx' is declared twice"):
        declared_in("scenewright.stages.segment.backends", BackendDeclaration, "BACKEND", "scenewright.backends")
    sys.modules.pop("scenewright.stages.segment.backends.silent")


def test_a_backend_needs_no_weights_to_be_automatic() -> None:
    """`auto` is the first by order of those that may be taken unasked: the network of our own, today."""
    assert [declared.name for declared in all_backends() if declared.automatic] == ["network"]
