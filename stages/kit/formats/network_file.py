"""A network's numbers in a safetensors file: written as float16, and held against what the network needs when read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.safetensors_file import write_safetensors

COUNTER = "num_batches_tracked"
"""Name of a counter of batch normalisation; not needed to use a network, and not written."""


def write_network(path: Path, network: torch.nn.Module, metadata: Mapping[str, str]) -> None:
    """Write the network's tensors as float16, with what is needed to read them."""
    tensors = {
        name: tensor.detach().to(torch.float16).contiguous().numpy()
        for name, tensor in network.state_dict().items()
        if not name.endswith(COUNTER)
    }
    write_safetensors(path, tensors, metadata)


def put_tensors(network: torch.nn.Module, tensors: Mapping[str, np.ndarray], where: str, hint: str) -> None:
    """Give a network, which may lie on the meta device, these tensors as float32; it is then ready to use.

    Raises BadInput, beginning with `where`, for tensors that it has not or lacks, of another shape, or not finite.
    """
    state = network.state_dict()
    needed = {name for name in state if not name.endswith(COUNTER)}
    for name in sorted(needed | {name for name in tensors if not name.endswith(COUNTER)}):
        shape = tuple(tensors[name].shape) if name in tensors else None
        expected = tuple(state[name].shape) if name in needed else None
        if shape != expected:
            raise BadInput(f"{where}: tensor {name!r} has shape {shape}, the network needs {expected}", hint=hint)
        if not np.isfinite(tensors[name]).all():
            raise BadInput(f"{where}: tensor {name!r} holds numbers that are not finite", hint=hint)
    numbers = {name: torch.from_numpy(tensors[name].astype(np.float32)) for name in needed}
    numbers |= {name: torch.tensor(0) for name in state.keys() - needed}
    network.load_state_dict(numbers, assign=True)
    network.eval()
    choose_vector_kernels()


def choose_vector_kernels() -> None:
    """Have torch's library of vector mathematics choose its kernels now, on one thread.

    It chooses at the first call; when that comes from two threads at once, one may still compute with another kernel,
    and the first result of a process had other last digits in one run of three.
    """
    few_numbers = torch.linspace(-1.0, 1.0, 64)
    for function in (torch.tanh, torch.exp, torch.sigmoid):
        function(few_numbers)
