"""Every step, found by folder: documented, cheap to load, helped, keyed alike in every process."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.schemas.kinds import KINDS
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.json_schemas import json_schemas
from scenewright.stages.engine.keys import artifact_key
from scenewright.stages.kit.stage import Stage

REPOSITORY = Path(__file__).resolve().parents[2]
STAGES = sorted(all_stages().values(), key=lambda stage: stage.name)
HEAVY = ("open3d", "torch", "cv2", "pybullet", "trimesh", "numba", "scipy", "matplotlib", "yourdfpy", "pycolmap")

each_step = pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_the_chain_is_there() -> None:
    expected = {"library build", "synthesize", "ingest", "segment", "fuse", "graph", "cad", "urdf", "plan", "evaluate"}
    assert expected | {"report"} <= set(all_stages())


def test_every_kind_of_the_chain_has_a_maker() -> None:
    made = {stage.writes.kind for stage in STAGES}
    assert set(KINDS) - made <= {"trajectory"} | {k for k in KINDS if k.startswith("test_")}


@each_step
def test_every_parameter_is_documented_and_has_a_default(stage: Stage) -> None:
    assert stage.summary and stage.summary[0].isupper()
    for name, field in stage.parameters.model_fields.items():
        assert field.description, f"{stage.name}: {name} has no description"
        assert not field.is_required(), f"{stage.name}: {name} has no default"
    stage.parameters()


@each_step
def test_help_names_every_option(stage: Stage, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*stage.name.split(), "--help"]) == 0
    shown = capsys.readouterr().out
    for name in [*stage.parameters.model_fields, *stage.reads, "out", "seed", "config", "dry_run", "json"]:
        assert "--" + name.replace("_", "-") in shown


def test_keys_are_the_same_in_another_process() -> None:
    keys = (
        "{name: artifact_key(stage, stage.parameters(), {'a': 'b'}, 3, 'cpu') for name, stage in all_stages().items()}"
    )
    there = python(
        "import json\n"
        "from scenewright.stages.engine.discovery import all_stages\n"
        "from scenewright.stages.engine.keys import artifact_key\n"
        f"print(json.dumps({keys}))"
    )
    here = {stage.name: artifact_key(stage, stage.parameters(), {"a": "b"}, 3, "cpu") for stage in STAGES}
    assert json.loads(there) == here


def test_help_loads_no_heavy_library() -> None:
    loaded = json.loads(
        python(
            "import sys, json, scenewright.cli.application as a; a.build_application();"
            f"print(json.dumps([m for m in {HEAVY!r} if m in sys.modules]))"
        )
    )
    assert loaded == []


def test_json_schemas_are_current() -> None:
    folder = REPOSITORY / "schemas" / "json"
    expected = json_schemas()
    for name, text in expected.items():
        assert (folder / name).read_text() == text, f"{name} is stale: make rules"
    assert {path.name for path in folder.glob("*.json")} == set(expected)


def test_no_dangerous_calls_anywhere() -> None:
    """No pickle, no exec or eval, no unsafe torch.load, np.load or yaml.load in our code."""
    for path in [p for top in ("cli", "stages", "schemas", "benchmarks") for p in (REPOSITORY / top).rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [alias.name for alias in node.names] + [getattr(node, "module", "") or ""]
                assert not {"pickle", "dill", "marshal", "shelve"} & set(names), path
            if isinstance(node, ast.Call):
                name = ast.unparse(node.func)
                assert name not in ("eval", "exec", "os.system", "yaml.load"), f"{path}:{node.lineno}"
                keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
                assert keywords.get("shell") != "True", f"{path}:{node.lineno}"
                if name in ("np.load", "numpy.load"):
                    assert keywords.get("allow_pickle", "False") == "False", f"{path}:{node.lineno}"
                if name == "torch.load":
                    assert keywords.get("weights_only") == "True", f"{path}:{node.lineno}"
