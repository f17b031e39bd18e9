"""Deformable convolution with modulation, in plain PyTorch.

Source: Zhu et al., "Deformable ConvNets v2: more deformable, better results", CVPR 2019, equation 1:
`y(p) = sum_k w_k x(p + p_k + dp_k(p)) dm_k(p)`, bilinear between pixels and 0 outside of the image.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional


def deformable_conv2d(
    x: Tensor, offsets_px: Tensor, modulation: Tensor, weight: Tensor, bias: Tensor, *, stride: int, padding: int
) -> Tensor:
    """The convolution of `x` at displaced places.

    Args:
        x: (B, C, H, W).
        offsets_px: (B, 2 K, h, w) for each of the K taps, row by row, its displacement down and to the right.
        modulation: (B, K, h, w) factor of each tap.
        weight: (O, C, k, k) with k k = K.
        bias: (O,).
        stride: from one output to the next.
        padding: rows and columns of 0 around `x`.

    Returns:
        (B, O, h, w).
    """
    batch, channels, height, width = x.shape
    out_channels, _, kernel, _ = weight.shape
    taps, rows, columns = modulation.shape[1:]
    # Places are told in float32 at least: float16 has no sixteenth of a pixel beyond 64.
    exact = torch.promote_types(x.dtype, torch.float32)
    row, column, tap = (torch.arange(count, device=x.device) for count in (rows, columns, taps))
    v = (row * stride - padding)[:, None] + (tap // kernel)[:, None, None] + offsets_px[:, 0::2].to(exact)
    u = (column * stride - padding) + (tap % kernel)[:, None, None] + offsets_px[:, 1::2].to(exact)
    grid = torch.stack([(2 * u + 1) / width - 1, (2 * v + 1) / height - 1], dim=-1)
    sampled = functional.grid_sample(
        x.to(exact), grid.reshape(batch, taps * rows, columns, 2), padding_mode="zeros", align_corners=False
    )
    sampled = sampled.reshape(batch, channels, taps, rows * columns).to(x.dtype)
    sampled = sampled * modulation.reshape(batch, 1, taps, rows * columns)
    flat = weight.reshape(out_channels, channels * taps) @ sampled.reshape(batch, channels * taps, rows * columns)
    return (flat + bias[:, None]).reshape(batch, out_channels, rows, columns)


class DeformableConv2d(nn.Module):
    """A 3x3 convolution that learns where to look, and how much each place counts.

    Args:
        channels_in: of the input.
        channels_out: of the output.
        stride: from one output to the next.
    """

    KERNEL = 3

    def __init__(self, channels_in: int, channels_out: int, stride: int) -> None:
        super().__init__()
        self._stride = stride
        taps = self.KERNEL**2
        self.weight = nn.Parameter(torch.empty(channels_out, channels_in, self.KERNEL, self.KERNEL))
        self.bias = nn.Parameter(torch.zeros(channels_out))
        self.conv_offset_mask = nn.Conv2d(channels_in, 3 * taps, self.KERNEL, stride, padding=1)
        nn.init.kaiming_uniform_(self.weight, a=5**0.5)
        for told in self.conv_offset_mask.parameters():
            nn.init.zeros_(told)  # it begins as an ordinary convolution of half the weight

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to (B, O, h, w)."""
        taps = self.KERNEL**2
        told = self.conv_offset_mask(x)
        offsets_px, modulation = told[:, : 2 * taps], torch.sigmoid(told[:, 2 * taps :])
        return deformable_conv2d(
            x, offsets_px, modulation, self.weight, self.bias, stride=self._stride, padding=self.KERNEL // 2
        )
