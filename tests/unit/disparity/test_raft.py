"""RAFT-Stereo: names and shapes of the published checkpoints, files with small ones, and the parts in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from scenewright.cli.weights_command import convert_weights
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.stages.disparity.raft import matching
from scenewright.stages.disparity.raft.architecture import SMALL as TRAINED_HERE
from scenewright.stages.disparity.raft.architecture import Architecture, architecture_of
from scenewright.stages.disparity.raft.checkpoint import convert, load_network, network_of, save_network
from scenewright.stages.disparity.raft.correlation import RowCorrelation
from scenewright.stages.disparity.raft.network import RaftStereo, padded, upsampled
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors
from scenewright.stages.kit.stereo.disparity_map import DisparityMap

from tests.unit.disparity.pairs import pair

SMALL = Architecture(
    widths=(4, 6, 8), hidden=(8, 8, 8), features=8, motion=(4, 8), head=8, mask=8, radius=2, downsample=2
)
SMALL_FAST = Architecture(
    widths=(4, 6, 8), hidden=(8, 8, 8), scales=2, features=8, motion=(4, 8), head=8, mask=8, downsample=3, shared=True
)


def small_state(sizes: Architecture = SMALL, seed: int = 0) -> dict[str, torch.Tensor]:
    """Return a state dict with the authors' prefix."""
    torch.manual_seed(seed)
    return {f"module.{name}": tensor for name, tensor in RaftStereo(sizes).state_dict().items()}


def convolution(name: str, outside: int, inside: int, size: int) -> dict[str, tuple[int, ...]]:
    return {f"{name}.weight": (outside, inside, size, size), f"{name}.bias": (outside,)}


def batch_norm(name: str, channels: int) -> dict[str, tuple[int, ...]]:
    names = ("weight", "bias", "running_mean", "running_var")
    return {f"{name}.{one}": (channels,) for one in names} | {f"{name}.num_batches_tracked": ()}


def published(shared: bool = False, scales: int = 3, factor: int = 4) -> dict[str, tuple[int, ...]]:
    """The tensors of the authors' checkpoints, written out anew from the paper's description and their listing."""
    found: dict[str, tuple[int, ...]] = {}

    def block(name: str, inside: int, outside: int, norm: bool, cut: bool) -> None:
        found.update(
            convolution(f"{name}.conv1", outside, inside, 3) | convolution(f"{name}.conv2", outside, outside, 3)
        )
        if norm:
            found.update(batch_norm(f"{name}.norm1", outside) | batch_norm(f"{name}.norm2", outside))
        if cut:
            found.update(convolution(f"{name}.downsample.0", outside, inside, 1))
            if norm:
                found.update(batch_norm(f"{name}.norm3", outside) | batch_norm(f"{name}.downsample.1", outside))

    def trunk(name: str, norm: bool, layers: list[tuple[int, int]]) -> None:
        found.update(convolution(f"{name}.conv1", 64, 3, 7))
        if norm:
            found.update(batch_norm(f"{name}.norm1", 64))
        for number, (inside, outside) in enumerate(layers, start=1):
            halved = inside != outside or number > 3
            block(f"{name}.layer{number}.0", inside, outside, norm, halved)
            block(f"{name}.layer{number}.1", outside, outside, norm, False)

    trunk("cnet", True, [(64, 64), (64, 96), (96, 128), (128, 128), (128, 128)])
    for which in (0, 1):
        for size in ("08", "16"):
            block(f"cnet.outputs{size}.{which}.0", 128, 128, True, False)
            found.update(convolution(f"cnet.outputs{size}.{which}.1", 128, 128, 3))
        found.update(convolution(f"cnet.outputs32.{which}", 128, 128, 3))
    if shared:
        block("conv2.0", 128, 128, False, False)
        found.update(convolution("conv2.1", 256, 128, 3))
    else:
        trunk("fnet", False, [(64, 64), (64, 96), (96, 128)])
        found.update(convolution("fnet.conv2", 256, 128, 1))
    for number in range(scales):
        found.update(convolution(f"context_zqr_convs.{number}", 384, 128, 3))
    motion = {
        "convc1": (64, 36, 1),
        "convc2": (64, 64, 3),
        "convf1": (64, 2, 7),
        "convf2": (64, 64, 3),
        "conv": (126, 128, 3),
    }
    for name, (outside, inside, size) in motion.items():
        found.update(convolution(f"update_block.encoder.{name}", outside, inside, size))
    for unit, told in (("gru08", 256), ("gru16", 256 if scales == 3 else 128), ("gru32", 128)):
        for gate in ("convz", "convr", "convq"):
            found.update(convolution(f"update_block.{unit}.{gate}", 128, 128 + told, 3))
    found.update(convolution("update_block.flow_head.conv1", 256, 128, 3))
    found.update(convolution("update_block.flow_head.conv2", 2, 256, 3))
    found.update(convolution("update_block.mask.0", 256, 128, 3))
    found.update(convolution("update_block.mask.2", 9 * factor**2, 256, 1))
    return found


@pytest.mark.parametrize(
    ("shared", "scales", "factor", "sizes"),
    [(False, 3, 4, Architecture()), (True, 2, 8, Architecture(shared=True, scales=2, downsample=3))],
)
def test_names_and_shapes_are_those_of_the_published_checkpoints(
    shared: bool, scales: int, factor: int, sizes: Architecture
) -> None:
    expected = published(shared, scales, factor)
    with torch.device("meta"):
        network = RaftStereo(sizes)
    assert {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()} == expected
    assert architecture_of(expected, "file") == sizes


def test_the_published_networks_have_the_published_number_of_parameters() -> None:
    with torch.device("meta"):
        assert 11.0e6 < sum(parameter.numel() for parameter in RaftStereo().parameters()) < 11.3e6  # paper: 11.23 M


@pytest.mark.parametrize("sizes", [SMALL, SMALL_FAST])
def test_a_checkpoint_with_the_authors_prefix_loads_and_converts(tmp_path: Path, sizes: Architecture) -> None:
    torch.save(small_state(sizes), tmp_path / "raft.pth")
    convert(tmp_path / "raft.pth", tmp_path / "raft.safetensors")
    networks = [load_network(tmp_path / name) for name in ("raft.pth", "raft.safetensors")]
    assert networks[0].sizes == sizes
    pictures = [torch.rand(3, 50, 70) * 255 for _ in range(2)]
    first, second = (network(*pictures, 3) for network in networks)
    assert first.shape == (50, 70) and torch.isfinite(first).all() and torch.equal(first, second)
    assert read_safetensors(tmp_path / "raft.safetensors")[1]["source"] == "raft.pth"


def test_both_directions_give_a_confidence() -> None:
    tensors = {name.removeprefix("module."): tensor.numpy() for name, tensor in small_state().items()}
    random = np.random.default_rng(0)
    left, right = (random.integers(0, 255, (48, 64, 3), np.uint8) for _ in range(2))
    found = matching.match(network_of(tensors, "small"), left, right, 2, 1.0, "cpu")
    assert found.disparity.shape == (48, 64) and (found.confidence[~found.known] == 0).all()
    assert (found.disparity[found.known] > 0).all()


def test_the_small_network_stays_within_its_reach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_network(tmp_path / "ours.safetensors", RaftStereo(TRAINED_HERE), "random")
    torch.save(small_state(), tmp_path / "theirs.pth")
    seen = []

    def recorded(network: object, left: np.ndarray, *given: object) -> DisparityMap:
        seen.append((left.shape[:2], given[1], given[4:]))
        return DisparityMap(np.full(left.shape[:2], 10.0, np.float32), np.ones(left.shape[:2], np.float32))

    monkeypatch.setattr(matching, "match", recorded)
    picture = np.zeros((40, 60, 3), np.uint8)
    for name, iterations, found, value in (
        ("ours.safetensors", None, (20.0, 60.0), 10.0),
        ("ours.safetensors", 3, (200.0, 340.0), 20.0),
        ("theirs.pth", None, (200.0, 340.0), 10.0),
    ):
        monkeypatch.setattr(matching, "usual_range", lambda left, right, found=found: found)
        matcher, detail = matching.open_raft(tmp_path / name, iterations, 1.0, "cpu")
        whole = matcher(picture, picture, (7, 16))
        assert whole.disparity.shape == whole.confidence.shape == (40, 60) and (whole.disparity == value).all()
        assert f"{seen[-1][1]} updates at 1/4" in detail
    assert seen == [((40, 60), 5, (14,)), ((20, 30), 3, (94,)), ((40, 60), 32, ())]


def test_disparities_count_from_where_the_search_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    def half(network: object, left: np.ndarray, right: np.ndarray, iterations: int, device: str) -> np.ndarray:
        return np.full(left.shape[:2], 1.5, np.float32)

    monkeypatch.setattr(matching, "estimated", half)
    left, right = pair()[:2]
    found = matching.match(RaftStereo(SMALL), left, right, 1, 1.0, "cpu", 10)
    assert found.known.any() and (found.disparity[found.known] == 11.5).all()


class Evil:
    """Calls a function when it is unpickled."""

    def __reduce__(self) -> tuple:
        return (print, ("executed",))


@pytest.mark.filterwarnings("ignore:Detected pickle protocol")
def test_files_that_are_no_checkpoint_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "raft.pth"
    path.write_bytes(b"cbuiltins\nprint\n(S'executed'\ntR.")
    with pytest.raises(BadInput, match="no checkpoint that can be read"):
        load_network(path)
    torch.save({"model": Evil()}, path)
    with pytest.raises(BadInput, match="no checkpoint that can be read"):
        load_network(path)
    torch.save([torch.zeros(3)], path)
    with pytest.raises(BadInput, match="no table of tensors"):
        load_network(path)
    torch.save({"module.conv1.weight": torch.zeros(3)}, path)
    with pytest.raises(BadInput, match="no checkpoint of RAFT-Stereo"):
        load_network(path)
    torch.save(small_state(), path)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(BadInput, match="no checkpoint that can be read"):
        load_network(path)
    assert "executed" not in capsys.readouterr().out


@pytest.mark.parametrize("fault", ["shape", "missing", "extra", "nan"])
def test_tensors_that_do_not_fit_are_named(tmp_path: Path, fault: str) -> None:
    state = {name.removeprefix("module."): tensor.numpy() for name, tensor in small_state().items()}
    name = "update_block.flow_head.conv2.weight"
    if fault == "shape":
        state[name] = np.zeros((2, 3, 3, 3), np.float32)
    elif fault == "missing":
        del state[name]
    elif fault == "extra":
        state[name := "fnet.layer9.weight"] = np.zeros(3, np.float32)
    else:
        state[name] = np.full_like(state[name], np.nan)
    write_safetensors(tmp_path / "raft.safetensors", state, {})
    with pytest.raises(BadInput, match=name):
        load_network(tmp_path / "raft.safetensors")


def test_the_correlation_is_that_of_a_plain_loop() -> None:
    torch.manual_seed(0)
    left, right = torch.randn(1, 5, 2, 8), torch.randn(1, 5, 2, 8)
    column = torch.tensor([[[-3.0, 0.0, 0.5, 1.25, 3.0, 6.75, 7.0, 20.0]] * 2])
    found = RowCorrelation(left, right, 2, 1).at(column)
    for row in range(2):
        line = [float(left[0, :, row, 2] @ right[0, :, row, k]) / math.sqrt(5) for k in range(8)]
        for level, values in enumerate((line, [(line[k] + line[k + 1]) / 2 for k in range(0, 8, 2)])):
            for number, offset in enumerate((-1, 0, 1)):
                place = 0.5 / 2**level + offset
                low = math.floor(place)
                taken = [values[k] if 0 <= k < len(values) else 0.0 for k in (low, low + 1)]
                expected = (1 - (place - low)) * taken[0] + (place - low) * taken[1]
                assert found[0, 3 * level + number, row, 2].item() == pytest.approx(expected, abs=1e-5)
    assert (found[0, :3, :, 7] == 0).all()


def test_upsampling_takes_means_of_cells() -> None:
    coarse = torch.arange(6.0).reshape(1, 1, 2, 3)
    weights = torch.zeros(1, 9, 2, 2, 2, 3)
    weights[:, 4] = 100.0  # the cell itself
    weights[:, 4, 0, 1], weights[:, 5, 0, 1] = 0.0, 100.0  # upper right pixel: the cell to the right
    full = upsampled(coarse, weights.reshape(1, 36, 2, 3), 2)[0]
    assert full.shape == (4, 6)
    assert full[0].tolist() == pytest.approx([0, 2, 2, 4, 4, 0])
    assert full[1].tolist() == pytest.approx([0, 0, 2, 2, 4, 4])


def test_pictures_are_padded_to_multiples_of_32_in_the_middle() -> None:
    picture = torch.rand(1, 3, 33, 70)
    full = padded(picture)
    assert full.shape == (1, 3, 64, 96) and torch.equal(full[:, :, 15:48, 13:83], picture)


def test_the_command_converts_and_overwrites_nothing(tmp_path: Path) -> None:
    torch.save(small_state(), tmp_path / "raft.pth")
    made = tmp_path / "raft.safetensors"
    assert convert_weights(tmp_path / "raft.pth", made) == 0 and load_network(made).sizes == SMALL
    with pytest.raises(UsageError, match="exists"):
        convert_weights(tmp_path / "raft.pth", made)
    with pytest.raises(UsageError, match="written as .safetensors"):
        convert_weights(tmp_path / "raft.pth", tmp_path / "raft.bin")
    with pytest.raises(MissingDependency, match="no such file"):
        convert_weights(tmp_path / "nowhere.pth", tmp_path / "other.safetensors")
