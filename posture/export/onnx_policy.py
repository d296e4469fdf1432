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

from envs.body.joints import FEET, JOINTS, KINDS
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

COMPONENTS: dict[str, list[tuple[str, str]]] = {
    "torso_height": [("torso_z", "m")],
    "torso_velocity": [(f"torso_v{axis}", "m/s") for axis in "xyz"],
    "torso_angular_velocity": [(f"torso_w{axis}", "rad/s") for axis in "xyz"],
    "torso_pitch": [("torso_pitch", "rad")],
    "torso_motion": [("torso_vx", "m/s"), ("torso_vz", "m/s"), ("torso_wy", "rad/s")],
    "torso_orientation": [("torso_yaw", "rad"), ("torso_roll", "rad"), ("torso_upright", "1")],
    "joint_angle": [(f"{joint}_angle", "rad") for joint in JOINTS],
    "joint_velocity": [(f"{joint}_velocity", "rad/s") for joint in JOINTS],
    "hip_ankle_angle": [(f"{kind}_angle_mean", "rad") for kind in KINDS],
    "hip_ankle_velocity": [(f"{kind}_velocity_mean", "rad/s") for kind in KINDS],
    "joint_force": [(f"{joint}_torque_with_spring_and_damper", "Nm") for joint in JOINTS],
    "foot_position": [(f"{foot}_{axis}", "m") for foot in FEET for axis in "xyz"],
    "feet_place": [("feet_x_mean", "m"), ("feet_z_mean", "m")],
    "foot_wrench": [
        (f"{foot}_{kind}{axis}", unit) for foot in FEET for kind, unit in (("f", "N"), ("m", "Nm")) for axis in "xyz"
    ],
    "sole_load": [("heels_fz", "N"), ("toes_fz", "N")],
    "head": [("head_x", "m"), ("head_vx", "m/s")],
    "last_action": [(f"{joint}_last_action", "1") for joint in JOINTS],
    "last_command": [(f"{kind}_last_action", "1") for kind in KINDS],
    "target": [("target_x", "m")],
    "target_velocity": [("target_vx", "m/s")],
    "target_error": [("target_x_minus_head_x", "m")],
}
"""Name and unit of each value of each term of `envs.task.observations.TERMS`, in order; what they mean is written there."""
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
    return [component for term in terms for component in COMPONENTS[term]]


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

    def listed(components: list[tuple[str, str]]) -> str:
        return json.dumps([{"name": name, "unit": unit} for name, unit in components])

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
