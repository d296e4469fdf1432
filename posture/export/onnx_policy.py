"""The deterministic policy as an ONNX file: senses in, normalisation inside, mean command out.

The file's metadata says what stands where: `observation` and `action` are lists of names and units, as JSON.
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
from envs.task.observations import components
from posture.config.errors import ConfigError, RunError
from posture.config.train import TrainConfig
from posture.storage.atomic import replacing

NEEDED = ("onnx", "onnxscript", "onnxruntime")
"""Packages of the extra `export`."""
OPSET = 18
TOLERANCE = 1e-5
"""Commands of the file and of torch may differ by so much, relative to the largest where that is above 1."""
CHECKED = 1000
"""Random observations that both are asked about."""

MEANING = {
    "frames": "x forward, y left, z up; positions and velocities in the world frame, which the feet stand in at the start",
    "signs": "joint angles about +y, child relative to parent: hip flexion and ankle when leaning forward are negative",
    "torque": "each joint of a kind gets the actuator torque torque_limit_nm x action, action clipped to [-1, 1]",
    "timing": "one action each control_dt_s, held till the next; *_last_action is the clipped one before, 0 at the start",
}


def check_installed() -> None:
    """Raise ConfigError where a package of the extra `export` is missing."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(
            f"what: policy needs {', '.join(missing)}, not installed here: pip install -c constraints.txt -e '.[export]', "
            "or what=[trajectories] without"
        )


def senses(run: TrainConfig) -> list[tuple[str, str]]:
    """Name and unit of each value of the observation that the policy of `run` is given, in order."""
    terms = [term for group in run.agent.obs_groups.actor for term in run.env.observations[group]]
    return components(terms)


def write_onnx(policy: MLPModel, run: TrainConfig, model: Path, path: Path) -> float:
    """Write `policy`, that of checkpoint `model` of `run`, to `path` once onnxruntime gives its commands; atomic.

    Input `observation` (batch, size), output `action` (batch, 2), both float32. Returns the largest difference from torch
    over `CHECKED` random observations. Raises RunError where it is beyond `TOLERANCE`.
    """
    import onnx
    import onnxruntime

    net = policy.to("cpu").as_onnx(verbose=False).eval()
    for chatty in ("torch.onnx", "onnxscript", "onnx_ir"):  # of packages not there, and of each step
        logging.getLogger(chatty).setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of torch about itself
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
    seen = _random_observations(net)
    with torch.inference_mode():
        expected = net(seen).numpy()
    (given,) = session.run(["action"], {"observation": seen.numpy()})
    difference = float(np.abs(given - expected).max())
    if not difference <= TOLERANCE * max(1.0, float(np.abs(expected).max())):
        raise RunError(f"{path.name}: its commands differ from the policy's by {difference:.2g}; nothing was written")
    with replacing(path) as temporary:
        temporary.write_bytes(proto.SerializeToString())
    return difference


def metadata(run: TrainConfig, model: Path) -> dict[str, str]:
    """What the ONNX file says about itself."""

    def listed(values: list[tuple[str, str]]) -> str:
        return json.dumps([{"name": name, "unit": unit} for name, unit in values])

    return {
        "observation": listed(senses(run)),
        "action": listed([(kind, "1") for kind in KINDS]),
        "torque_limit_nm": repr(run.env.torque_limit),
        "control_dt_s": repr(run.env.control_dt),
        "policy": f"{model.parent.name}/{model.name}",
        "policy_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        **MEANING,
    }


def _random_observations(net: Any) -> torch.Tensor:
    """Observations spread as those that the policy was trained on. (CHECKED, size)."""
    draw = torch.randn(CHECKED, net.input_size, generator=torch.Generator().manual_seed(0))
    normaliser = net.obs_normalizer
    return draw if isinstance(normaliser, torch.nn.Identity) else normaliser.mean + normaliser.std * draw
