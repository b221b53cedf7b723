"""What README.md and docs/ name exists: links, files, modules, make targets, commands and their options."""

from __future__ import annotations

import importlib.util
import inspect
import json
import re
import shlex
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
from scenewright.cli.application import build_application
from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline

from benchmarks.command import bench_of, parser_of
from benchmarks.discovery import experiment_files, load_experiment
from benchmarks.keeping import wanted_trials

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
FOLDERS = ("benchmarks", "cli", "data", "docs", "schemas", "stages", "tests")
MADE = ("data/disparity/raft_stereo", "data/networks/")
"""Weights that a user fetches or trains: they may be missing."""
EXAMPLES = ("heights",)
"""Steps that a tutorial lets its reader make; test_found_by_place.py makes them."""
OF_EXAMPLES = re.compile(rf"(?:schemas|stages|cli/viewing)[/.](?:{'|'.join(EXAMPLES)})\b|cli/viewing/heights_view")


def in_code(text: str) -> str:
    """Return the code blocks and spans of a page, a line each."""
    blocks = re.findall(r"^```[^\n]*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    rest = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    spans = [span.replace("\n", " ") for span in re.findall(r"`([^`]+)`", rest)]
    return "\n".join([*blocks, *spans]).replace("\\\n", " ")


def targets() -> set[str]:
    named = set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    return named | {file.stem for file in (ROOT / "data" / "pipelines").glob("*.toml")}


@cache
def options() -> dict[str, set[str]]:
    """Return every command's options, under its words: {"library build": {"--seed", ...}}."""

    def walk(command: object, words: tuple[str, ...]) -> dict[str, set[str]]:
        below = getattr(command, "commands", {})
        own = {
            " ".join(words): {
                option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)
            }
        }
        return own | {
            name: flags for word, inner in below.items() for name, flags in walk(inner, (*words, word)).items()
        }

    found = walk(inspect.getclosurevars(build_application()).nonlocals["table"], ())
    below_steps = {
        words: found[words.replace(" ", "-")]
        for words in ("urdf check", "urdf settle", "urdf protocol", "export scene", "export plan")
    }
    return found | below_steps | dict.fromkeys(EXAMPLES, {"--panoptic-map", "--out"})


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    found = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text())
    broken = [link for link in found if "://" not in link and not (page.parent / link).exists()]
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_that_are_named_exist(page: Path) -> None:
    paths = re.findall(rf"(?<![\w./-])((?:{'|'.join(FOLDERS)})/[\w./*{{}}-]*[\w*/])(?![\w<])", page.read_text())
    missing = [
        path
        for path in paths
        if "{" not in path
        and not path.startswith(MADE)
        and not OF_EXAMPLES.match(path)
        and not any(ROOT.glob(path.rstrip("/")))
    ]
    assert missing == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_modules_that_are_run_or_imported_exist(page: Path) -> None:
    code = in_code(page.read_text())
    tops = "|".join((*FOLDERS, "scenewright"))
    modules = re.findall(rf"python -m ((?:{tops})[\w.]*)", code) + re.findall(
        rf"^from ((?:{tops})[\w.]*) import", code, re.MULTILINE
    )
    ours = [module for module in modules if not OF_EXAMPLES.match(module.removeprefix("scenewright."))]
    assert [module for module in ours if importlib.util.find_spec(module) is None] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_make_targets_that_are_named_exist(page: Path) -> None:
    named = re.findall(r"(?:^|[;&(] ?)make ([a-z][\w-]*)", in_code(page.read_text()), re.MULTILINE)
    assert set(named) - targets() == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_that_are_named_exist_and_have_these_options(page: Path) -> None:
    wrong = []
    code = re.sub(r"(?:^|\s)#.*", "", in_code(page.read_text()), flags=re.MULTILINE)
    call = r"(?:(?:^|[;&|$] ?|\.venv/bin/)scenewright|python -m scenewright) ((?:[a-z][\w-]*|--)[^\n|;&]*)"
    for line in re.findall(call, code, re.MULTILINE):
        words = line.split()
        name = " ".join(words[:2]) if " ".join(words[:2]) in options() else words[0]
        flags = set(re.findall(r"(?<!\S)(--[a-z][\w-]*)", line))
        if name.startswith("--"):
            name = ""
        if name not in options():
            wrong.append(f"no command: {line}")
        elif flags - options()[name] - {"--help"}:
            wrong.append(f"{name}: no {', '.join(sorted(flags - options()[name]))}")
    assert wrong == []


def benchmark_commands(text: str) -> list[list[str]]:
    """Return the words after `python -m benchmarks` of every such command in a text of code; what a synopsis puts in
    brackets is taken as given, and N is a number."""
    code = re.sub(r"(?:^|\s)#.*", "", text, flags=re.MULTILINE)
    found = re.findall(r"python -m benchmarks (?!NAME)(\w(?:'[^'\n]*'|[^'\n|;&])*)", code)
    plain = (re.sub(r"(?<!\S)\.\.\.(?!\S)", "", re.sub(r"(?<!\S)\[|\](?!\S)", "", line)) for line in found)
    return [shlex.split(re.sub(r"\bN\b", "1", line)) for line in plain]


def refused(words: Sequence[str]) -> str | None:
    """Return why `python -m benchmarks` refuses these words; None where it does not. Data need not be there."""
    if words[0] == "gather":
        return None if len(words) == len(("gather", "FOLDER")) else "gather takes a folder"
    try:
        experiment = load_experiment(words[0])
        asked = parser_of(experiment).parse_args(words[1:])
        bench = bench_of(experiment, vars(asked))
        for given, known in ((asked.arms, experiment.arms), (asked.cases, experiment.cases)):
            if unknown := [name for name in given if name not in known and not name.isupper()]:
                return f"not in {experiment.name}: {', '.join(unknown)}"
        if asked.seeds:
            wanted_trials(experiment, bench, arms=asked.arms, cases=asked.cases, seeds=asked.seeds)
    except UsageError as error:
        return str(error)
    except SystemExit:
        return "the parser refuses it"
    return None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_experiments_that_are_printed_are_not_refused(page: Path) -> None:
    commands = benchmark_commands(in_code(page.read_text()))
    assert {shlex.join(words): why for words in commands if (why := refused(words))} == {}


@pytest.mark.parametrize("file", sorted((ROOT / "docs" / "results").glob("*.json")), ids=lambda file: file.stem)
def test_the_command_beside_figures_is_one_of_ours_and_not_refused(file: Path) -> None:
    told = json.loads(file.read_text())["command"]
    assert file.stem in (*experiment_files(), "board") or told.startswith(f"python -m benchmarks.{file.stem} "), (
        "by hand"
    )
    for command in told.split(";"):
        words = shlex.split(command)
        if words[0] == "make":
            assert words[1] in targets(), command
        elif words[:3] == ["python", "-m", "benchmarks"]:
            assert [refused(each) for each in benchmark_commands(command)] == [None], command
        else:
            assert words[:2] == ["python", "-m"] and importlib.util.find_spec(words[2]), command


@pytest.mark.parametrize("words", ["nobody --out FOLDER", "poses", "poses --out FOLDER --arms nobody", "gather"])
def test_what_the_program_refuses_is_noticed(words: str) -> None:
    assert refused(words.split())


TYPED_IN_ORDER = [
    "index.md",
    "EDIT.md",
    "LIBRARY.md",
    "LLM3.md",
    "LOGS.md",
    "MAPPING.md",
    "ROBOT.md",
    "SCENES.md",
    "STITCH.md",
    "TIDY.md",
    *(f"tutorials/{page.name}" for page in ROOT.glob("docs/tutorials/*.md")),
]
"""Pages whose commands a reader types from the first to the last."""
RUNS = {"outputs/demo": "demo", "outputs/room": "reconstruct"}
"""What readers have made before: `make demo`, and the run of docs/LOGS.md."""


@pytest.mark.parametrize("page", sorted(TYPED_IN_ORDER))
def test_commands_that_are_typed_in_order_read_what_was_made_before(page: str) -> None:
    blocks = re.findall(r"^```[^\n]*\n(.*?)^```", (ROOT / "docs" / page).read_text(), re.DOTALL | re.MULTILINE)
    made = {
        f"{folder}/{step.name}" for folder, name in RUNS.items() for step in read_pipeline(pipeline_path(name)).step
    }
    wrong = []
    for line in "\n".join(blocks).replace("\\\n", " ").splitlines():
        words = line.split(" #")[0].split()
        if "scenewright" not in words[:1] or words[1] == "inspect":
            continue
        outs = {after for word, after in pairwise(words) if word == "--out"}
        read = {word.rstrip("/") for word in words if re.fullmatch(r"(?:outputs|run)/[\w./-]+", word)} - outs
        wrong += [(line, path) for path in sorted(read) if not any(f"{path}/".startswith(f"{out}/") for out in made)]
        made |= outs
    assert wrong == []


def test_pages_that_code_names_exist() -> None:
    files = [ROOT / "Makefile", ROOT / "CHANGELOG.md", *ROOT.glob("data/**/*.toml")]
    files += [
        file
        for folder in ("benchmarks", "cli", "schemas", "stages", "tests")
        for file in ROOT.glob(f"{folder}/**/*.py")
    ]
    named = {page for file in files for page in re.findall(r"\bdocs/[\w/]+\.(?:md|py|ipynb)\b", file.read_text())}
    assert {page for page in named if not (ROOT / page).exists()} == set()
