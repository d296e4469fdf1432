"""Operations on a GPU that are launched together, as a CUDA graph."""

from collections.abc import Callable, Sequence

import torch
import warp as wp


class CudaGraph:
    """The operations of `function`, captured once and launched together at each call; returns copies of its tensors.

    The function's Python code runs at the capture alone: what it reads must be tensors that stay in their memory, or numbers
    that never change. It must have run before, so that nothing is compiled during the capture.
    """

    def __init__(self, function: Callable[[], Sequence[torch.Tensor]], device: torch.device) -> None:
        self._graph = torch.cuda.CUDAGraph()
        with torch.cuda.device(device):
            stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
            capture = torch.cuda.graph(self._graph, stream=stream, capture_error_mode="thread_local")
            on_stream = wp.stream_from_torch(stream)
            # Warp launches on its own stream by default, and has to know of a capture that torch began.
            with wp.ScopedStream(on_stream), capture, wp.ScopedCapture(stream=on_stream, external=True):
                self._results = function()

    def __call__(self) -> list[torch.Tensor]:
        """Launch them."""
        self._graph.replay()
        # The next launch writes into the same memory.
        return [result.clone() for result in self._results]
