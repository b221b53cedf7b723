"""`scenewright convert-weights`: the authors' checkpoint of RAFT-Stereo as safetensors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli import output


def convert_weights(
    file: Annotated[Path, typer.Argument(help="Checkpoint of RAFT-Stereo (raftstereo-*.pth).")],
    out: Annotated[Path, typer.Option("--out", help="File to write; must end in .safetensors.")],
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Read a checkpoint for `disparity --method raft-stereo` without executing anything in it, check every tensor's
    name and shape, and write it as safetensors."""
    from scenewright.schemas.errors import MissingDependency, UsageError
    from scenewright.stages.disparity.raft.checkpoint import convert

    if out.suffix != ".safetensors":
        raise UsageError(f"{out}: the file to write must end in .safetensors")
    if out.exists():
        raise UsageError(f"{out}: exists", hint="choose another --out")
    if not file.is_file():
        raise MissingDependency(f"{file}: no such file", hint="fetch the authors' models, see docs/MAPPING.md")
    convert(file, out)
    output.out(str(out))
    return 0
