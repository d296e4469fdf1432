"""The tables of the report, with the published numbers beside ours.

Over several seeds a cell shows their mean, with its 95 % bootstrap interval for two or more. Falls are not averaged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from posture.analysis.results import Result
from posture.config.published import Experiment3, Experiment4a, Experiment4b, Published, Table2, Table3, Table4
from posture.config.train import TrainConfig
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.ramp import WINDOWS
from posture.reproduce.claims.rules import mode_of
from posture.reproduce.claims.seed_means import group_by, mean_of, plural, seed_means, theory_means, where
from posture.reproduce.claims.targets import Target
from posture.reproduce.claims.verdict import Verdict, in_hz
from posture.reproduce.experiments import RECIPES
from posture.reproduce.page.page import Table
from posture.reproduce.quantities import (
    COP_SPREAD,
    COST_RATIO,
    ENERGY,
    ENERGY_WEIGHT,
    FREQ,
    HEAD_AMPLITUDE,
    HEAD_SPEED,
    HIP_ANKLE_R,
    HIP_K,
    HIP_RANGE,
    LOAD,
    RELATIVE_PHASE,
    TARGET_HEAD_R,
    Getter,
    Variable,
)
from posture.reproduce.reproduction import Body, Dynamics, ManyBodies, Recipe, last_anti_phase

Results = Sequence[Result]
ENGINES = {"sagittal": "planar", "mujoco": "SolverMuJoCo", "mujoco_c": "MuJoCo C"}
"""Names of the engines in the report; the first is the one that policies are trained in."""


FINDINGS = {
    "hysteresis_platform": "width of the hysteresis, steps as on a platform [Hz]",
    "hysteresis_head_tracking": "the same, steps as in head tracking [Hz]",
    "hysteresis_ramp": "the same, slow ramp [Hz]",
    "fluctuation": "SD of the relative phase, near the switch over elsewhere",
    "slow_mode": "relative phase below the switch [deg]",
    "fast_mode": "relative phase above the switch [deg]",
    "phase_relaxation": "relaxation time of the relative phase, near the switch over elsewhere",
    "angle_relaxation": "the same of the joint angles",
}
"""Names of the findings of `posture.dynamics` in the report."""


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Each claim of the paper with its verdict, the published result and ours."""
    rows = [[f"{v.experiment}: {v.claim}", v.verdict, v.published, v.finding] for v in verdicts]
    return Table(["the paper's claim", "verdict", "published", "found"], rows, "The paper's claims and our verdicts")


def recipe_verdict_table(by_recipe: Mapping[str, Sequence[Verdict]]) -> Table:
    """Verdicts on the same claims from each training, by name of its recipe."""
    rows = []
    for own in zip(*by_recipe.values(), strict=True):
        rows.append([f"{own[0].experiment}: {own[0].claim}", *(f"{v.verdict}: {v.finding}" for v in own)])
    headings = ["the paper's claim", *(RECIPES[name] for name in by_recipe)]
    return Table(headings, rows, "Verdicts by the same rules, from our training and the published one")


def target_table(targets: Sequence[Target]) -> Table:
    """The targets for a well-trained reproduction, and whether they are met."""
    met = {True: "met", False: "**missed**", None: "not measured"}
    rows = [[t.name, met[t.met], t.required, t.measured] for t in targets]
    return Table(["target", "", "required", "measured"], rows, "Targets of the training, and whether they are met")


def body_table(body: Body, torque_limit: float, paper: Published) -> Table:
    """Table 1: the body as simulated; `torque_limit` [Nm] of a joint."""
    published = paper.table_1
    rows = [
        ["mass [kg]", f"{body.mass:.2f}", f"{published.mass_kg:g}"],
        ["height [m]", f"{body.height:.2f}", f"{published.height_m:g}"],
        ["centre of mass at rest [m]", ", ".join(f"{x + 0.0:.3f}" for x in body.com), ", ".join(map(str, published.com_m))],
        ["hip range [deg]", "{:.0f} .. {:.0f}".format(*body.hip_range), "{:g} .. {:g}".format(*published.hip_range_deg)],
        [
            "ankle range [deg]",
            "{:.0f} .. {:.0f}".format(*body.ankle_range),
            "{:g} .. {:g}".format(*published.ankle_range_deg),
        ],
        ["torque limit of a joint [Nm]", f"{torque_limit:g}", f"{published.torque_limit_nm:g}"],
    ]
    return Table(["", "ours", "paper"], rows, "Table 1: the body", "lrr")


def learning_table(run: TrainConfig, published: Table2) -> Table:
    """Table 2: how the policies of Exp. 1 were trained."""
    agent, algorithm = run.agent, run.agent.algorithm
    samples = run.env.num_envs * agent.num_steps_per_env
    rows = [
        ["environments", f"{run.env.num_envs}", f"{published.environments}"],
        ["horizon [control steps]", f"{agent.num_steps_per_env}", f"{published.horizon}"],
        ["mini-batch [samples]", f"{samples // algorithm.num_mini_batches}", f"{published.mini_batch_size}"],
        ["epochs", f"{algorithm.num_learning_epochs}", f"{published.epochs}"],
        ["KL threshold", f"{algorithm.desired_kl:g}", f"{published.kl_threshold:g}"],
        ["hidden layers", str(list(agent.actor.hidden_dims)), str(list(published.hidden))],
        ["training steps", f"{samples * run.max_iterations:,} samples", f"{published.training_steps:,}"],
    ]
    return Table(["", "ours", "paper"], rows, "Table 2: PPO", "lrr")


def tracking_table(results: Results, published: Table3) -> Table:
    """Table 3: Exp. 1 at the paper's ten frequencies."""
    columns = (
        (TARGET_HEAD_R, 4, published.target_head_r),
        (HEAD_AMPLITUDE, 4, published.head_amplitude_m),
        (HEAD_SPEED, 3, published.head_speed_mps),
    )
    rows = []
    for i, freq in enumerate(published.freq_hz):
        own = where(results, FREQ, [freq])
        pairs = ((_mean(own, quantity.measured, digits), f"{theirs[i]:.{digits}f}") for quantity, digits, theirs in columns)
        rows.append([f"{freq:.2f}", *(cell for pair in pairs for cell in pair)])
    headings = ["f [Hz]", "target-head r", "paper", "amplitude [m]", "paper", "speed [m/s]", "paper"]
    return Table(headings, rows, f"Table 3: Exp. 1, {_seeds(results)}", "r" * len(headings))


def mode_table(results: Results, published: Table3) -> Table:
    """The modes of Table 3, and coordination at every frequency that was evaluated."""
    modes = dict(zip(published.freq_hz, published.mode, strict=True))
    return _coordination_table(results, FREQ, "f [Hz]", modes, "Coordination in Exp. 1")


def energy_table(results: Results, published: Table4) -> Table:
    """Table 4: Exp. 2."""
    rows = []
    for i, gamma in enumerate(published.gamma):
        own = where(results, ENERGY_WEIGHT, [gamma])
        rows.append(
            [
                f"{gamma:g}",
                _mean(own, TARGET_HEAD_R.measured, 4),
                f"{published.target_head_r[i]:.4f}",
                _mean(own, HEAD_AMPLITUDE.measured, 4),
                f"{published.head_amplitude_m[i]:.4f}",
                _mean(own, ENERGY.measured, 0),
                f"{published.energy_j[i]:.0f}",
                _mean(own, HIP_ANKLE_R.measured, 2),
                _modes(own),
                f"{published.mode[i]}-phase",
                _stood(own),
            ]
        )
    headings = ["gamma", "target-head r", "paper", "amplitude [m]", "paper", "energy [J]", "paper"]
    headings += ["hip-ankle r", "mode", "paper", "stood"]
    return Table(headings, rows, f"Table 4: Exp. 2, {_seeds(results)}", "r" * len(headings))


def stiffness_table(results: Results, published: Experiment3) -> Table:
    """Exp. 3, which the paper shows as a figure."""
    own = where(where(results, FREQ, [published.freq_hz]), HIP_K, published.hip_k_nm_per_rad)
    modes = dict(zip(published.hip_k_nm_per_rad, published.mode, strict=True))
    caption = f"Exp. 3: {published.freq_hz:g} Hz"
    return _coordination_table(own, HIP_K, "hip stiffness [Nm/rad]", modes, caption, hip_range=True)


def load_table(results: Results, published: Experiment4b, policies: str) -> Table:
    """Exp. 4b, which the paper shows as a figure, with `policies` of some training."""
    modes = dict(zip(published.load_kg, published.mode_at_ends, strict=True))
    return _coordination_table(results, LOAD, "load [kg]", modes, f"Exp. 4b: {published.freq_hz:g} Hz, {policies}")


def agreement_table(many_bodies: ManyBodies) -> Table:
    """How near the policies of many bodies are to the theory, over each map and over random bodies and targets."""
    columns = {
        "cost_ratio_mean": ".2f",
        "cost_ratio_p95": ".2f",
        "below_120": ".0%",
        "exact_ratio_mean": ".2f",
        "exact_ratio_p95": ".2f",
        "exact_below_120": ".0%",
        "same_mode": ".0%",
    }
    rows = [
        [row["varied"], *(row[name] for name in ("seed", "trials", "falls")), *_cells(row, columns)]
        for row in many_bodies.agreement
    ]
    headings = ["varied", "seed", "trials", "falls", "cost / least", "95th percentile", "at most 1.20"]
    headings += ["exact: cost / least", "95th percentile", "at most 1.20", "mode as the reward's optimum"]
    return Table(headings, rows, "One policy for many bodies: trials of one parameter and the frequency, and random ones")


def many_switches_table(many_bodies: ManyBodies) -> Table:
    """The frequency at which the modes switch, against hip stiffness, of policies of many bodies and of the theory."""
    own = [row for row in many_bodies.transitions if row["varied"] == "hip_k"]
    seeds = list(dict.fromkeys(row["seed"] for row in own))
    rows = []
    for value in dict.fromkeys(row["value"] for row in own):
        of = {row["seed"]: row for row in own if row["value"] == value}
        first = next(iter(of.values()))
        cells = [_cells(of[seed], {"policy_hz": ".3f"})[0] if seed in of else "-" for seed in seeds]
        rows.append([value, *cells, *_cells(first, {"least_hz": ".3f", "reward_hz": ".3f"})])
    headings = ["hip stiffness [Nm/rad]", *(f"seed {seed}" for seed in seeds), "least torque", "trained reward"]
    return Table(headings, rows, "One policy for many bodies: where its modes switch [Hz], and those of the theory")


def dynamics_table(dynamics: Dynamics) -> Table:
    """Hysteresis, fluctuations and recovery of policies with senses and muscles of people, beside reports of people."""
    rows = []
    for row in dynamics.findings:
        value, low, high = _cells(row, dict.fromkeys(("value", "low", "high"), ".3g"))
        name = FINDINGS.get(row["name"], row["name"].replace("_", " "))
        rows.append([name, value, f"{low} to {high}", row["found"], row["people"] or "-"])
    headings = ["", "value", "95 % interval", "meaning", "people (from abstracts)"]
    seeds = plural(max((int(row["seeds"]) for row in dynamics.findings), default=0), "seed")
    return Table(headings, rows, f"Policies with senses and muscles of people, {seeds}", "lrrll")


def _cells(row: Mapping[str, str], columns: Mapping[str, str]) -> list[str]:
    """Numbers of a row of CSV, each in its format; a dash where there is none."""
    values = {name: float(row[name]) for name in columns}
    return ["-" if math.isnan(value) else format(value, columns[name]) for name, value in values.items()]


def ramp_table(results: Results, published: Experiment4a) -> Table:
    """Exp. 4a, a row for each seed."""
    rows = []
    for result in results:
        values = [value for read in WINDOWS.values() for value in zip(read(result.ramp), (2, 0), strict=True)]
        cells = ["-" if math.isnan(value) else f"{value:.{digits}f}" for value, digits in values]
        rows.append([f"seed {result.origin.seed}", *(cells if result.valid else ["fell"] * len(cells))])
    caption = (
        f"Exp. 4a: transition in the ramp [Hz]; paper: {published.transition_hz:g} Hz, the kind of window is not stated"
    )
    return Table(["", "centred windows", "sign changes", "trailing windows", "sign changes"], rows, caption, "lrrrr")


def engine_table(results: Results) -> Table:
    """Exp. 1 in each engine: mode and correlation, cost, falls, and where the modes switch."""
    by_engine = {name: [result for result in results if result.origin.physics == name] for name in ENGINES}
    by_engine = {name: own for name, own in by_engine.items() if own}
    rows = []
    for (freq,) in group_by(results, (FREQ,)):
        at_freq = [where(own, FREQ, [freq]) for own in by_engine.values()]
        correlations = [f"{_mean(own, HIP_ANKLE_R.measured, 2)} {_modes(own)}{_falls(own)}" for own in at_freq]
        rows.append([f"{freq:.2f}", *correlations, *(_mean(own, COST_RATIO.measured, 2) for own in at_freq)])
    rows.append(["switch [Hz]", *map(switch_text, by_engine.values()), *["-"] * len(by_engine)])
    titles = [ENGINES[name] for name in by_engine]
    headings = ["f [Hz]", *(f"r, {title}" for title in titles), *(f"cost / least, {title}" for title in titles)]
    caption = f"The same policies in each physics engine, {_seeds(results)}; the switch is interpolated"
    return Table(headings, rows, caption, "r" * len(headings))


def recipe_table(recipes: Sequence[Recipe], energy: Results, stiffness: Results, paper: Published) -> Table:
    """Our training and the published one, in what the paper reports: the policies, and the optimum of each reward.

    `energy`, `stiffness`: of Exp. 2 and 3, for which policies were trained in our way alone.
    """
    third, fourth = paper.experiment_3, paper.table_4
    hip_k, gamma = last_anti_phase(paper)
    slow, fast, loads = min(paper.table_3.freq_hz), max(paper.table_3.freq_hz), paper.experiment_4b.load_kg
    published = dict(zip(paper.table_3.freq_hz, paper.table_3.target_head_r, strict=True))
    modes = dict(zip(paper.table_3.freq_hz, paper.table_3.mode, strict=True))
    last_in, first_anti = max(f for f in modes if modes[f] == "in"), min(f for f in modes if modes[f] == "anti")

    def at_ends(results: Results, by: Variable, ends: Sequence[float], value: Getter, digits: int) -> str:
        return ", ".join(_mean(where(results, by, [end]), value, digits) for end in ends)

    def cells(recipe: Recipe) -> list[tuple[str, str]]:
        """In the order of the rows: the trained policies, the optimum of their reward."""
        own, load = where(recipe.frequency, FREQ, paper.table_3.freq_hz), recipe.load
        ours = recipe.name == next(iter(RECIPES))
        soft = where(where(stiffness, HIP_K, [hip_k]), FREQ, [third.freq_hz]) if ours else []
        cheap = where(energy, ENERGY_WEIGHT, [gamma]) if ours else []
        optima = [where(load, LOAD, [kg])[:1] for kg in loads]
        return [
            (_stood(own), "-"),
            (switch_text(recipe.frequency), in_hz(recipe.reward_hz)),
            (_mean(recipe.ramp, lambda result: result.ramp.transition_centred_hz, 2), "-"),
            (at_ends(own, FREQ, (slow, fast), TARGET_HEAD_R.measured, 4), "-"),
            (at_ends(own, FREQ, (slow, fast), lambda result: 1e3 * COP_SPREAD.measured(result), 0), "-"),
            (
                at_ends(load, LOAD, loads, HIP_ANKLE_R.measured, 2),
                ", ".join(_r(result.reward.hip_ankle_r) for found in optima for result in found) or "-",
            ),
            (_mean(soft, HIP_ANKLE_R.measured, 2), _r(recipe.soft_hip_r)),
            (_mean(cheap, HIP_ANKLE_R.measured, 2), _r(recipe.low_weight_r)),
            (_mean_cost(own), "-"),
        ]

    switch = paper.experiment_4a.transition_hz
    labels = [
        ("trials of Exp. 1 that stood", "-"),
        ("switch of modes [Hz]", f"{last_in:.2f} to {first_anti:.2f}"),
        ("the same in a ramp, centred windows [Hz]", f"{switch:g}"),
        (f"target-head r at {slow:g} and {fast:g} Hz", f"{published[slow]:.4f}, {published[fast]:.4f}"),
        (f"spread of the centre of pressure at {slow:g} and {fast:g} Hz [mm]", "grows"),
        (f"hip-ankle r with {loads[0]:g} and {loads[-1]:g} kg", "positive, negative"),
        (f"hip-ankle r with hips of {hip_k:g} Nm/rad at {third.freq_hz:g} Hz", "negative"),
        (f"hip-ankle r at gamma {gamma:g} and {fourth.freq_hz:g} Hz", "negative"),
        ("cost / least, mean over frequencies", "-"),
    ]
    columns = [cells(recipe) for recipe in recipes]
    rows = [[name, theirs, *(cell for column in columns for cell in column[i])] for i, (name, theirs) in enumerate(labels)]
    names = [RECIPES[recipe.name] for recipe in recipes]
    headings = ["", "paper", *(text for name in names for text in (name, f"{name}: optimum of its reward"))]
    seeds = ", ".join(f"{RECIPES[recipe.name]}: {_seeds(recipe.frequency)}" for recipe in recipes)
    return Table(headings, rows, f"Our training and the published one ({seeds})", "l" + "r" * (len(headings) - 1))


def _mean_cost(results: Results) -> str:
    """Mean over seeds of a policy's mean over the frequencies at which it stood, and its interval."""
    by_seed = {seed: [one for one in results if one.origin.seed == seed] for seed in {one.origin.seed for one in results}}
    own = [mean_of([one.cost_ratio for one in some if one.valid]) for some in by_seed.values()]
    return mean_of([mean.mean for mean in own]).text(".2f")


def _r(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"


def _coordination_table(
    results: Results,
    by: Variable,
    heading: str,
    published: Mapping[float, str],
    caption: str,
    hip_range: bool = False,
) -> Table:
    """Coordination in each condition, beside the modes `published` ("in" or "anti") in some of them."""
    rows = []
    for (value,), own in group_by(results, (by,)).items():
        theory = [theory_means(own, (), getter) for getter in (HIP_ANKLE_R.least, HIP_ANKLE_R.reward)]
        rows.append(
            [
                f"{value:g}",
                _mean(own, HIP_ANKLE_R.measured, 2),
                _mean(own, RELATIVE_PHASE.measured, 0),
                _modes(own),
                *(means[()].text(".2f") if means else "-" for means in theory),
                _mean(own, COST_RATIO.measured, 2),
                _stood(own),
                f"{published[value]}-phase" if value in published else "-",
                *([_mean(own, HIP_RANGE.measured, 1)] if hip_range else []),
            ]
        )
    headings = [heading, "hip-ankle r", "phase [deg]", "mode", "least-torque r", "trained reward's r", "cost / least"]
    headings += ["stood", "paper", *(["hip range [deg]"] if hip_range else [])]
    return Table(headings, rows, f"{caption}, {_seeds(results)}", "r" * len(headings))


def _mean(results: Results, value: Getter, digits: int) -> str:
    """Mean over seeds and its interval, without those that fell; a dash if none has a value."""
    return seed_means(results, (), value)[()].text(f".{digits}f") if results else "-"


def _modes(results: Results) -> str:
    """The mode of the mean correlation, and how many of the seeds that stood differ from it."""
    if not results:
        return "-"
    whole = mode_of(seed_means(results, (), HIP_ANKLE_R.measured)[()])
    stood = [result for result in results if result.valid]
    others = 0 if whole == "no mode" else sum(result.mode != whole for result in stood)
    return f"{whole} ({others} of {len(stood)} not)" if others else whole


def _stood(results: Results) -> str:
    """How many of the seeds stood: "4/5"."""
    return f"{sum(result.valid for result in results)}/{len(results)}" if results else "-"


def _falls(results: Results) -> str:
    return "" if all(result.valid for result in results) else f" ({_stood(results)} stood)"


def switch_text(results: Results) -> str:
    """Mean over seeds of the frequency [Hz] at which the correlation changes from in-phase to anti-phase, if once.

    Without one: the mode of all trials that stood, if they have the same.
    """
    mean = mean_of(list(switches(results).values()))
    modes = {result.mode for result in results if result.valid}
    if not mean.n and len(modes) == 1:
        return f"none, {modes.pop()} in all trials that stood"
    return mean.text(".3f") + (f" (none in {mean.trials - mean.n} of {mean.trials})" if mean.n < mean.trials else "")


def _seeds(results: Results) -> str:
    return plural(len({result.origin.seed for result in results}), "seed")
