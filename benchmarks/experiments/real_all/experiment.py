"""Every real log through every backend that runs here: what came out, or the one line that says why nothing did.

Logs and their options: benchmarks/expectations/real_all.toml. Exits with 4 when a run ended otherwise than with 0, 3, 4
or 5, when a log without a scene was not refused, or when one with a scene was.
"""

from __future__ import annotations

import subprocess
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import Field
from scenewright.schemas.places import HOME
from scenewright.stages.engine.chain import command_prefix
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment import all_backends

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.real_all.made_logs import MADE
from benchmarks.tabulation import markdown

EXPECTATIONS = Path(__file__).resolve().parents[2] / "expectations" / "real_all.toml"
LOGS: dict[str, dict[str, Any]] = tomllib.loads(EXPECTATIONS.read_text(encoding="utf-8"))
ANNOTATED = "annotated"
BACKENDS = ("network", "detector", "objects", "geometric", "masks")
WHY_NOT = {
    "ground-truth": "the logs hold no labels",
    "huggingface": "no model is given (--weights)",
    "onnx": "no network is given (--weights, --sidecar)",
    "service": "no address of a segmentation service is given",
}
STEPS = ("library build", "ingest", "poses", "segment", "fuse", "graph", "cad", "urdf", "evaluate", "report")
EXPLAINED = (0, 3, 4, 5)
"""Exit codes that say something of the log: done, bad input, an outcome that is not ok, weights that are missing."""
SCENE, LIBRARY = "interactive_scene", "cad_library"
COLUMNS = ("outcome", "exit", "entities", "supports", "replaced", "movable", "settled", "seconds", "peak [MiB]")


class RealAllParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    detector: Path | None = Field(None, description="ONNX detector instead of DATA/detectors/yolox_nano.onnx")


def detector(bench: Bench) -> Path:
    """The weights of the detector."""
    return bench.parameters.detector or bench.parameters.data / "detectors" / "yolox_nano.onnx"


def runs(arm: str, case: str) -> bool:
    """Whether a backend has to do with a log; a log that is refused meets one."""
    log = LOGS[case]
    if log.get("pipeline") == "annotated-scan" or arm == ANNOTATED:
        return arm == ANNOTATED and log.get("pipeline") == "annotated-scan"
    if arm == "masks":
        return "made" in log
    return arm == "network" or not log.get("refused", False)


def seeds_of(bench: Bench, case: str) -> list[str]:
    """The log, where it is; of a quick run those with few frames."""
    there = (bench.parameters.data / LOGS[case]["log"]).exists()
    return [case] if there and ("quick" in LOGS[case] or not bench.quick) else []


def default_arms(bench: Bench) -> list[str]:
    """All that have what they need."""
    return [arm for arm in EXPERIMENT.arms if arm != "detector" or detector(bench).is_file()]


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The log, and the weights of the detector."""
    log = bench.parameters.data / LOGS[trial.case]["log"]
    return [log, detector(bench)] if trial.arm == "detector" else [log]


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Write the logs that are made."""
    for case in sorted({trial.case for trial in trials}):
        log = LOGS[case]
        if "made" in log:
            MADE[log["made"]](bench.parameters.data / log["log"], bench.out / "logs" / case)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Run the chains and yield what came out."""
    for trial in trials:
        run = bench.out / "runs" / f"{trial.case}-{trial.arm}"
        run.parent.mkdir(parents=True, exist_ok=True)
        words = ["run", LOGS[trial.case].get("pipeline", "reconstruct"), "--out", str(run)]
        for name, value in settings(bench, trial).items():
            words += ["--set", f"{name}={value}"]
        process = subprocess.run(
            [*command_prefix(), *words], cwd=HOME, capture_output=True, text=True, errors="replace", check=False
        )
        run.with_suffix(".log").write_text(process.stderr, encoding="utf-8")
        yield trial, {"exit": process.returncode, **told(process.stderr), **found(run)}


def settings(bench: Bench, trial: Trial) -> dict[str, str]:
    """Return the pipeline's variables for a trial."""
    log = LOGS[trial.case]
    place, masks = bench.parameters.data / log["log"], None
    if "made" in log:
        folder = bench.out / "logs" / trial.case
        place = folder / "points.npz" if trial.arm == ANNOTATED else folder / "log"
        masks = folder / "masks"
    if trial.arm == ANNOTATED:
        return {"scan": str(place.resolve()), **log.get("settings", {})}
    every = log.get("quick", 1) if bench.quick else log.get("every", 1)
    values = {"log": str(place.resolve()), "backend": trial.arm, "every": str(every), **log.get("settings", {})}
    if trial.arm == "detector":
        values["weights"] = str(detector(bench).resolve())
    if trial.arm == "masks" and masks is not None:
        values["masks"] = str(masks.resolve())
    return values


def told(messages: str) -> dict[str, str]:
    """Return the last error line of a run."""
    errors = [line for line in messages.splitlines() if line.startswith("error: ")]
    return {"said": errors[-1].removeprefix("error: ")} if errors else {}


def found(run: Path) -> dict[str, Any]:
    """Return what the artifacts of a run say: nothing for a run that made none. `seconds`: of all its steps, when each
    was made, but for the library, which all runs share."""
    manifests = {path.parent.name: read_manifest(path.parent) for path in sorted(run.glob("*/manifest.json"))}
    facts: dict[str, Any] = {"outcome": "none", "scene": SCENE in manifests}
    if manifests:
        peak = max(manifest.provenance.peak_memory_bytes for manifest in manifests.values())
        facts["peak_mib"] = peak / 2**20
        own = [manifest for name, manifest in manifests.items() if name != LIBRARY]
        facts["seconds"] = sum(manifest.provenance.seconds for manifest in own)
    for folder, names in {
        "panoptic_map": {"entities": "entities"},
        "contact_graph": {"supports": "supports"},
        "cad_scene": {"cad": "replaced", "mesh": "meshes"},
        SCENE: {"movable": "movable", "settled": "settled"},
    }.items():
        if folder in manifests:
            summary = manifests[folder].summary
            facts |= {name: summary[key] for key, name in names.items() if key in summary}
            facts["outcome"] = manifests[folder].outcome
    return facts


def problems(results: Results) -> list[str]:
    """Return the runs that ended as no run may."""
    wrong = []
    for trial, facts in results.records.items():
        code, said = facts["exit"], facts.get("said", "nothing")
        if code not in EXPLAINED or LOGS[trial.case].get("refused", False) == facts["scene"]:
            wrong.append(f"{trial}: exit {code} ({said})")
    return wrong


def cell(value: Any) -> str:
    """Return a value as a table shows it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "" if value is None else f"{value:.0f}" if isinstance(value, float) else str(value)


def notes(results: Results) -> str:
    """One row a run, the line that a run ended with, and the backends that did not run."""
    rows, lines = [], []
    for trial, facts in results.records.items():
        values = [facts.get(name.replace(" [MiB]", "_mib")) for name in COLUMNS]
        rows.append([trial.case, trial.arm, *map(cell, values)])
        if "said" in facts:
            lines.append(f"- {trial.case}, {trial.arm}: {facts['said'].replace(str(results.bench.out), '')}")
    absent = [f"- {b.name}: {WHY_NOT.get(b.name, 'not asked for')}" for b in all_backends() if b.name not in BACKENDS]
    if not detector(results.bench).is_file():
        absent.append(f"- detector: {detector(results.bench)} is not there")
    table = markdown("", ("log", "backend", *COLUMNS), rows)
    return "\n".join([table, "", "How runs ended:", *lines, "", "Backends that did not run:", *absent, ""])


def highest(name: str) -> Measure:
    """The largest of an entry."""

    def of(records: Sequence[dict[str, Any]]) -> float | None:
        values = [record[name] for record in records if record.get(name) is not None]
        return float(max(values)) if values else None

    return Measure(of, "", interval=False)


EXPERIMENT = Experiment(
    name="real_all",
    title="Every real log through every backend",
    simulated="Nothing, but the living room's images are rendered; masks and labels of annotated cases are by hand.",
    knows="Colour, depth, camera; the poses that the logs bring, or none; a detector trained on photographs (COCO).",
    does_not_show="That the scenes are right: nobody measured these rooms. Only that every run ends with a scene and "
    "what is wrong with it, or with one line that says why there is none.",
    arms={arm: arm for arm in (*BACKENDS, ANNOTATED)},
    cases=tuple(LOGS),
    seeds_of=seeds_of,
    default_arms=default_arms,
    runs=runs,
    measure=measure,
    record=dict[str, Any],
    measures={
        name: highest(name)
        for name in ("exit", "entities", "supports", "replaced", "meshes", "movable", "seconds", "peak_mib")
    },
    prepare=prepare,
    parameters=RealAllParameters,
    places=frozenset({"data", "detector"}),
    inputs=inputs,
    steps=STEPS,
    notes=notes,
    problems=problems,
)
