"""What a run's configuration says about its checkpoints: which tensors they must hold. Known without the physics.

Thus a checkpoint that does not fit is refused before physics takes seconds to build.
"""

from itertools import chain
from pathlib import Path
from typing import Any, Literal

import torch
from rsl_rl.models import MLPModel
from rsl_rl.utils import resolve_optimizer
from tensordict import TensorDict

from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import checkpoint, provenance, run_dir

OBSERVATION_SIZES = {
    "torso_height": 1,
    "torso_velocity": 3,
    "torso_angular_velocity": 3,
    "torso_pitch": 1,
    "torso_motion": 3,
    "torso_orientation": 3,
    "joint_angle": 4,
    "joint_velocity": 4,
    "hip_ankle_angle": 2,
    "hip_ankle_velocity": 2,
    "joint_force": 4,
    "foot_position": 6,
    "feet_place": 2,
    "foot_wrench": 12,
    "sole_load": 2,
    "head": 2,
    "last_action": 4,
    "last_command": 2,
    "target": 1,
    "target_velocity": 1,
    "target_error": 1,
}
"""Number of values of each term of `envs.task.observations.TERMS`."""
NUM_ACTIONS = 2
"""Commands that the policy gives: `envs.body.joints.KINDS`."""


def network(run: TrainConfig, name: Literal["actor", "critic"]) -> MLPModel:
    """The actor or the critic that `run` trains, with the weights that it starts from."""
    sizes = {group: sum(OBSERVATION_SIZES[term] for term in terms) for group, terms in run.env.observations.items()}
    senses = TensorDict({group: torch.zeros(1, size) for group, size in sizes.items()}, batch_size=[1])
    groups = {name: list(getattr(run.agent.obs_groups, name))}
    config = getattr(run.agent, name).model_dump(mode="json", exclude={"class_name"})
    return MLPModel(senses, groups, name, NUM_ACTIONS if name == "actor" else 1, **config)


def load_policy(content: dict[str, Any], run: TrainConfig, model: Path, device: str | torch.device) -> MLPModel:
    """The deterministic policy in the `content` of checkpoint `model`. Raises ConfigError where it does not fit `run`."""
    return _filled(content, run, "actor", model).to(device).eval()


def check_training(content: dict[str, Any], run: TrainConfig, model: Path) -> None:
    """Raise ConfigError unless the training `run` can go on from the `content` of checkpoint `model`."""
    networks = [_filled(content, run, name, model) for name in ("actor", "critic")]
    weights = list(chain.from_iterable(net.parameters() for net in networks))
    optimiser = resolve_optimizer(run.agent.algorithm.optimizer)(weights, lr=run.agent.algorithm.learning_rate)
    try:
        kept = content["optimizer_state_dict"]
        optimiser.load_state_dict(kept)
        own = {index: weight.shape for index, weight in enumerate(weights)}
        for index, state in kept["state"].items():
            for name, value in state.items():
                if isinstance(value, torch.Tensor) and value.shape not in ((), own[index]):
                    raise ValueError(f"{name} of weight {index} has the shape {tuple(value.shape)}, not {tuple(own[index])}")
        if not _finite(kept):
            raise ValueError("it holds numbers that are not finite")
        if int(content["iter"]) != int(model.stem.removeprefix("model_")):
            raise ValueError(f"it was saved after {content['iter']} iterations")
    except (KeyError, IndexError, AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise ConfigError(f"{model}: training cannot go on from it ({_short(error)})") from None


def check_state(content: dict[str, Any], run: TrainConfig, file: Path) -> int:
    """Number of iterations done, by the `content` of a resume.pt. Raises ConfigError where that is not of `run`."""
    try:
        done, processes = content["iteration"], content["processes"]
        if type(done) is not int or done < 1:
            raise ValueError(f"iteration = {done!r:.50}, allowed is a whole number of at least 1")
        if not isinstance(processes, list) or not processes:
            raise ValueError("it has no processes")
        worlds = run.env.num_envs / len(processes)
        for process in processes:
            for where, name in (("env", "action"), ("env", "episode"), ("env", "freq"), ("logger", "cur_reward_sum")):
                if len(process[where][name]) != worlds:
                    raise ValueError(f"{name} is of {len(process[where][name])} worlds, not {worlds:g}")
            if process["rng"].shape != torch.get_rng_state().shape:
                raise ValueError("rng is not the state of a random number generator")
            float(process["logger"]["tot_time"])
    except (KeyError, IndexError, AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise ConfigError(f"{file}: not the state of this run ({_short(error)})") from None
    return done


def iterations_done(run: Path) -> int:
    """Number of iterations after which `run` can go on. Raises ConfigError where its files do not let it."""
    config, state = run_dir.read_config(run), run / "resume.pt"
    done = check_state(checkpoint.load(state, "cpu"), config, state)
    model = run / f"model_{done}.pt"
    check_training(checkpoint.load(model, "cpu"), config, model)
    provenance.starts(run)
    return done


def training_seconds(run: Path) -> float:
    """What the iterations of `run` took [s], over all its starts. Raises ConfigError where its resume.pt is damaged."""
    state = run / "resume.pt"
    try:
        return float(checkpoint.load(state, "cpu")["processes"][0]["logger"]["tot_time"])
    except (KeyError, IndexError, TypeError, ValueError):
        raise ConfigError(f"{state}: does not say how long the training took") from None


def _filled(content: dict[str, Any], run: TrainConfig, name: Literal["actor", "critic"], model: Path) -> MLPModel:
    """The network `name` of `run` with the weights of a checkpoint, all of them and finite."""
    net = network(run, name)
    own, kept = net.state_dict(), content.get(f"{name}_state_dict")
    where = f"{model}: does not hold this run's {'policy' if name == 'actor' else 'value function'}"
    if not isinstance(kept, dict):
        raise ConfigError(f"{where} (no {name}_state_dict)")
    if kept.keys() != own.keys():
        wrong = sorted(map(str, kept.keys() ^ own.keys()))
        raise ConfigError(f"{where} (too much or missing: {', '.join(wrong):.150})")
    for key, value in own.items():
        given = kept[key]
        if not isinstance(given, torch.Tensor) or given.shape != value.shape or given.dtype != value.dtype:
            raise ConfigError(f"{where} ({key} is {_kind(given)}; allowed is {_kind(value)})")
        if not bool(given.isfinite().all()):
            raise ConfigError(f"{model}: {key} holds weights that are not finite")
    net.load_state_dict(kept)
    return net


def _kind(value: Any) -> str:
    if not isinstance(value, torch.Tensor):
        return type(value).__name__
    return f"{str(value.dtype).removeprefix('torch.')} of shape {tuple(value.shape)}"


def _finite(values: Any) -> bool:
    if isinstance(values, dict):
        return all(map(_finite, values.values()))
    if isinstance(values, (list, tuple)):
        return all(map(_finite, values))
    return bool(torch.as_tensor(values).isfinite().all()) if isinstance(values, (float, torch.Tensor)) else True


def _short(error: Exception) -> str:
    text = " ".join(str(error).split())[:200]
    return f"no {text}" if isinstance(error, KeyError) else text
