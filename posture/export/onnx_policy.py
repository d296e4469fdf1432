"""The deterministic policy as an ONNX file: observation in, mean action out, normalisation included.

The metadata of the file describe its input and output: `observation` and `action` are JSON lists of names and units.
"""

import hashlib
import importlib.util
import json
import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rsl_rl.models import MLPModel

from envs.body.joints import KINDS
from posture.config.errors import ConfigError, RunError
from posture.config.train import TrainConfig
from posture.storage.atomic import replacing

NEEDED = ("onnx", "onnxscript", "onnxruntime")
"""Packages of the extra `export`."""
OPSET = 18
TOLERANCE = 1e-5
"""Largest difference between the actions of the file and of torch, relative to the largest action if that is above 1."""
CHECKED = 1000
"""Number of random observations compared."""

MEANING = {
    "frames": "x forward, y left, z up; positions and velocities in the world frame",
    "signs": "joint angles about +y, child relative to parent: hip flexion and ankle when leaning forward are negative",
    "torque": "each joint of a kind gets the actuator torque torque_limit_nm x action, action clipped to [-1, 1]",
    "timing": "one action each control_dt_s, held until the next; *_last_action is the previous clipped one, 0 at the start",
}


def check_installed() -> None:
    """Raise ConfigError if a package of the extra `export` is missing."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(
            f"what=[policy] needs {', '.join(missing)}, which is not installed: "
            "python -m pip install onnx onnxscript onnxruntime, or use what=[trajectories]"
        )


def observed(run: TrainConfig) -> list[tuple[str, str]]:
    """Name and unit of each value that the policy of `run` observes, in order."""
    return [component for group in run.agent.obs_groups.actor for component in run.env.observed[group]]


def write_onnx(policy: MLPModel, run: TrainConfig, model: Path, path: Path) -> float:
    """Write `policy`, that of checkpoint `model` of `run`, to `path`, atomically, if onnxruntime gives the same actions.

    Input `observation` (batch, size), output `action` (batch, 2), both float32. Returns the largest difference from torch
    over `CHECKED` random observations. Raises RunError if it exceeds `TOLERANCE`.
    """
    import onnx
    import onnxruntime

    net = policy.to("cpu").as_onnx(verbose=False).eval()
    for name in ("torch.onnx", "onnxscript", "onnx_ir"):  # they report optional packages and every step
        logging.getLogger(name).setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # torch's own
        program = torch.onnx.export(
            net,
            (torch.zeros(2, net.input_size),),
            input_names=["observation"],
            output_names=["action"],
            dynamic_shapes=({0: torch.export.Dim("batch")},),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    proto = program.model_proto
    onnx.helper.set_model_props(proto, metadata(run, model))
    onnx.checker.check_model(proto, full_check=True)
    session = onnxruntime.InferenceSession(proto.SerializeToString(), providers=["CPUExecutionProvider"])
    observation = _random_observations(net)
    with torch.inference_mode():
        expected = net(observation).numpy()
    (action,) = session.run(["action"], {"observation": observation.numpy()})
    difference = float(np.abs(action - expected).max())
    if not difference <= TOLERANCE * max(1.0, float(np.abs(expected).max())):
        raise RunError(f"{path.name}: its actions differ from the policy's by {difference:.2g}; nothing was written")
    with replacing(path) as temporary:
        temporary.write_bytes(proto.SerializeToString())
    return difference


def metadata(run: TrainConfig, model: Path) -> dict[str, str]:
    """Metadata of the ONNX file."""

    def listed(values: list[tuple[str, str]]) -> str:
        return json.dumps([{"name": name, "unit": unit} for name, unit in values])

    sensing, actuation = run.env.sensing, run.env.actuation
    meaning = dict(MEANING)
    if actuation.time_constant:
        meaning["torque"] = (
            "each joint of a kind gets the actuator torque torque_limit_nm x activation, which is 0 at the start; before "
            f"each step (1 - exp(-control_dt_s / {actuation.time_constant:g})) x (action - activation) is added to it, "
            "action clipped to [-1, 1]"
        )
    if steps := sensing.delay_steps(run.env.control_dt):
        meaning["delay"] = (
            f"observations are those of {steps} steps before, at first those of the start; *_last_action and the "
            "properties of the body are not late"
        )
    return {
        "observation": listed(observed(run)),
        "action": listed([(kind, "1") for kind in KINDS]),
        "torque_limit_nm": repr(run.env.torque_limit),
        "control_dt_s": repr(run.env.control_dt),
        "policy": f"{model.parent.name}/{model.name}",
        "policy_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        **meaning,
    }


def _random_observations(net: Any) -> torch.Tensor:
    """Observations with the mean and the spread of those in training. (CHECKED, size)."""
    draw = torch.randn(CHECKED, net.input_size, generator=torch.Generator().manual_seed(0))
    normaliser = net.obs_normalizer
    return draw if isinstance(normaliser, torch.nn.Identity) else normaliser.mean + normaliser.std * draw
