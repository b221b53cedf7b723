"""A step, a kind with its viewer, and a report section are what their folders hold: in a copy of the tree one of each
is added, and everything that lists them finds it without another edit."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
TESTS = ("contract/__init__.py", "contract/test_floors.py", "golden/__init__.py", "golden/test_golden.py")
NEW_FILES = {
    "schemas/novelty.py": """
from typing import ClassVar
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model

class NoveltyFile(Model):
    text: str

class Novelty(Artifact):
    kind: ClassVar[str] = "novelty"
    description: ClassVar[str] = "something new"
    info = Document(NoveltyFile, "novelty.json")
""",
    "stages/brandnew/__init__.py": "",
    "stages/brandnew/parameters.py": """
from pydantic import Field
from scenewright.schemas.novelty import Novelty
from scenewright.stages.kit.estimates import Estimate
from scenewright.stages.kit.stage import Parameters, Stage

class BrandnewParameters(Parameters):
    text: str = Field("hello", description="What it says")

STAGE = Stage("brandnew", "Something new", BrandnewParameters, {}, Novelty,
              estimate=lambda parameters, inputs: Estimate(3.0, 0.0, 1.0))
""",
    "stages/brandnew/stage.py": """
import numpy as np
from scenewright.schemas.novelty import Novelty, NoveltyFile

def run(*, parameters, context):
    NoveltyFile(text=parameters.text).write(context.output / "novelty.json")
    np.savez(context.output / "numbers.npz", one=np.ones(3))
    return Novelty(context.output)
""",
    "cli/viewing/novelty_view.py": """
def draw_novelty(novelty, canvas):
    canvas.document("novelty", novelty.info.text)
""",
    "stages/report/sections/novelty/__init__.py": "",
    "stages/report/sections/novelty/section.py": """
from scenewright.schemas.novelty import Novelty
from scenewright.stages.report.section import Section

SECTION = Section("novelty", "A novelty", order=1, reads={"novelty": Novelty}, became={"novelty": "a novelty"},
                  alone="All new")
""",
    "stages/report/sections/novelty/view.py": """
from scenewright.schemas.novelty import Novelty

def view(page):
    return {"text": page.given("novelty", Novelty).info.text}
""",
    "stages/report/sections/novelty/section.html.j2": '<section id="novelty">{{ text }}</section>',
}
TUTORIAL = REPOSITORY / "docs" / "tutorials" / "new_step.md"


def files_of_the_tutorial() -> dict[str, str]:
    """Return path -> text of the files that the tutorial about a new step shows."""
    blocks = re.findall(r"```python\n# ((?:schemas|stages)/\S+)\n(.*?)```", TUTORIAL.read_text(), re.DOTALL)
    return {"stages/heights/__init__.py": "", **dict(blocks)}


IN_PYTHON = """
import json
from scenewright.cli.viewing.view import viewer_of
from scenewright import load, payload
found = load("tests/golden/v1/novelty")
print(json.dumps([found.info.text, payload(found, "numbers.npz")["one"].tolist(), viewer_of(type(found)).__name__]))
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the code with one new thing of each sort, and the golden artifact that the new step makes."""
    root = tmp_path_factory.mktemp("tree")
    unneeded = shutil.ignore_patterns("*.nb[ic]", "json")
    for name in ("cli", "stages", "schemas", "scenewright", "benchmarks"):
        shutil.copytree(REPOSITORY / name, root / name, ignore=unneeded)
    for name in ("pyproject.toml", "tests/__init__.py", "tests/wheel_layout.py", *(f"tests/{test}" for test in TESTS)):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(REPOSITORY / name, root / name)
    (root / "data").symlink_to(REPOSITORY / "data")
    for name, text in (NEW_FILES | files_of_the_tutorial()).items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    python(root, "-m", "scenewright", "brandnew", "--text", "as <new> as can be", "--out", "tests/golden/v1/novelty")
    return root


def python(tree: Path, *words: str) -> str:
    done = subprocess.run([sys.executable, *words], cwd=tree, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_step_of_the_tutorial(tree: Path) -> None:
    """Its commands, on the map of the golden artifacts."""
    text = TUTORIAL.read_text().split("## Run it")[1]
    assert len(files_of_the_tutorial()) == 4
    shutil.copytree(REPOSITORY / "tests/golden/v1/panoptic_map", tree / "outputs/demo/panoptic_map")
    commands = [line.removeprefix("scenewright ") for line in text.split("```")[1].split("\n") if line.strip()]
    assert len(commands) == 4
    for command in commands:
        python(tree, "-m", "scenewright", *command.split())
    again = json.loads(python(tree, "-m", "scenewright", *commands[1].split(), "--json"))
    assert again["status"] == "up to date"
    if importlib.util.find_spec("pandas"):
        assert "floor" not in python(tree, "-c", text.split("```python\n")[1].split("```")[0])


def test_the_command_is_there_with_its_estimate(tree: Path) -> None:
    assert "Something new" in python(tree, "-m", "scenewright", "--help")
    told = json.loads(python(tree, "-m", "scenewright", "brandnew", "--out", "elsewhere", "--dry-run", "--json"))
    assert told["estimate"]["disk_bytes"] == 3_000_000


def test_the_kind_has_a_json_schema_opens_and_is_drawn(tree: Path) -> None:
    python(tree, "-m", "scenewright", "schemas", "--out", "json")
    assert json.loads((tree / "json" / "novelty.v1.novelty.schema.json").read_text())["title"] == "NoveltyFile"
    assert json.loads(python(tree, "-c", IN_PYTHON)) == ["as <new> as can be", [1.0, 1.0, 1.0], "draw_novelty"]


@pytest.mark.slow
def test_the_report_reads_it_and_shows_its_section(tree: Path) -> None:
    assert "--novelty" in python(tree, "-m", "scenewright", "report", "--help")
    python(tree, "-m", "scenewright", "report", "--novelty", "tests/golden/v1/novelty", "--out", "report")
    document = json.loads((tree / "report" / "report.json").read_text())
    assert document["sections"] == ["novelty", "cost", "made"] and document["title"] == "All new"
    page = (tree / "report" / "report.html").read_text()
    assert '<section id="novelty">as &lt;new&gt; as can be</section>' in page and "A novelty." in page


@pytest.mark.slow
def test_import_contracts_and_golden_artifacts_cover_it(tree: Path) -> None:
    """The step is a floor of its own, and may not import another: with such an import the contract fails."""
    words = ("-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist", "tests/contract/test_floors.py")
    only = "declarations_import or only_points_down or engine_the_kit_or_a_step or novelty"
    assert "4 passed" in python(tree, *words, "tests/golden", "-k", only)
    (tree / "stages" / "brandnew" / "more.py").write_text("import scenewright.stages.fuse.mapping\n")
    with pytest.raises(AssertionError, match=r"stages\.brandnew\.more imports \S+fuse\.mapping"):
        python(tree, *words, "-k", "only_points_down")
