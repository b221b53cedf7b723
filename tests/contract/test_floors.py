"""Who may import whom, read from the import graph: a new step, kit module or backend needs no entry anywhere."""

from __future__ import annotations

import ast
import importlib
import re
import sys
import tempfile
from functools import cache
from pathlib import Path

import grimp
import networkx
import pytest
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.kit.exports import exported_names

from tests.wheel_layout import REPOSITORY, link_packages

PACKAGES = ("scenewright", "benchmarks")

HEAVY = {"open3d", "torch", "cv2", "pybullet", "trimesh", "numba", "matplotlib", "scipy"}
SHARED_WITH_SYSTEMS_TO_COME = ("language", "motion", "rendering", "tasks")
"""Packages of the kit that may have fewer than two users today: agents, splats, learned predicates and cutting ask
language models, plan with symbols, move arms and render too."""


@cache
def graph(external: bool = True) -> grimp.ImportGraph:
    """The graph of the packages as the wheel has them: grimp finds packages by their folders."""
    imported = {name: sys.modules.pop(name) for name in PACKAGES if name in sys.modules}
    with tempfile.TemporaryDirectory() as folder:
        link_packages(Path(folder))
        sys.path.insert(0, folder)
        try:
            return grimp.build_graph(*PACKAGES, include_external_packages=external, cache_dir=None)
        finally:
            sys.path.remove(folder)
            sys.modules.update(imported)
            importlib.invalidate_caches()


def floor(module: str) -> str:
    """`cli`, `schemas`, `benchmarks`, `engine`, `kit`, `scenewright` (the Python API), or the folder of a step."""
    top, *below = module.removeprefix("scenewright.").split(".")
    if top == "__main__":
        return "cli"
    return below[0] if top == "stages" and below else top


def ours() -> list[str]:
    return sorted(module for module in graph().modules if not graph().is_module_squashed(module))


def steps() -> set[str]:
    return {stage.folder for stage in all_stages().values()}


def allowed(source: str) -> set[str]:
    """The floors below, and the own one. Steps meet only in artifacts."""
    if source == "schemas":
        return {"schemas"}
    if source == "kit":
        return {"schemas", "kit"}
    if source == "engine":
        return {"schemas", "kit", "engine"}
    if source in steps():
        return {"schemas", "kit", source}
    return {"schemas", "kit", "engine", "cli", "stages", source, *steps()}


def test_every_folder_of_stages_is_the_engine_the_kit_or_a_step() -> None:
    assert {floor(module) for module in ours()} - {"stages"} == {
        *("cli", "schemas", "benchmarks", "engine", "kit", "scenewright"),
        *steps(),
    }


def test_an_import_only_points_down() -> None:
    wrong = [
        f"{module} imports {imported}"
        for module in ours()
        for imported in sorted(graph().find_modules_directly_imported_by(module))
        if not graph().is_module_squashed(imported) and floor(imported) not in allowed(floor(module))
    ]
    assert not wrong


def test_only_benchmarks_may_import_the_command_line() -> None:
    wrong = [
        m
        for m in ours()
        if floor(m) != "cli"
        for i in graph().find_modules_directly_imported_by(m)
        if floor(i) == "cli" and floor(m) != "benchmarks"
    ]
    assert not wrong


def test_declarations_import_nothing_heavy() -> None:
    for folder in steps():
        assert not HEAVY & graph().find_modules_directly_imported_by(f"scenewright.stages.{folder}.parameters"), folder


def test_the_kit_holds_what_two_or_more_share() -> None:
    """Counted through the kit's own modules; a benchmark counts as one user, whichever it is."""
    lonely = {}
    for module in ours():
        parts = module.split(".")
        if floor(module) != "kit" or graph().find_children(module) or parts[3] in SHARED_WITH_SYSTEMS_TO_COME:
            continue
        users = {floor(user) for user in _users_of(module)} - {"kit"}
        if len(users) < 2:
            lonely[module] = sorted(users)
    assert not lonely, "what one step uses lives in that step; what none uses goes"


def _users_of(module: str) -> set[str]:
    """Modules that import it, through the kit only: what a step imports is not used by who imports the step."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        for user in graph().find_modules_that_directly_import(waiting.pop()):
            if user not in found:
                found.add(user)
                if floor(user) == "kit":
                    waiting.append(user)
    return found


def test_modules_import_each_other_in_no_circle() -> None:
    plain = graph(external=False)
    edges = networkx.DiGraph(
        (module, imported) for module in plain.modules for imported in plain.find_modules_directly_imported_by(module)
    )
    circles = [sorted(found) for found in networkx.strongly_connected_components(edges) if len(found) > 1]
    assert not circles


CORES = (
    *("fuse.mapping", "fuse.ours", "fuse.closing"),
    *("graph.building", "graph.ours"),
    *("cad.candidates", "cad.choosing", "cad.ours"),
    *(
        "segment.fusion_ours",
        "segment.geometric",
        "segment.backends.objects.segmentation",
        "segment.backends.network.grouping",
    ),
    *("poses.tracking", "poses.estimation"),
    *("plan.world_model", "plan.pick_place", "plan.door_motion", "plan.conduct", "plan.refinement"),
)


@pytest.mark.parametrize("core", CORES)
def test_cores_that_others_will_drive_need_no_stage(core: str) -> None:
    """An agent that maps while it acts takes the mapper without the step around it."""
    module = f"scenewright.stages.{core}"
    assert graph().find_shortest_chain(module, f"scenewright.stages.{floor(module)}.stage") is None


TRAINED = re.compile(r"scenewright\.stages\.(\w+)\.training\.\w")


def test_nothing_that_a_step_runs_imports_a_training() -> None:
    """A training is not part of what a step's `run` reaches. A step's package may export what experiments share with
    its training."""
    wrong = [
        f"{module} imports {imported}"
        for module in ours()
        if floor(module) in steps() and module.count(".") > 2 and not TRAINED.match(module)
        for imported in sorted(graph().find_modules_directly_imported_by(module))
        if TRAINED.match(imported) and floor(imported) in steps()
    ]
    assert not wrong


MOST_DEEP_LINES = 120
"""Import lines of benchmarks into the inside of steps; the others are of names that a step's package exports."""


def test_experiments_reach_steps_through_names_that_they_export() -> None:
    deep = []
    for file in sorted((REPOSITORY / "benchmarks").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            named = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            deep += [f"{file.name}: {name}" for name in named if name.count(".") > 2 and floor(name) in steps()]
    assert len(deep) < MOST_DEEP_LINES, "import from the step's package; export there what experiments need of it"


@pytest.mark.parametrize("step", sorted(steps()))
def test_what_a_package_exports_is_there_and_no_name_of_a_module(step: str) -> None:
    package = importlib.import_module(f"scenewright.stages.{step}")
    for name in exported_names(package.__name__):
        assert getattr(package, name) is not None
        assert not (REPOSITORY / "stages" / step / f"{name}.py").exists(), "a module's own name"


@pytest.mark.parametrize(
    "baseline",
    ["graph.thesis", "fuse.thesis", "fuse.separate", "cad.thesis", "segment.fusion_thesis", "segment.fusion_voxblox"],
)
def test_a_baseline_reaches_nothing_of_ours(baseline: str) -> None:
    """Whoever improves our method cannot change the one that it is compared with."""
    folder = floor(f"scenewright.stages.{baseline}")
    reached = graph().find_upstream_modules(f"scenewright.stages.{baseline}")
    assert not reached & {f"scenewright.stages.{folder}.ours", f"scenewright.stages.{folder}.fusion_ours", *OURS_ALONE}


OURS_ALONE = {
    *(
        "scenewright.stages.graph.corrected_support",
        "scenewright.stages.graph.shared_support",
        "scenewright.stages.graph.beside",
        "scenewright.stages.graph.hanging",
    ),
    *("scenewright.stages.fuse.partition", "scenewright.stages.fuse.class_scores"),
    *("scenewright.stages.cad.apart", "scenewright.stages.cad.fitting", "scenewright.stages.cad.scoring"),
    *("scenewright.stages.segment.claims",),
}
"""What only our methods are made of."""
