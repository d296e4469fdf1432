"""Train one policy to follow the target with the head, then evaluate it.

python -m posture.train env.freq=1.2
python -m posture.train -m env.hip_k=25,50,...,200
python -m posture.train resume=latest max_iterations=500
"""

from pathlib import Path

from posture.cli import entry
from posture.cli.jobs import refuse_other_training
from posture.config.checks import check_device, check_engine
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import atomic, provenance, run_dir
from posture.storage.lock import locked

# Modules that import torch or the physics are imported inside functions: bad input must not wait for them.

RESUME_KEYS = {"resume", "max_iterations", "device", "threads", "evaluate"}
"""Keys that may differ between a run and its continuation."""


def train(config: TrainConfig, folder: Path) -> None:
    """Run one training job in `folder`, locked against other processes. If that training was stopped there, it goes on from
    its newest checkpoint; raises ConfigError if `folder` holds another training."""
    if config.resume is not None:
        _check_resumed_keys()
    with locked(folder):
        if config.resume is None:
            refuse_other_training(config, folder)  # again: another process may have trained there after the first check
        from posture.learning import parallel

        if parallel.rank() == 0:
            atomic.clear(folder)
        _train(config, folder)


def _train(config: TrainConfig, folder: Path) -> None:
    from posture.learning import parallel
    from posture.learning.resume import iterations_done

    if config.resume is not None:
        config = _resumed(config, folder)
    can_continue = config.resume is not None or (folder / "resume.pt").exists()
    # Without resume.pt a training is either complete, or refused before.
    done = iterations_done(folder) if can_continue else run_dir.iterations_of_newest(folder)
    # Schedules of weights keep the length that the training began with.
    steps = (run_dir.read_config(folder) if can_continue else config).training_steps
    if done < config.max_iterations:
        with parallel.worker_processes(config.processes, config.device, _learn, config, folder, done > 0, steps):
            _learn(config, folder, done > 0, steps)
    else:
        print(f"{folder}: already trained")
    if parallel.rank() != 0:
        return
    if config.evaluate:
        from posture.evaluation.trial import evaluate_run

        evaluate_run(folder, config)
    print(f"run: {folder}")


def _learn(config: TrainConfig, folder: Path, resume: bool, training_steps: int) -> None:
    """Train this process's share of the worlds; `resume`: continue from the newest checkpoint in `folder`.

    training_steps: control steps of each world in the training as it was begun.
    """
    import torch

    from envs.task.head_tracking import HeadTrackingEnv
    from posture.learning import parallel
    from posture.learning.learner import Learner
    from posture.learning.progress import preparing

    rank, size = parallel.rank(), parallel.size()
    if config.env.num_envs % size:
        raise ConfigError(f"env.num_envs = {config.env.num_envs} cannot be shared equally among {size} processes")
    device = parallel.local_device(config.device)
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed + 1_000_003 * rank)
    if rank == 0:
        run_dir.writable(folder)
        if not resume:
            provenance.write_config(folder, config)
    with preparing():
        env = HeadTrackingEnv(config.env, config.seed, device, (rank, size), training_steps)
        learner = Learner(env, config.agent, folder, device)
        env.warm_up()
        if resume:
            learner.resume()
            if rank == 0:
                provenance.write_config(folder, config)  # after `resume` has accepted the checkpoint
    if rank == 0:
        _report_unfinished_schedules(config, env.training_steps or training_steps)
    learner.train(config.max_iterations)


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
    try:
        check_engine(merged.env.physics, merged.device)
    except ValueError as error:
        raise ConfigError(str(error)) from None
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
    entry.run("train", TrainConfig, train)


if __name__ == "__main__":
    main()
