"""Checkpoints: the authors' .pth, read without executing anything, and the safetensors that are made of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from scenewright.schemas.errors import BadInput
from scenewright.stages.disparity.raft.architecture import OTHER_FILE, architecture_of
from scenewright.stages.disparity.raft.network import RaftStereo
from scenewright.stages.kit.formats.network_file import put_tensors, write_network
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors

FORMAT = "RAFT-Stereo checkpoint"
PREFIX = "module."
"""Prefix of every name in the authors' files, which were saved from several devices at once."""


def load_network(path: Path) -> RaftStereo:
    """Return the network of a checkpoint, ready to use. Raises BadInput for a damaged file, tensors of another network,
    and numbers that are not finite."""
    return network_of(read_tensors(path), str(path))


def network_of(tensors: dict[str, np.ndarray], where: str) -> RaftStereo:
    """Return the network with these tensors. Raises BadInput when they do not fit one of RAFT-Stereo's sizes."""
    sizes = architecture_of({name: tensor.shape for name, tensor in tensors.items()}, where)
    with torch.device("meta"):
        network = RaftStereo(sizes)
    put_tensors(network, tensors, where, OTHER_FILE)
    return network


def read_tensors(path: Path) -> dict[str, np.ndarray]:
    """Return name -> array of a .pth or .safetensors file, names without the authors' prefix. Raises BadInput."""
    path = Path(path)
    if path.suffix == ".safetensors":
        return read_safetensors(path)[0]
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # the reader has errors of its own for every way in which a file is none
        reason = (str(error).splitlines() or [type(error).__name__])[0][:160]
        raise BadInput(f"{path}: no checkpoint that can be read: {reason}", hint=OTHER_FILE) from None
    if isinstance(content, dict) and isinstance(content.get("state_dict"), dict):
        content = content["state_dict"]
    is_state = isinstance(content, dict) and all(
        isinstance(name, str) and isinstance(tensor, torch.Tensor) for name, tensor in content.items()
    )
    if not is_state:
        raise BadInput(f"{path}: holds no table of tensors", hint=OTHER_FILE)
    return {name.removeprefix(PREFIX): tensor.detach().numpy() for name, tensor in content.items()}


def convert(source: Path, target: Path) -> None:
    """Write a checkpoint as safetensors, when its tensors are those of a RAFT-Stereo network. Raises BadInput."""
    tensors = read_tensors(source)
    network_of(tensors, str(source))
    write_safetensors(target, tensors, {"format": FORMAT, "source": Path(source).name})


def save_network(path: Path, network: RaftStereo, description: str) -> None:
    """Write a network of ours as safetensors of float16."""
    write_network(path, network, {"format": FORMAT, "description": description})
