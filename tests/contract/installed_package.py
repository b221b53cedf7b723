"""Packages of other people, as `pip install --target` leaves them: code, and metadata with entry points."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

TUTORIAL = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "new_step.md"
RENAMED = {"scenewright.schemas.heights": "room_heights.kind", "scenewright.stages.heights": "room_heights.step"}
PLACES = {"schemas/heights.py": "room_heights/kind.py", "stages/heights": "room_heights/step"}


def write_package(
    site: Path, distribution: str, entry_points: Mapping[str, Mapping[str, str]], files: Mapping[str, str]
) -> None:
    """Write files (path -> text) and the metadata of their distribution into a folder to import from."""
    metadata = site / f"{distribution.replace('-', '_')}-0.1.0.dist-info"
    groups = [
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())])
        for group, entries in entry_points.items()
    ]
    texts = {
        **files,
        f"{metadata.name}/METADATA": f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 0.1.0\n",
        f"{metadata.name}/entry_points.txt": "\n\n".join(groups) + "\n",
    }
    for name, text in texts.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_text(text)


def write_package_of_the_tutorial(site: Path) -> None:
    """Write the package that the tutorial about a new step describes."""
    text = TUTORIAL.read_text()
    files = {"room_heights/__init__.py": "", "room_heights/step/__init__.py": ""}
    for name, code in re.findall(r"```python\n# ((?:schemas|stages)/\S+)\n(.*?)```", text, re.DOTALL):
        for old, new in PLACES.items():
            name = name.replace(old, new)
        for old, new in RENAMED.items():
            code = code.replace(old, new)
        files[name] = code
    assert sorted(files) == [
        "room_heights/__init__.py",
        "room_heights/kind.py",
        *(f"room_heights/step/{name}.py" for name in ("__init__", "parameters", "stage")),
    ]
    (project,) = re.findall(r"```toml\n# pyproject.toml\n(.*?)```", text, re.DOTALL)
    described = tomllib.loads(project)["project"]
    write_package(site, described["name"], described["entry-points"], files)


def write_package_of_alternatives(site: Path) -> None:
    """Write a package with a backend, a layout, an export format, a viewer, a report section and a policy."""
    files = {f"room_extras/{name}": text for name, text in ALTERNATIVES.items()}
    entry_points = {
        "scenewright.backends": {"two-spots": "room_extras.two_spots"},
        "scenewright.layouts": {"crumbs": "room_extras.crumbs"},
        "scenewright.export_formats": {"pebbles": "room_extras.pebbles"},
        "scenewright.viewers": {"heights": "room_extras.views"},
        "scenewright.sections": {"heights": "room_extras.heights"},
        "scenewright.tableware_policies": {"newest_first": "room_extras.newest_first"},
    }
    write_package(site, "room-extras", entry_points, files)


def write_broken_package(site: Path) -> None:
    """Write a package of which nothing can be used."""
    declaration = """
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import Parameters, Stage
STAGE = Stage({name!r}, 1, "of nobody", Parameters, {{}}, Trajectory)
"""
    kind = """
from scenewright.schemas.artifact import Artifact
class Another(Artifact):
    kind = "splat"
"""
    files = {
        "broken/__init__.py": "",
        "broken/silent/__init__.py": "",
        "broken/taken/__init__.py": "",
        "broken/taken/parameters.py": declaration.format(name="fuse"),
        "broken/command/__init__.py": "",
        "broken/command/parameters.py": declaration.format(name="doctor"),
        "broken/kind.py": kind,
        "broken/leaves.py": "raise SystemExit(7)",
    }
    entry_points = {
        "scenewright.steps": {
            "missing": "broken.missing",
            "silent": "broken.silent",
            "taken": "broken.taken",
            "command": "broken.command",
        },
        "scenewright.kinds": {"another": "broken.kind"},
        "scenewright.backends": {"silent": "broken.silent"},
        "scenewright.layouts": {"leaves": "broken.leaves"},
    }
    write_package(site, "broken-package", entry_points, files)


ALTERNATIVES = {
    "__init__.py": "",
    "two_spots/__init__.py": """
from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.registry import BackendDeclaration
class SpotParameters(Parameters):
    spot_size: int = Field(3, ge=1, description="Diameter of a spot [pixels]")
BACKEND = BackendDeclaration(
    name="two-spots", summary="two spots a frame", order=99, parameters=SpotParameters, libraries=("room-extras",)
)
""",
    "two_spots/backend.py": """
from room_extras.two_spots import SpotParameters
class Spots:
    name, label, streams = "two-spots", "", ("depth",)
def open_backend(request):
    backend = Spots()
    backend.label = f"spots of {request.own(SpotParameters).spot_size}"
    return backend
""",
    "crumbs/__init__.py": """
from scenewright.stages.ingest.registry import LogLayout
LAYOUT = LogLayout("crumbs", order=5, recognised_by="crumbs.txt", reader=f"{__name__}.reader")
""",
    "crumbs/reader.py": """
from scenewright.stages.ingest.source import LogSource
def matches(path):
    return "folder with crumbs.txt" if (path / "crumbs.txt").is_file() else None
def open_source(path, parameters, rule):
    return LogSource(format="crumbs", rule=rule, cameras=(), entries=())
""",
    "pebbles/__init__.py": """
from scenewright.stages.export.registry import SequenceFormat
FORMAT = SequenceFormat("pebbles", order=99, layout="pebbles", summary="a line a frame", streams=("pose",))
""",
    "pebbles/writer.py": "def write(job): pass",
    "views.py": """
def draw_heights(heights, canvas):
    pass
""",
    "heights/__init__.py": "",
    "heights/section.py": """
from room_heights.kind import Heights
from scenewright.stages.report.section import Section
SECTION = Section("heights", "Heights", order=1, reads={"heights": Heights}, alone="How high things are")
""",
    "heights/view.py": """
from room_heights.kind import Heights
def view(page):
    return {"count": len(page.given("heights", Heights).info.things)}
""",
    "heights/section.html.j2": """
{% import "macros.html.j2" as macros %}
<section id="heights">{{ count }} things</section>
""",
    "newest_first.py": """
from scenewright.stages.tableware.actions.grasp import grasp
from scenewright.stages.tableware.planning.policy import DeclaredPolicy
class NewestFirst:
    def decide(self, table):
        return grasp(table, table.tops[-1].name)
POLICY = DeclaredPolicy(lambda rules, model, chances, seed: NewestFirst())
""",
}
