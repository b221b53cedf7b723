"""The network's normalisations folded into its convolutions: the same function."""

from __future__ import annotations

import torch
from scenewright.stages.segment.backends.network.model import PanopticNetwork, Widths, fold_normalization
from torch import nn


def test_folding_changes_nothing_but_time() -> None:
    torch.manual_seed(0)
    network = PanopticNetwork(3, 5, Widths((4, 6, 8, 8, 8), (4, 6, 8, 8), 1))
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            for values in (module.running_mean, module.weight, module.bias):
                nn.init.normal_(values)
            nn.init.uniform_(module.running_var, 0.5, 2.0)
    network.eval()
    images = torch.randn(1, 3, 48, 64)
    before = sum(isinstance(module, nn.BatchNorm2d) for module in network.modules())
    with torch.inference_mode():
        plain = network(images)
        folded = fold_normalization(network)(images)
    left = [module for module in network.modules() if isinstance(module, nn.BatchNorm2d)]
    assert before > 2 * len(network.merge) and len(left) == len(
        network.merge
    )  # those of sums, before which no convolution stands
    for one, other in zip(plain, folded, strict=True):
        torch.testing.assert_close(other, one, rtol=1e-4, atol=1e-4)
