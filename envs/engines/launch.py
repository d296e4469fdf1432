"""Warp kernels that are launched again and again with the same arguments, on the stream of torch."""

from collections.abc import Sequence
from typing import Any

import torch
import warp as wp


class Launch:
    """A launch of `kernel` over `dim` threads, recorded once: a call of it does not check and pack the arguments again.

    Arguments are Warp arrays, structs and numbers. The memory of the arrays must stay in place.
    """

    def __init__(self, kernel: Any, dim: int, inputs: Sequence[Any], outputs: Sequence[Any], device: torch.device) -> None:
        self._device = device
        self._command = wp.launch(
            kernel, dim=dim, inputs=list(inputs), outputs=list(outputs), device=str(device), record_cmd=True
        )

    def __call__(self) -> None:
        """Launch it."""
        if self._device.type == "cpu":
            self._command.launch()
        else:
            self._command.launch(stream=wp.stream_from_torch(torch.cuda.current_stream(self._device)))
