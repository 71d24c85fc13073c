"""Comparison: the enhancer in PyTorch with its fused Adam. It needs `pip install -e
".[benchmarks]"`.
"""

import numpy as np
import torch

from benchmarks.examples import HIDDEN_UNITS, WINDOW, Work


def enhancer_step(num_steps: int) -> Work:
    """Prepares training steps of 15 windows in random order."""
    widths = (WINDOW, WINDOW, HIDDEN_UNITS, HIDDEN_UNITS, WINDOW)
    stack = []
    for number, (inputs, outputs) in enumerate(zip(widths[:-1], widths[1:], strict=True)):
        stack += [torch.nn.Linear(inputs, outputs)] + ([torch.nn.ReLU()] if number < 3 else [])
    model = torch.nn.Sequential(*stack)
    adam = torch.optim.Adam(model.parameters(), lr=0.001, fused=True)
    loss = torch.nn.MSELoss()
    rng = np.random.default_rng(0)
    source, target = (
        torch.from_numpy(rng.normal(0, 0.5, (15 * num_steps, WINDOW)).astype(np.float32))
        for _ in range(2)
    )

    def run() -> None:
        order = torch.randperm(len(source))
        for first in range(0, len(source), 15):
            rows = order[first : first + 15]
            adam.zero_grad(set_to_none=True)
            loss(model(source[rows]), target[rows]).backward()
            adam.step()

    return run, num_steps
