"""`scenewright models serve`: a backend of `segment` behind HTTP."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

File = Path | None


def serve(
    backend: Annotated[
        str, typer.Option("--backend", help="A backend that judges single frames: huggingface, onnx, geometric, ...")
    ],
    weights: Annotated[File, typer.Option("--weights", help="As of `segment`.", rich_help_panel="Inputs")] = None,
    mask_weights: Annotated[
        File, typer.Option("--mask-weights", help="As of `segment`.", rich_help_panel="Inputs")
    ] = None,
    semantic_weights: Annotated[
        File, typer.Option("--semantic-weights", help="As of `segment`.", rich_help_panel="Inputs")
    ] = None,
    labels: Annotated[File, typer.Option("--labels", help="As of `segment`.", rich_help_panel="Inputs")] = None,
    sidecar: Annotated[File, typer.Option("--sidecar", help="As of `segment`.", rich_help_panel="Inputs")] = None,
    config: Annotated[
        File, typer.Option("--config", help="TOML file of parameters of `segment`.", rich_help_panel="Inputs")
    ] = None,
    words: Annotated[str | None, typer.Option("--words", help="As of `segment`.")] = None,
    score_threshold: Annotated[float | None, typer.Option("--score-threshold", help="As of `segment`.")] = None,
    host: Annotated[
        str,
        typer.Option("--host", help="Address to listen on; others than this machine's own are open to the network."),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port to listen on; 0 takes a free one.")
    ] = 8765,
    device: Annotated[str, typer.Option("--device", help="auto, cpu or cuda.")] = "cpu",
    quiet: Annotated[bool, typer.Option("--quiet", help="Warnings only.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show every request, and the traceback of an error.")] = False,
) -> int:
    """Serve a backend of `segment` over HTTP until it is interrupted (docs/FORMATS.md has the protocol).

    Prints the address to give to `segment --backend` once it answers. There is no encryption and no password.
    """
    from scenewright.cli.segmentation_server import open_server

    option_values = {"backend": backend, "words": words, "score_threshold": score_threshold}
    files = {
        "weights": weights,
        "mask_weights": mask_weights,
        "semantic_weights": semantic_weights,
        "labels": labels,
        "sidecar": sidecar,
    }
    server = open_server(
        {name: value for name, value in option_values.items() if value is not None},
        {role: path for role, path in files.items() if path is not None},
        config=config,
        host=host,
        port=port,
        device=device,
    )
    with server:
        sys.stderr.write(f"serving {server.info.identity}; Ctrl-C ends it\n")
        if server.exposed:
            sys.stderr.write(
                f"warning: {server.address} is open to the network, without password or encryption: whoever reaches"
                " it can use it\n"
            )
        sys.stdout.write(server.address + "\n")
        sys.stdout.flush()
        server.serve_forever(poll_interval=0.2)
    return 0
