"""Checks from its files that a saved training can continue, before physics is built."""

import contextlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import torch
from rsl_rl.utils import resolve_optimizer

from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.learning.networks import load_network
from posture.storage import checkpoint, provenance, run_dir


def iterations_done(run: Path) -> int:
    """Number of iterations after which `run` can continue. Raises ConfigError if its files are not those of a training."""
    config, state = run_dir.read_config(run), run / "resume.pt"
    done, averaged = _check_state(checkpoint.load(state, "cpu"), config, state)
    model = run / f"model_{done}.pt"
    content = checkpoint.load(model, "cpu")
    _check_model(content, config, model)
    if averaged != ("average_state_dict" in content):
        raise ConfigError(f"{model}: not of the same iteration as {state}, of which one alone has averaged weights")
    provenance.starts(run)
    return done


def training_seconds(run: Path) -> float:
    """Duration of all iterations of `run` [s], over all its starts. Raises ConfigError if its resume.pt is damaged."""
    state = run / "resume.pt"
    with _must_be_whole(f"{state}: does not say how long the training took"):
        return float(checkpoint.load(state, "cpu")["processes"][0]["logger"]["tot_time"])


def _check_state(content: dict[str, Any], run: TrainConfig, file: Path) -> tuple[int, bool]:
    """Number of iterations done, and whether weights were averaged, from the `content` of a resume.pt. Raises ConfigError if
    that does not fit `run`."""
    with _must_be_whole(f"{file}: not the state of this run"):
        done, processes = content["iteration"], content["processes"]
        if type(done) is not int or done < 1:
            raise ValueError(f"iteration = {done!r:.50}, allowed is a whole number of at least 1")
        if not isinstance(processes, list) or not processes:
            raise ValueError("it has no processes")
        worlds = run.env.num_envs / len(processes)
        for process in processes:
            for part, name in (("env", "action"), ("env", "episode"), ("env", "freq"), ("logger", "cur_reward_sum")):
                if len(process[part][name]) != worlds:
                    raise ValueError(f"{name} is of {len(process[part][name])} worlds, not {worlds:g}")
            if process["rng"].shape != torch.get_rng_state().shape:
                raise ValueError("rng is not the state of a random number generator")
            float(process["logger"]["tot_time"])
        averaged = content.get("averaged", 0)  # missing in those of older code
        if type(averaged) is not int or averaged < 0:
            raise ValueError(f"averaged = {averaged!r:.50}, allowed is a whole number")
    return int(done), averaged > 0


def _check_model(content: dict[str, Any], run: TrainConfig, model: Path) -> None:
    """Raise ConfigError unless networks and optimiser in the `content` of checkpoint `model` fit `run`."""
    networks = [load_network(content, run, name, model) for name in ("actor", "critic")]
    load_network(checkpoint.as_policy(content), run, "actor", model)
    weights = list(chain.from_iterable(net.parameters() for net in networks))
    optimiser = resolve_optimizer(run.agent.algorithm.optimizer)(weights, lr=run.agent.algorithm.learning_rate)
    with _must_be_whole(f"{model}: training cannot continue from it"):
        saved = content["optimizer_state_dict"]
        optimiser.load_state_dict(saved)
        for index, state in saved["state"].items():
            shape = weights[index].shape
            for name, value in state.items():
                if isinstance(value, torch.Tensor) and value.shape not in ((), shape):
                    raise ValueError(f"{name} of weight {index} has the shape {tuple(value.shape)}, not {tuple(shape)}")
        if not _finite(saved):
            raise ValueError("it holds numbers that are not finite")
        if int(content["iter"]) != run_dir.iteration_of(model):
            raise ValueError(f"it was saved after {content['iter']} iterations")


@contextlib.contextmanager
def _must_be_whole(problem: str) -> Iterator[None]:
    """Turn the errors that damaged content causes into a ConfigError: `problem` and the reason."""
    try:
        yield
    except (KeyError, IndexError, AttributeError, RuntimeError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{problem} ({'no ' if isinstance(error, KeyError) else ''}{reason})") from None


def _finite(values: Any) -> bool:
    if isinstance(values, dict):
        return all(map(_finite, values.values()))
    if isinstance(values, (list, tuple)):
        return all(map(_finite, values))
    return bool(torch.as_tensor(values).isfinite().all()) if isinstance(values, (float, torch.Tensor)) else True
