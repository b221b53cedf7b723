"""A training run's numbers on disk: weights, their moving average, and the optimiser's state, whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import torch
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors

FILE = "state.safetensors"


def write_state(
    folder: Path,
    network: torch.nn.Module,
    average: dict[str, torch.Tensor],
    optimizer: torch.optim.Optimizer,
    step: int,
) -> None:
    """Write the state after `step` steps below a folder, which is made."""
    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in average.items()}
    for number, entry in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{number}.{name}": value for name, value in entry.items()}
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {name: value.detach().cpu().contiguous().numpy() for name, value in tensors.items()}
    write_safetensors(folder / "state.new", arrays, {"step": str(step)})
    os.replace(folder / "state.new", folder / FILE)


def read_state(
    folder: Path, network: torch.nn.Module, optimizer: torch.optim.Optimizer
) -> tuple[dict[str, torch.Tensor], int]:
    """Put a written state into network and optimiser; return the moving average and the steps taken.

    Raises BadInput for a damaged file.
    """
    arrays, metadata = read_safetensors(folder / FILE)
    parts: dict[str, dict[str, torch.Tensor]] = {"network": {}, "average": {}, "optimizer": {}}
    for name, array in arrays.items():
        head, _, rest = name.partition(".")
        parts[head][rest] = torch.from_numpy(array)
    network.load_state_dict(parts["network"])
    parameters = list(network.parameters())
    entries: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in parts["optimizer"].items():
        number, _, rest = name.partition(".")
        # The fused optimiser walks through memory: its state must lie there in the order of the parameter.
        like = parameters[int(number)]
        laid = torch.empty_like(like).copy_(value) if value.shape == like.shape else value
        entries.setdefault(int(number), {})[rest] = laid.detach()
    optimizer.load_state_dict({"state": entries, "param_groups": optimizer.state_dict()["param_groups"]})
    return parts["average"], int(metadata["step"])
