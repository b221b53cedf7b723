"""The wheel holds what the checkout holds, works beside other people's packages, and finds what those add."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract.installed_package import (
    write_broken_package,
    write_package_of_alternatives,
    write_package_of_the_tutorial,
)
from tests.unit.ingest.folder_writers import write_tum
from tests.unit.ingest.tiny_room import frames

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = ("scenewright", "cli", "data", "schemas", "stages")
FILES = ("setup.py", "pyproject.toml", "MANIFEST.in", "README.md", "LICENSE")
MAP = REPOSITORY / "tests" / "golden" / "v1" / "panoptic_map"
EVERY_HELP = """
import contextlib, io, os, sys
from pathlib import Path
import scenewright
from scenewright.cli import housekeeping
from scenewright.cli.application import build_application
from scenewright.cli.main import run
from scenewright.stages.engine.discovery import all_stages

assert Path(scenewright.__file__).parent == Path(sys.argv[1], "scenewright"), scenewright.__file__
words = [name.split() for name in all_stages()]
words += [[function.__name__.replace("_", "-")] for function, _ in housekeeping.COMMANDS]
words += [[group, function.__name__.replace("_", "-")] for group, function in housekeeping.BESIDE_STEPS]
words += [[name] for name, *_ in housekeeping.GROUPS]
application = build_application()
for command in words:
    with contextlib.redirect_stdout(io.StringIO()) as shown:
        assert application(args=[*command, "--help"], prog_name="scenewright", standalone_mode=False) == 0, command
    assert "Usage: scenewright" in shown.getvalue(), command
assert len(words) > 60
sys.exit(run(["doctor", "--json"]))
"""
ALTERNATIVES = """
import contextlib, io, json, sys
from pathlib import Path
from scenewright.cli.main import run
from scenewright.cli.viewing.view import viewer_of
from scenewright.schemas.kinds import KINDS
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.export.registry import all_formats
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.registry import versions
from scenewright.stages.tableware.planning.choice import declared_policy

def say(*words):
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert run(list(words)) == 0, words
    return " ".join(said.getvalue().split())

helps = {"": "Say how high", "segment": "two spots a frame", "ingest": "crumbs", "report": "--heights",
         "tableware plan": "newest_first"}
step = ("heights", "--panoptic-map", sys.argv[1], "--out", "heights", "--json", "--quiet")
log = Path("log")
log.mkdir()
(log / "crumbs.txt").write_text("")
spots = SegmentParameters(backend="two-spots", spot_size=5)
print(json.dumps({
    "helps": [text in say(*name.split(), "--help") for name, text in helps.items()],
    "runs": [*(json.loads(say(*step))["status"] for _ in range(2)),
             run(["report", "--heights", "heights", "--out", "report", "--quiet"])],
    "rule": open_log(log, IngestParameters()).rule,
    "backend": choose_backend(BackendRequest(spots)).label,
    "versions": versions(spots),
    "writer": [declared.module for declared in all_formats()][-1],
    "viewer": viewer_of(KINDS["heights"]).__module__,
    "policy": type(declared_policy("newest_first")).__name__,
}))
"""


def run(
    folder: Path, path: list[Path], *words: str | Path, code: int = 0, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in `folder`, which is no place to import from, with nothing but `path` before what is installed."""
    environment = {**os.environ, **variables, "PYTHONPATH": os.pathsep.join(map(str, path)), "PYTHONSAFEPATH": "1"}
    done = subprocess.run(
        [sys.executable, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == code, done.stdout[-2000:] + done.stderr
    return done


@pytest.fixture(scope="module", autouse=True)
def _compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Let the processes of these tests share the code that Python compiles."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
        patch.setenv("PYTHONPYCACHEPREFIX", str(tmp_path_factory.mktemp("compiled")))
        yield


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy: setuptools leaves things behind in the tree."""
    tree, made = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("wheel")
    for name in FOLDERS:
        shutil.copytree(REPOSITORY / name, tree / name, ignore=shutil.ignore_patterns("__pycache__", "*.nb[ic]"))
    for name in FILES:
        shutil.copy2(REPOSITORY / name, tree / name)
    pip = ("-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-index")
    run(tree, [], *pip, "--no-deps", "--no-build-isolation", "--wheel-dir", made, ".")
    (found,) = made.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the wheel was installed into."""
    folder = tmp_path_factory.mktemp("site")
    pip = ("-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-index", "--no-deps")
    run(folder, [], *pip, "--no-compile", "--target", folder, wheel)
    return folder


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder in which other people's modules are called as our folders are."""
    folder = tmp_path / "elsewhere"
    for name in ("stages", "schemas", "cli"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("raise ImportError('not this one')")
    return folder


@pytest.fixture(params=["the wheel", "a checkout"])
def code(request: pytest.FixtureRequest) -> Path:
    """A folder that `scenewright` is imported from."""
    found: Path = request.getfixturevalue("site") if request.param == "the wheel" else REPOSITORY
    return found


def test_the_wheel_holds_every_file_but_those_of_a_checkout(wheel: Path) -> None:
    ours = [path for folder in FOLDERS for path in (REPOSITORY / folder).rglob("*") if path.is_file()]
    unneeded = {".pyc", ".nbi", ".nbc", ".mk", ".sh"}
    names = {path.relative_to(REPOSITORY).as_posix() for path in ours if path.suffix not in unneeded}
    expected = {name if name.startswith("scenewright/") else f"scenewright/{name}" for name in names}
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == expected


def test_every_command_and_doctor_from_another_folder(site: Path, elsewhere: Path) -> None:
    done = run(elsewhere, [site, elsewhere], "-c", EVERY_HELP, site)
    assert isinstance(json.loads(done.stdout.splitlines()[-1]), list)


def test_a_step_and_a_chain_make_what_the_checkout_makes(site: Path, elsewhere: Path) -> None:
    words = ("-m", "scenewright", "ingest", "--log", write_tum(elsewhere / "log", frames(4)), "--json", "--quiet")
    places = {"by_wheel": site, "by_checkout": REPOSITORY}
    made = [json.loads(run(elsewhere, [at], *words, "--out", name).stdout) for name, at in places.items()]
    assert made[0]["content_digest"] == made[1]["content_digest"] and made[0]["key"] == made[1]["key"]
    git = json.loads((elsewhere / "by_wheel" / "manifest.json").read_text())["provenance"]["git_commit"]
    assert git == "", "no checkout has made it"
    chain = ("-m", "scenewright", "run", "demo", "--only", "cad_library", "--dry-run", "--json")
    told = json.loads(run(elsewhere, [site], *chain, "--out", "chain").stdout)
    assert [step["status"] for step in told["steps"]] == ["would run"]


def test_processes_of_its_own_run_the_same_code(site: Path, elsewhere: Path) -> None:
    """Even in the folder of a checkout, and with the user's own folders to import from."""
    program = "from scenewright.stages.engine.own_code import own_code as f; import json; print(json.dumps(f()))"
    told = json.loads(run(elsewhere, [site, elsewhere], "-c", program).stdout)
    assert told["PYTHONPATH"].split(os.pathsep) == [str(site), str(elsewhere)]
    found = "import scenewright; print(scenewright.__file__)"
    child = subprocess.run(
        [sys.executable, "-c", found], cwd=REPOSITORY, env={**os.environ, **told}, capture_output=True, text=True
    )
    assert child.stdout.strip() == str(site / "scenewright" / "__init__.py")


def test_what_installed_packages_add(code: Path, elsewhere: Path, tmp_path: Path) -> None:
    others = tmp_path / "others"
    write_package_of_the_tutorial(others)
    write_package_of_alternatives(others)
    done = run(elsewhere, [code, others], "-c", ALTERNATIVES, MAP, COLUMNS="200")
    assert '<section id="heights">' in (elsewhere / "report" / "report.html").read_text()
    assert json.loads(done.stdout.splitlines()[-1]) == {
        "helps": [True] * 5,
        "runs": ["made", "up to date", 0],
        "rule": "folder with crumbs.txt",
        "backend": "spots of 5",
        "versions": {"room-extras": "0.1.0"},
        "writer": "room_extras.pebbles.writer",
        "viewer": "room_extras.views",
        "policy": "DeclaredPolicy",
    }


def test_a_broken_package_is_named_and_stops_nothing(site: Path, elsewhere: Path, tmp_path: Path) -> None:
    write_broken_package(tmp_path / "others")
    done = run(elsewhere, [site, tmp_path / "others"], "-m", "scenewright", "fuse", "--help")
    assert "--voxel-size" in done.stdout
    said = done.stderr.splitlines()
    for group, name, why in (
        ("kinds", "another", "declared twice"),
        ("steps", "missing", "No module named 'broken.missing'"),
        ("steps", "silent", "No module named 'broken.silent.parameters'"),
        ("steps", "taken", "'fuse' is declared twice"),
        ("backends", "silent", "declares no BACKEND"),
        ("layouts", "leaves", "SystemExit: 7"),
    ):
        (line,) = [line for line in said if line.startswith(f"broken-package: its scenewright.{group} '{name}'")]
        assert why in line
    assert len(said) == 7 and "there is a command doctor" in said[-1]
