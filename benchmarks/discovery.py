"""Finding the experiments: each is one file or folder below benchmarks/experiments, and nothing else has to be told."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

from scenewright.schemas.errors import UsageError

from benchmarks.experiment import Experiment

FOLDER = Path(__file__).resolve().parent / "experiments"


def experiment_files() -> dict[str, Path]:
    """Return name -> the file that holds EXPERIMENT; nothing is imported."""
    single = {path.stem: path for path in FOLDER.glob("*.py") if path.stem != "__init__"}
    return dict(sorted({**single, **{p.parent.name: p for p in FOLDER.glob("*/experiment.py")}}.items()))


def summary_of(file: Path) -> str:
    """Return the first line of a file's docstring."""
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n")[0]


def load_experiment(name: str) -> Experiment:
    """Return an experiment by its name. Raises UsageError for an unknown one."""
    files = experiment_files()
    if name not in files:
        raise UsageError(f"no experiment {name!r}", hint=f"there are {', '.join(files)}")
    parts = files[name].relative_to(FOLDER).with_suffix("").parts
    experiment: Experiment = importlib.import_module(".".join(("benchmarks.experiments", *parts))).EXPERIMENT
    if experiment.name != name:
        raise RuntimeError(f"{files[name]} declares the experiment {experiment.name!r}")
    return experiment
