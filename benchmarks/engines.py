"""Control steps per second and memory per world of the task on each physics engine.

    python benchmarks/engines.py [--worlds 1 16 256 1024 4096 16384] [--engines sagittal mujoco mujoco_c gymnasium ...]
                                 [--csv benchmarks/engines.csv] [--device cpu] [--repeats 3] [--seconds 2]

Engines:
    sagittal, mujoco: `HeadTrackingEnv` with that `env.physics`; the whole environment under random actions, worlds reset
        as needed, and the physics alone (`env.sim.step`). On a CPU mujoco's kernels run on one thread. sagittal is measured
        with one thread and with one per core; it uses fewer when there are few worlds.
    mujoco_c: `mujoco.rollout`, MuJoCo's C engine; physics alone, with one thread and with one per core. Its worlds are rows
        of an array, so memory per world is not reported.
    gymnasium: `gymnasium.make_vec` of this package: sagittal with NumPy arrays in and out, one thread.
    gymnasium_async: the same with `vectorization_mode="async"`: single environments in Gymnasium's AsyncVectorEnv, one
        process per world; up to 16 worlds.

Prints and writes one row per measurement: control steps/s over all worlds (two physics steps each as configured), and bytes
per world: the growth of memory over the smallest number of worlds, divided by the number of added worlds. Physics alone
restarts from standing every half second and is driven by small random torques. Each measurement runs in its own process and
is repeated; the median is reported. All rows are from one run. Compare ratios, since the speed of a machine drifts.
"""

import argparse
import math
import os
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import torch
from mujoco.rollout import Rollout
from shared import compose, hardware, in_new_process, memory, missing, timed, write

from envs.config import ConstraintOverflowError, EnvConfig
from envs.engines.mujoco_c import build
from envs.task.head_tracking import HeadTrackingEnv

ENGINES = ("sagittal", "mujoco", "mujoco_c", "gymnasium", "gymnasium_async")
REFERENCE = "mujoco"
TRIAL = 32
"""Control steps from standing: half a second, in which the feet stay on the ground."""
NOISE = 0.2
"""Standard deviation of the random actions, that of an untrained policy; that of the torques is a tenth of it."""
MOST = {"gymnasium_async": 16}
"""Largest number of worlds that an engine is run with: each of these processes holds torch and Warp, 0.4 GB."""
BLOCK = 1024
"""Worlds in one call of mujoco.rollout: enough to keep its threads busy, few enough for a short call."""
NOTICEABLE = 4 * 2**20
"""Growth of memory that exceeds the variation between processes [bytes]."""
RATES = ("env_steps_per_s", "physics_steps_per_s")
COLUMNS = ("engine", "worlds", "threads", *RATES, "bytes_per_world", "contacts_dropped", "device", "cores")
Row = dict[str, Any]


def main() -> None:
    """Measure, print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 16, 256, 1024, 4096, 16384])
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_name("engines.csv"))
    parser.add_argument("--device", default="cpu", help="of sagittal and mujoco")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=2.0, help="minimum time of each measurement")
    arguments = parser.parse_args()
    engines = list(arguments.engines)
    ours = [engine for engine in engines if not engine.startswith("gymnasium")]
    if engines != ours and (lacking := missing("gymnasium")):
        print(f"gymnasium: {lacking}")
        engines = ours
    cases = [(e, w, t) for w in sorted(set(arguments.worlds)) for e in engines for t in threads(e, w)]
    taken: dict[tuple[str, int, int], list[Row]] = {case: [] for case in cases}
    for case in cases * arguments.repeats:
        taken[case].append(in_new_process(measure, *case, arguments.device, arguments.seconds))
        print(taken[case][-1], flush=True)
    rows = summary([{**repeats[0], **median(repeats)} for repeats in taken.values()])
    print(table(rows))
    write(rows, arguments.csv)


def threads(engine: str, worlds: int) -> list[int]:
    """Numbers of threads or processes that an engine is measured with, for this number of worlds."""
    cores = os.cpu_count() or 1
    if worlds > MOST.get(engine, worlds):
        return []
    several = {"gymnasium": [1], "gymnasium_async": [worlds], "mujoco": [1]}
    return several.get(engine, sorted({1, cores}))


def measure(engine: str, worlds: int, threads: int, device: str, seconds: float) -> Row:
    """One row, with the memory in use at the end as `bytes`; without numbers if physics dropped contacts."""
    overrides = [f"env.num_envs={worlds}", "agent.algorithm.num_mini_batches=1", "processes=1"]
    if engine in ("sagittal", "mujoco"):
        overrides.append(f"env.physics={engine}")
    else:
        device = "cpu"
    torch.set_num_threads(threads if engine == "sagittal" else 1)
    torch.manual_seed(0)
    row: Row = {"engine": engine, "worlds": worlds, "threads": threads, "contacts_dropped": False}
    row |= dict.fromkeys((*RATES, "bytes"))
    try:
        row |= _MEASURES[engine](compose(*overrides).env, worlds, threads, device, seconds)
    except ConstraintOverflowError as error:
        print(f"NOT VALID: {engine}, {worlds} worlds: {error}")
        row["contacts_dropped"] = True
    return row | hardware(device)


def rate(step: Callable[[int], Any], begin: Callable[[], Any], device: str, seconds: float) -> float:
    """Calls of `step(i)` per second, over at least `seconds` and three calls.

    Trials are i = 0, 1, ... below `TRIAL`, each after a call of `begin()` that is not timed.
    """
    begin()
    step(0)
    estimate = timed(device, lambda: step(1))
    calls = min(TRIAL, max(3, math.ceil(seconds / estimate)))
    spent, count = 0.0, 0
    while spent < seconds:
        begin()
        spent += timed(device, lambda: [step(i) for i in range(calls)])
        count += calls
    return count / spent


def _ours(config: EnvConfig, worlds: int, _: int, device: str, seconds: float) -> Row:
    env = HeadTrackingEnv(config, 0, device)
    env.warm_up()
    actions = NOISE * torch.randn(TRIAL, worlds, env.num_actions, device=device)
    whole = rate(lambda i: env.step(actions[i]), lambda: None, device, seconds)
    env.sim.check_capacity()
    torques = _torques(config, TRIAL, worlds, 4).to(device)
    everyone = torch.ones(worlds, dtype=torch.bool, device=device)
    physics = rate(lambda i: env.sim.step(torques[i]), lambda: env.sim.reset(everyone), device, seconds)
    env.sim.check_capacity()
    return {"env_steps_per_s": whole * worlds, "physics_steps_per_s": physics * worlds, "bytes": memory(device)}


def _mujoco_c(config: EnvConfig, worlds: int, threads: int, device: str, seconds: float) -> Row:
    model, data = build(config)
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    standing = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, standing, full)
    block, steps = min(worlds, BLOCK), TRIAL * config.solver.substeps
    # Each torque is held for a control step. The six degrees of freedom of the root, which come first, have none.
    torques = np.zeros((block, steps, model.nv))
    torques[..., -4:] = np.repeat(_torques(config, block, TRIAL, 4).numpy(), config.solver.substeps, axis=1)
    state = np.empty((block, steps, len(standing)))
    datas = [mujoco.MjData(model) for _ in range(threads)]
    keys = {"control_spec": mujoco.mjtState.mjSTATE_QFRC_APPLIED, "nstep": steps, "state": state}
    with Rollout(nthread=threads if threads > 1 else 0) as pool:
        trials = rate(lambda _: pool.rollout(model, datas, standing, torques, **keys), lambda: None, device, seconds)
    return {"physics_steps_per_s": trials * TRIAL * block}


def _gymnasium(_: EnvConfig, worlds: int, threads: int, device: str, seconds: float) -> Row:
    return _stepped(worlds, device, seconds, autoreset_mode="SameStep")


def _gymnasium_async(_: EnvConfig, worlds: int, threads: int, device: str, seconds: float) -> Row:
    mode = {"autoreset_mode": "SameStep"}
    return _stepped(worlds, device, seconds, vectorization_mode="async", vector_kwargs=mode)


def _stepped(worlds: int, device: str, seconds: float, **keys: Any) -> Row:
    import gymnasium  # imported here because it is optional

    from posture.gymnasium import ID

    env = gymnasium.make_vec(ID, worlds, **keys)
    env.reset(seed=0)
    actions = (NOISE * torch.randn(TRIAL, worlds, 2)).clamp(-1.0, 1.0).numpy()
    whole = rate(lambda i: env.step(actions[i]), lambda: None, device, seconds)
    row = {"env_steps_per_s": whole * worlds, "bytes": memory(device)}
    env.close()
    return row


def _torques(config: EnvConfig, *shape: int) -> torch.Tensor:
    return 0.1 * NOISE * config.torque_limit * torch.randn(*shape)


_MEASURES = {
    "sagittal": _ours,
    "mujoco": _ours,
    "mujoco_c": _mujoco_c,
    "gymnasium": _gymnasium,
    "gymnasium_async": _gymnasium_async,
}


def median(repeats: list[Row]) -> Row:
    """The median of each number over the rows of one measurement, None where one is missing."""
    lists = {key: [row[key] for row in repeats] for key in (*RATES, "bytes")}
    numbers = {key: None if None in values else round(statistics.median(values)) for key, values in lists.items()}
    return numbers | {"contacts_dropped": any(row["contacts_dropped"] for row in repeats)}


def summary(rows: list[Row]) -> list[Row]:
    """The rows as written, with bytes per world from the growth over the engine's row with the fewest worlds."""
    least: dict[str, Row] = {}
    for row in rows:
        base = least.setdefault(row["engine"], row)
        grown = (row["bytes"] or 0) - (base["bytes"] or 0)
        row["bytes_per_world"] = round(grown / (row["worlds"] - base["worlds"])) if grown > NOTICEABLE else None
    return [{column: row[column] for column in COLUMNS} for row in rows]


def table(rows: list[Row]) -> str:
    """The rows as text, with rates also as multiples of the reference at the same number of worlds."""
    reference = {row["worlds"]: row for row in rows if row["engine"] == REFERENCE}
    lines = [f"{'engine':16}{'worlds':>7}{'threads':>8}{'env steps/s':>22}{'physics steps/s':>22}{'bytes/world':>13}"]
    for row in rows:
        cells = ""
        for name in RATES:
            other = reference.get(row["worlds"], {}).get(name)
            times = f"({row[name] / other:.2f}x)" if row[name] and other else ""
            cells += f"{'-' if row[name] is None else format(row[name], ','):>12} {times:>9}"
        memory = "-" if row["bytes_per_world"] is None else format(row["bytes_per_world"], ",")
        flag = "  NOT VALID: physics dropped contacts" if row["contacts_dropped"] else ""
        lines.append(f"{row['engine']:16}{row['worlds']:>7}{row['threads']:>8}{cells}{memory:>13}{flag}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
