"""The tables of the report: ours beside the published. Rows of results in, `page.Table` out.

A number over seeds is their mean, with its 95 % bootstrap interval where there are two or more; falls are left out of it
and counted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from envs.config import EnvConfig
from envs.engines.mujoco_c import build
from posture.analysis.results import Row
from posture.config.train import TrainConfig
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.rules import shown_mode
from posture.reproduce.claims.seed_means import mean_of, seed_means, theory_means, where
from posture.reproduce.claims.targets import Target
from posture.reproduce.claims.verdict import Verdict
from posture.reproduce.page.page import Table
from posture.reproduce.page.page import Verdict as Word

ENGINES = {"sagittal": "planar", "mujoco": "SolverMuJoCo", "mujoco_c": "MuJoCo C"}
"""Engines by what the report calls them: the first is that in which policies learned."""
FREQ_DIGITS = 6


def verdict_table(found: Sequence[Verdict]) -> Table:
    """Each claim of the paper with its verdict, what is published and what was found."""
    rows = [[f"{v.experiment}: {v.claim}", Word(word(v.verdict)), v.published, v.finding] for v in found]
    return Table(
        ["the paper's claim", "verdict", "published", "found"], rows, "Claims of the paper, and what became of them"
    )


def target_table(found: Sequence[Target]) -> Table:
    """What a well-trained reproduction was asked for beforehand, and whether it was met."""
    word = {True: "met", False: "**missed**", None: "not measured"}
    rows = [[t.name, word[t.met], t.required, t.measured] for t in found]
    return Table(["target", "", "required", "measured"], rows, "Targets, and what came out")


def body_table(env: EnvConfig, paper: Mapping[str, Any]) -> Table:
    """Table 1: the body as simulated, read from the model."""
    model, data = build(env)
    mujoco.mj_forward(model, data)
    published = paper["table_1"]
    com = data.subtree_com[model.body("hat").id]
    head = data.geom("head").xpos[2] + model.geom("head").size[0]
    ranges = {name: np.degrees(model.joint(f"{name}_left").range) for name in ("hip", "ankle")}
    rows = [
        ["mass [kg]", f"{model.body_mass.sum():.2f}", f"{published['mass_kg']:g}"],
        ["height [m]", f"{head:.2f}", f"{published['height_m']:g}"],
        ["centre of mass at rest [m]", ", ".join(f"{x + 0.0:.3f}" for x in com), ", ".join(map(str, published["com_m"]))],
        *(
            [f"{name} range [deg]", f"{low:.0f} .. {high:.0f}", "{} .. {}".format(*published[f"{name}_range_deg"])]
            for name, (low, high) in ranges.items()
        ),
        ["torque limit a joint [Nm]", f"{env.torque_limit:g}", f"{published['torque_limit_nm']:g}"],
    ]
    return Table(["", "ours", "paper"], rows, "Table 1: the body", "lrr")


def learning_table(run: TrainConfig, paper: Mapping[str, Any]) -> Table:
    """Table 2: how it was learned in Exp. 1."""
    agent, published = run.agent, paper["table_2"]
    samples = run.env.num_envs * agent.num_steps_per_env
    rows = [
        ["environments", f"{run.env.num_envs}", f"{published['environments']}"],
        ["horizon [control steps]", f"{agent.num_steps_per_env}", f"{published['horizon']}"],
        ["mini-batch [samples]", f"{samples // agent.algorithm.num_mini_batches}", f"{published['mini_batch_size']}"],
        ["epochs", f"{agent.algorithm.num_learning_epochs}", f"{published['epochs']}"],
        ["KL threshold", f"{agent.algorithm.desired_kl:g}", f"{published['kl_threshold']:g}"],
        ["hidden layers", str(list(agent.actor.hidden_dims)), str(published["hidden"])],
        ["training steps", f"{samples * run.max_iterations:,} samples", f"{published['training_steps']:,}"],
    ]
    return Table(["", "ours", "paper"], rows, "Table 2: PPO", "lrr")


def tracking_table(rows: Sequence[Row], paper: Mapping[str, Any]) -> Table:
    """Table 3: Exp. 1 at the paper's ten frequencies."""
    published = paper["table_3"]
    columns = (("target_head_r", 4), ("head_amplitude_m", 4), ("head_speed_mps", 3))
    lines = []
    for i, freq in enumerate(published["freq_hz"]):
        own = where(rows, "freq_hz", [freq])
        cells = ((_mean(own, column, digits), f"{published[column][i]:.{digits}f}") for column, digits in columns)
        lines.append([f"{freq:.2f}", *(cell for pair in cells for cell in pair)])
    headings = ["f [Hz]", "target-head r", "paper", "amplitude [m]", "paper", "speed [m/s]", "paper"]
    return Table(headings, lines, f"Table 3: Exp. 1, {_seeds(rows)}", "r" * len(headings))


def mode_table(rows: Sequence[Row], paper: Mapping[str, Any]) -> Table:
    """The modes of Table 3, and coordination at every frequency that was evaluated."""
    published = paper["table_3"]
    theirs = dict(zip(published["freq_hz"], published["mode"], strict=True))
    freqs = sorted({row["freq_hz"] for row in rows})
    lines = [
        [f"{f:g}", *_coordination(where(rows, "freq_hz", [f])), f"{theirs[f]}-phase" if f in theirs else "-"] for f in freqs
    ]
    headings = ["f [Hz]", *_COORDINATION, "paper"]
    return Table(headings, lines, f"Coordination in Exp. 1, {_seeds(rows)}", "r" * len(headings))


def energy_table(rows: Sequence[Row], paper: Mapping[str, Any]) -> Table:
    """Table 4: Exp. 2."""
    published = paper["table_4"]
    lines = []
    for i, weight in enumerate(published["gamma"]):
        own = where(rows, "energy_weight", [weight])
        lines.append(
            [
                f"{weight:g}",
                _mean(own, "target_head_r", 4),
                f"{published['target_head_r'][i]:.4f}",
                _mean(own, "head_amplitude_m", 4),
                f"{published['head_amplitude_m'][i]:.4f}",
                _mean(own, "energy_j", 0),
                f"{published['energy_j'][i]:.0f}",
                _mean(own, "hip_ankle_r", 2),
                _modes(own),
                f"{published['mode'][i]}-phase",
                _stood(own),
            ]
        )
    headings = ["gamma", "target-head r", "paper", "amplitude [m]", "paper", "energy [J]", "paper"]
    headings += ["hip-ankle r", "mode", "paper", "stood"]
    return Table(headings, lines, f"Table 4: Exp. 2, {_seeds(rows)}", "r" * len(headings))


def stiffness_table(rows: Sequence[Row], paper: Mapping[str, Any]) -> Table:
    """Exp. 3, which the paper shows as a figure."""
    published = paper["experiment_3"]
    rows = where(rows, "freq_hz", [published["freq_hz"]])
    lines = []
    for hip_k, theirs in zip(published["hip_k_nm_per_rad"], published["mode"], strict=True):
        own = where(rows, "hip_k_nm_per_rad", [hip_k])
        lines.append([f"{hip_k:g}", *_coordination(own), f"{theirs}-phase", _mean(own, "hip_range_deg", 1)])
    headings = ["hip stiffness [Nm/rad]", *_COORDINATION, "paper", "hip range [deg]"]
    return Table(headings, lines, f"Exp. 3: {published['freq_hz']:g} Hz, {_seeds(rows)}", "r" * len(headings))


def load_table(rows: Sequence[Row], paper: Mapping[str, Any]) -> Table:
    """Exp. 4b, which the paper shows as a figure."""
    published = paper["experiment_4b"]
    theirs = {load: f"{name}-phase" for load, name in zip(published["load_kg"], published["mode_at_ends"], strict=True)}
    loads = sorted({row["load_kg"] for row in rows})
    lines = [[f"{load:g}", *_coordination(where(rows, "load_kg", [load])), theirs.get(load, "-")] for load in loads]
    headings = ["load [kg]", *_COORDINATION, "paper"]
    return Table(headings, lines, f"Exp. 4b: {published['freq_hz']:g} Hz, {_seeds(rows)}", "r" * len(headings))


def ramp_table(rows: Sequence[Row], paper: Mapping[str, Any]) -> Table:
    """Exp. 4a, seed by seed."""
    names = {f"{what}_{kind}{unit}": digits for kind in ("centred", "trailing") for what, unit, digits in _RAMP}
    lines = [
        [
            f"seed {row['seed']:g}",
            *(_number(row.get(name, math.nan), digits) if row["valid"] else "fell" for name, digits in names.items()),
        ]
        for row in rows
    ]
    published = paper["experiment_4a"]
    caption = f"Exp. 4a: transition in the ramp [Hz]; paper: {published['transition_hz']:g} Hz, its kind of window not given"
    return Table(["", "centred windows", "sign changes", "trailing windows", "sign changes"], lines, caption, "lrrrr")


def engine_table(rows: Sequence[Row]) -> Table:
    """The headline again in each engine: mode and correlation, cost, falls, and where the modes switch."""
    engines = [name for name in ENGINES if any(row["physics"] == name for row in rows)]
    lines = []
    for freq in sorted({round(row["freq_hz"], FREQ_DIGITS) for row in rows}):
        own = [where(where(rows, "freq_hz", [freq]), "physics", [name]) for name in engines]
        lines.append(
            [
                f"{freq:.2f}",
                *(f"{_mean(o, 'hip_ankle_r', 2)} {_modes(o)}{_falls(o)}" for o in own),
                *(_mean(o, "cost_ratio", 2) for o in own),
            ]
        )
    lines.append(["switch [Hz]", *(_switch(where(rows, "physics", [name])) for name in engines), *["-" for _ in engines]])
    titles = [ENGINES[name] for name in engines]
    headings = ["f [Hz]", *(f"r, {title}" for title in titles), *(f"cost / least, {title}" for title in titles)]
    caption = f"The same policies in other physics, {_seeds(rows)}; the switch interpolated between these frequencies"
    return Table(headings, lines, caption, "r" * len(headings))


_COORDINATION = ["hip-ankle r", "phase [deg]", "mode", "least-torque r", "trained reward's r", "cost / least", "stood"]
_RAMP = (("transition", "_hz", 2), ("crossings", "", 0))


def _coordination(rows: Sequence[Row]) -> list[str]:
    """The cells under `_COORDINATION`."""
    theory = (theory_means(rows, (), name) for name in ("least_hip_ankle_r", "reward_hip_ankle_r"))
    return [
        _mean(rows, "hip_ankle_r", 2),
        _mean(rows, "relative_phase_deg", 0),
        _modes(rows),
        *(means[()].text(".2f") if means else "-" for means in theory),
        _mean(rows, "cost_ratio", 2),
        _stood(rows),
    ]


def _mean(rows: Sequence[Row], column: str, digits: int) -> str:
    """Mean over seeds and its interval, of those that did not fall; a dash where none has a value."""
    return seed_means(rows, (), column)[()].text(f".{digits}f") if rows else "-"


def _modes(rows: Sequence[Row]) -> str:
    """The mode of the mean correlation, and how many of the seeds that stood differ from it."""
    if not rows:
        return "-"
    whole = shown_mode(seed_means(rows, (), "hip_ankle_r")[()])
    stood = [row for row in rows if row["valid"]]
    others = 0 if whole == "no mode" else sum(row["mode"] != whole for row in stood)
    return f"{whole} ({others} of {len(stood)} not)" if others else whole


def _stood(rows: Sequence[Row]) -> str:
    """How many of the seeds stood: "4/5"."""
    return f"{sum(row['valid'] for row in rows)}/{len(rows)}" if rows else "-"


def _falls(rows: Sequence[Row]) -> str:
    return "" if all(row["valid"] for row in rows) else f" ({_stood(rows)} stood)"


def _switch(rows: Sequence[Row]) -> str:
    """Mean over seeds of the frequency [Hz] at which the correlation goes from in-phase to anti-phase, if once."""
    found = mean_of(list(switches(rows).values()))
    return found.text(".3f") + (f" (none in {found.trials - found.n} of {found.trials})" if found.n < found.trials else "")


def _seeds(rows: Sequence[Row]) -> str:
    count = len({row["seed"] for row in rows})
    return f"{count} seed{'s' * (count != 1)}"


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def word(verdict: str) -> str:
    """A verdict as the page has it."""
    return "not reproduced" if verdict == "not" else verdict
