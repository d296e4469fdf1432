"""Train one policy to follow the target with the head, then evaluate it.

python -m posture.train env.freq=1.2
python -m posture.train -m env.hip_k=25,50,...,200
python -m posture.train resume=latest max_iterations=500
python -m posture.train init=runs/<run> env.load=4       # begin with the weights of another policy
"""

import contextlib
import importlib.metadata
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from posture.cli import entry
from posture.cli.jobs import differences, refuse_other_training
from posture.config.checks import check_device
from posture.config.errors import ConfigError
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.storage import atomic, provenance, run_dir
from posture.storage.lock import locked

if TYPE_CHECKING:
    from posture.evaluation.background import Background

# Modules that import torch or the physics are imported inside functions: bad input must not wait for them.

RESUME_KEYS = {"resume", "max_iterations", "device", "threads", "evaluate", "evaluate_every", "film_every", "patience"}
"""Keys that may differ between a run and its continuation."""


def train(config: TrainConfig, folder: Path) -> float | None:
    """Run one training job in `folder`, locked against other processes. If that training was stopped there, it goes on from
    its newest checkpoint; raises ConfigError if `folder` holds another training.

    Returns what a search for hyper-parameters minimises, see `posture.evaluation.best.objective`; None without evaluation.
    """
    if config.resume is not None:
        _check_resumed_keys()
    with locked(folder):
        if config.resume is None:
            refuse_other_training(config, folder)  # again: another process may have trained there after the first check
        from posture.learning import parallel

        if parallel.rank() == 0:
            atomic.clear(folder)
        return _train(config, folder)


def _train(config: TrainConfig, folder: Path) -> float | None:
    from posture.learning import parallel
    from posture.learning.resume import iterations_done

    if config.resume is not None:
        config = _resumed(config, folder)
    can_continue = config.resume is not None or (folder / "resume.pt").exists()
    # Without resume.pt a training is either complete, or refused before.
    done = iterations_done(folder) if can_continue else run_dir.iterations_of_newest(folder)
    if done == 0 and config.init is not None:
        _check_weights(config)
    # Schedules of weights keep the length that the training began with.
    steps = (run_dir.read_config(folder) if can_continue else config).training_steps
    with _background(config, folder) as background:
        ended = background is not None and background.catch_up(done)
        if ended and config.resume is not None:
            raise ConfigError(
                f"patience = {config.patience} ended this training after {done} iterations; allowed is more, or null"
            )
        if done < config.max_iterations and not ended:
            with parallel.worker_processes(config.processes, config.device, _learn, config, folder, done > 0, steps):
                _learn(config, folder, done > 0, steps, background)
        else:
            print(f"{folder}: already trained")
        if background is not None:
            background.finish()
    return _evaluate(config, folder) if parallel.rank() == 0 else None


def _background(config: TrainConfig, folder: Path) -> "contextlib.AbstractContextManager[Background | None]":
    """The evaluations and films beside the training, if any; of the processes under torchrun, in the first."""
    from posture.learning import parallel

    if parallel.rank() != 0 or (config.evaluate_every is None and config.film_every is None):
        return contextlib.nullcontext()
    from posture.evaluation.background import Background

    return Background(folder, config)


def _evaluate(config: TrainConfig, folder: Path) -> float | None:
    """Evaluate the policy of the training in `folder`, and keep the best, as `config` says."""
    if config.evaluate:
        from posture.evaluation.trial import evaluate_run

        evaluate_run(folder, config)
    if config.evaluate_every is not None:
        from posture.evaluation.best import keep_best, scores

        if keep_best(folder, config) is not None:
            print(f"best: {folder / 'best.pt'}")
        else:
            reason = "every policy falls at every frequency" if scores(folder, config) else "no checkpoint was evaluated"
            print(f"best: none, since {reason}")
    print(f"run: {folder}")
    if not config.evaluate:
        return None
    from posture.analysis.results import read_csv
    from posture.evaluation.best import objective

    # From the file, whose numbers are rounded: a search that is started again must meet the same values.
    return objective(read_csv(folder / "evaluation" / "metrics.csv"))


def _learn(
    config: TrainConfig, folder: Path, resume: bool, training_steps: int, background: "Background | None" = None
) -> None:
    """Train this process's share of the worlds; `resume`: continue from the newest checkpoint in `folder`.

    training_steps: control steps of each world in the training as it was begun. background: what follows each checkpoint.
    """
    import torch

    from envs.task.head_tracking import HeadTrackingEnv
    from posture.learning import parallel
    from posture.learning.learner import Learner
    from posture.learning.progress import preparing
    from posture.theory.least_costs import least_costs

    rank, size = parallel.rank(), parallel.size()
    if config.env.num_envs % size:
        raise ConfigError(f"env.num_envs = {config.env.num_envs} cannot be shared equally among {size} processes")
    device = parallel.local_device(config.device)
    if size > 1 and config.device.startswith("cuda:"):
        raise ConfigError(f"device: under torchrun each process has a GPU of its own; give cuda, not {config.device}")
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed + 1_000_003 * rank)
    begun_from = None if resume or config.init is None else run_dir.find_init(config.init)
    if rank == 0:
        run_dir.writable(folder)
        if not resume:
            provenance.write_config(folder, config, begun_from)
    with preparing():
        env = HeadTrackingEnv(config.env, config.seed, device, (rank, size), training_steps, least_costs)
        learner = Learner(env, config.agent, folder, device)
        env.warm_up()
        if begun_from is not None:
            learner.start_from(begun_from)
        if resume:
            learner.resume()
            if rank == 0:
                provenance.write_config(folder, config, resumed=True)  # after `resume` has accepted the checkpoint
    if rank == 0 and env.infeasible_share:
        print(f"not drawn: {env.infeasible_share:.2%} of env.ranges, which the limits of torque and foot do not allow")
    if rank == 0:
        _report_unfinished_schedules(config, env.training_steps or training_steps)
    learner.train(config.max_iterations, None if background is None else background.after_checkpoint)


def check(configs: Sequence[TrainConfig], in_sweep: bool) -> None:
    """Raise ConfigError if one of the jobs lacks what it needs: the package wandb, or a policy to begin with that has its
    observations and networks."""
    if any(config.agent.logger == "wandb" for config in configs):
        try:
            importlib.metadata.version("wandb")
        except importlib.metadata.PackageNotFoundError:
            raise ConfigError(
                "agent.logger=wandb needs the package wandb: python -m pip install -c constraints.txt -e '.[wandb]'"
            ) from None
    for config in configs:
        if config.init == "latest" and in_sweep:
            raise ConfigError("init=latest changes during a sweep: name the run")
        if config.init is not None:
            source = run_dir.read_config(run_dir.find_init(config.init).parent)
            for name in ("actor", "critic"):
                if different := _differences(source, config, name):
                    raise ConfigError(f"init: the {name} of {config.init} has {different}; allowed are equal ones")


def _differences(source: TrainConfig, own: TrainConfig, name: str) -> str:
    """In what the weights of the network `name` of `source` do not fit `own`: its observations or its layers."""
    seen, wanted = (
        [term for group in getattr(one.agent.obs_groups, name) for term in one.env.observations[group]]
        for one in (source, own)
    )
    if seen != wanted:
        if {*seen} == {*wanted}:
            return "its observations in another order"
        return f"other observations than this training ({', '.join(sorted({*seen} ^ {*wanted}))})"
    layers = [
        getattr(one.agent, name).model_dump(mode="json", exclude={"distribution_cfg": {"init_std", "std_range"}})
        for one in (source, own)
    ]
    return f"other layers than this training ({'; '.join(differences(*layers))})" if layers[0] != layers[1] else ""


def _check_weights(config: TrainConfig) -> None:
    """Raise ConfigError unless the networks of the policy that `config.init` names fit, before physics is built."""
    from posture.learning.networks import load_network
    from posture.storage import checkpoint

    assert config.init is not None
    model = run_dir.find_init(config.init)
    content = checkpoint.as_policy(checkpoint.load(model, "cpu"))
    load_network(content, config, "actor", model)
    load_network(content, config, "critic", model)


def _report_unfinished_schedules(config: TrainConfig, training_steps: int) -> None:
    """Print a line where the training ends before a schedule of a weight does."""
    ends = {f"env.{name}": schedule.until * training_steps for name, schedule in config.env.schedules.items()}
    unfinished = {name: end / config.agent.num_steps_per_env for name, end in ends.items() if end > config.training_steps}
    if unfinished:
        print(
            f"{', '.join(unfinished)}: the schedule ends after {max(unfinished.values()):g} iterations, "
            f"the training after {config.max_iterations}"
        )


def _resumed(config: TrainConfig, folder: Path) -> TrainConfig:
    """The configuration of the run in `folder`, with the keys that the command line changes."""
    from posture.learning import parallel
    from posture.learning.resume import iterations_done

    own = run_dir.read_config(folder)
    merged = own.model_copy(update={key: getattr(config, key) for key in entry.overridden_keys()})
    check_device(merged.device)
    unused = read(TrainConfig, merged.model_dump() | {"resume": None}).without_effect()
    for key in sorted(entry.overridden_keys() & unused.keys()):
        raise ConfigError(f"{key}: has no effect {unused[key]}")
    done = iterations_done(folder)
    if merged.max_iterations <= done:
        raise ConfigError(
            f"max_iterations = {merged.max_iterations}: {folder} has already done {done}; it is a total, so give a larger "
            "one"
        )
    if parallel.rank() == 0 and (different := provenance.other_code(folder)):
        print(f"{folder}: was begun with other code or libraries: {'; '.join(different)}")
    return merged


def _check_resumed_keys() -> None:
    """Raise ConfigError if the command line changes keys that a resumed run cannot change."""
    if changed := entry.overridden_keys() - RESUME_KEYS:
        raise ConfigError(
            f"resume: {', '.join(sorted(changed))} cannot be changed in a run that is resumed; "
            f"allowed beside resume are {', '.join(sorted(RESUME_KEYS - {'resume'}))}"
        )


def main() -> None:
    """The command `python -m posture.train`."""
    entry.run("train", TrainConfig, train, check)


if __name__ == "__main__":
    main()
