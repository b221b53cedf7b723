"""The pages of the site that are made of declarations: commands, kinds, pipelines. A hook of mkdocs (mkdocs.yml)."""

from __future__ import annotations

import inspect
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from scenewright.schemas.kinds import KINDS  # noqa: E402
from scenewright.stages.engine.discovery import all_stages  # noqa: E402
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline  # noqa: E402
from scenewright.stages.engine.tables import documents_of  # noqa: E402
from scenewright.stages.kit.stage import External, Optionally, Stage  # noqa: E402

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Print below every page which version the pages are of."""
    config.copyright = f"scenewright {version()}"
    return config


def version() -> str:
    """Return the version that pyproject.toml states."""
    return str(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"])


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    from mkdocs.structure.files import File

    for name, text in pages().items():
        files.append(File.generated(config, name, content=text))
    return files


def pages() -> dict[str, str]:
    """Return path below docs/ -> Markdown of every generated page."""
    return {
        "reference/commands.md": commands_page(),
        "reference/kinds.md": kinds_page(),
        "reference/pipelines.md": pipelines_page(),
    }


def commands_page() -> str:
    """Every step's command, from its declaration, and the other commands with what they say of themselves."""
    lines = ["# Commands and their options", "", "Every step also takes `--out`, `--seed`, `--device`, `--config`,"]
    lines += ["`--max-memory`, `--force`, `--dry-run`, `--accept`, `--json`, `--quiet` and `--debug`.", ""]
    for stage in sorted(all_stages().values(), key=lambda entry: entry.name):
        lines += [f"## {stage.name}", "", f"{stage.summary}.", ""]
        if stage.example:
            lines += ["```", stage.example, "```", ""]
        lines += ["| reads | |", "|---|---|"]
        lines += [f"| `--{role.replace('_', '-')}` | {_input(what)} |" for role, what in stage.reads.items()]
        kind = stage.writes.kind
        lines += ["", f"Writes a [{kind}](kinds.md#{kind}).", "", *_options(stage), ""]
    lines += [
        "## Other commands",
        "",
        "`scenewright COMMAND --help` has their options.",
        "",
        "| command | |",
        "|---|---|",
    ]
    lines += [f"| `{name}` | {text} |" for name, text in other_commands().items()]
    return "\n".join([*lines, ""])


def other_commands() -> dict[str, str]:
    """Return name -> first sentence of the help of every command that is no step."""
    from scenewright.cli.application import build_application

    table = inspect.getclosurevars(build_application()).nonlocals["table"]
    steps = {stage.folder for stage in all_stages().values()}
    found = {}
    for name, command in sorted(table.commands.items()):
        if name not in steps and not command.hidden:
            words = " ".join((command.help or "").split())
            found[name] = words.partition(". ")[0].rstrip(".").replace("|", "\\|") + "."
    return found


def _input(what: Any) -> str:
    optional = isinstance(what, Optionally)
    inner = what.what if isinstance(what, Optionally) else what
    told = inner.description if isinstance(inner, External) else f"[{inner.kind}](kinds.md#{inner.kind})"
    return told + (", optional" if optional else "")


def _options(stage: Stage) -> list[str]:
    fields = stage.parameters.model_fields
    if not fields:
        return []
    properties = stage.parameters.model_json_schema().get("properties", {})
    rows = ["| option | default | range | meaning |", "|---|---|---|---|"]
    for name, field in fields.items():
        default = "" if field.default is None else f"`{_plain(field.default)}`"
        row = (f"`--{name.replace('_', '-')}`", default, _range(properties.get(name, {})), field.description or "")
        rows.append("| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |")
    return rows


def _plain(value: Any) -> str:
    if isinstance(value, tuple | list):
        return " ".join(str(entry) for entry in value) or "none"
    return str(value)


def _range(schema: dict[str, Any]) -> str:
    for inner in (schema, *schema.get("anyOf", ())):
        if "enum" in inner:
            return ", ".join(f"`{entry}`" for entry in inner["enum"])
        low = inner.get("minimum", inner.get("exclusiveMinimum"))
        high = inner.get("maximum", inner.get("exclusiveMaximum"))
        if low is not None or high is not None:
            return " to ".join("" if end is None else f"{end:g}" for end in (low, high))
    return ""


def kinds_page() -> str:
    """Every kind of artifact, who writes it, and the fields of its documents."""
    makers: dict[str, list[str]] = {}
    for stage in all_stages().values():
        makers.setdefault(stage.writes.kind, []).append(stage.name)
    lines = ["# Artifact kinds", "", "What the files mean: [Formats](../FORMATS.md).", ""]
    for name, kind in sorted(KINDS.items()):
        made = ", ".join(f"[{step}](commands.md#{step.replace(' ', '-')})" for step in sorted(makers.get(name, ())))
        lines += [f"## {name}", "", f"{kind.description[:1].upper()}{kind.description[1:]}. Schema version "]
        lines[-1] += f"{kind.schema_version}" + (f", written by {made}." if made else ".")
        for attribute in documents_of(kind):
            document = next(vars(base)[attribute] for base in kind.__mro__ if attribute in vars(base))
            fields = ", ".join(f"`{field}`" for field in document.model.model_fields)
            lines += ["", f"`.{attribute}` (`{document.name}`): {fields}."]
        lines.append("")
    return "\n".join(lines)


def pipelines_page() -> str:
    """Every pipeline with its variables and steps."""
    lines = ["# Pipelines and their variables", "", "`scenewright run NAME --out FOLDER --set variable=value`, or"]
    lines += ["`make NAME RUN=folder VARIABLE=value`.", ""]
    for path in sorted((ROOT / "data" / "pipelines").glob("*.toml")):
        pipeline = read_pipeline(pipeline_path(path.stem))
        lines += [
            f"## {path.stem}",
            "",
            f"{pipeline.summary}.",
            "",
            "| variable | default | meaning |",
            "|---|---|---|",
        ]
        for name, variable in pipeline.variables.items():
            default = "optional" if variable.optional else "required"
            default = default if variable.default is None else f"`{variable.default}`"
            lines.append(f"| `{name}` | {default} | {variable.description} |")
        steps = ", ".join(
            f"`{step.name}` ([{step.stage}](commands.md#{step.stage.replace(' ', '-')}))" for step in pipeline.step
        )
        lines += ["", f"Steps: {steps}.", ""]
    return "\n".join(lines)
