"""A key that can have no effect is refused where the command line sets it."""

from functools import cache

import pytest
import yaml

from posture.cli.jobs import check, compose
from tests.commands import ENTRIES, SHORT, answer, refused

pytestmark = pytest.mark.usefixtures("elsewhere")

RAMP = "{start:0,rate:0.1,duration:10}"
REFUSED = [
    ("train", ["env.freq=0.3", f"env.ramp={RAMP}"], "env.freq: has no effect beside env.ramp"),
    ("train", ["env.freq=0.3", "env.freq_draw=uniform"], "env.freq_draw: has no effect with one env.freq"),
    ("train", ["+env.observations.more=[head]"], "env.observations.more: has no effect without agent.obs_groups"),
    (
        "train",
        ["env=human", "agent=human", "+env.sensing.noise.joint_angle={white: 0.1, drift: 0}"],
        "env.sensing.noise.joint_angle.white: has no effect on what is not observed, or only exactly",
    ),
    ("train", ["env.sensing.delay=0.005"], "env.sensing.delay: has no effect below half a control step of 0.0166 s"),
    (
        "train",
        ["agent.algorithm.schedule=fixed", "agent.algorithm.desired_kl=0.1"],
        "agent.algorithm.desired_kl: has no effect with agent.algorithm.schedule=fixed",
    ),
    ("eval", ["policy=lqr", "ckpt=latest"], "ckpt: has no effect with policy=lqr"),
    ("eval", ["policy=lqr", "again=false"], "again: has no effect with policy=lqr"),
    ("eval", ["policy=lqr", "lqr.env.num_envs=3"], "lqr.env.num_envs: has no effect with policy=lqr"),
    ("eval", ["policy=lqr", "lqr.env.reward.alive=1"], "lqr.env.reward.alive: has no effect with policy=lqr"),
    ("eval", ["policy=lqr", "env.load=1", "lqr.env.load=2"], "lqr.env.load: has no effect beside env.load"),
    (
        "eval",
        ["policy=lqr", "env.body.mass=70", "lqr.env.body={mass:80,height:1.7,sex:male}"],
        "lqr.env.body.mass: has no effect beside env.body.mass",
    ),
    ("eval", ["lqr.angle=0.2"], "lqr.angle: has no effect with policy=trained"),
    ("eval", ["lqr={angle: 0.2}"], "lqr.angle: has no effect with policy=trained"),
    ("eval", [f"env.ramp={RAMP}", "evaluation.freq=[1]"], "evaluation.freq: has no effect beside env.ramp"),
    ("eval", ["experiment=ramp", "evaluation.freq=[1]"], "evaluation.freq: has no effect beside env.ramp"),
    ("eval", ["-m", "env.load=0,1", "lqr.angle=1,2"], "lqr.angle: has no effect with policy=trained"),
    ("theory", ["env.num_envs=3"], "env.num_envs: has no effect on the theory"),
    ("theory", ["env.physics=mujoco"], "env.physics: has no effect on the theory"),
    ("theory", ["env.reward.alive=1"], "env.reward.alive: has no effect on the theory"),
    ("theory", ["evaluation.transient=1"], "evaluation.transient: has no effect on the theory"),
    ("theory", ["evaluation.tolerance=0.02"], "evaluation.tolerance: has no effect on the theory"),
    ("theory", ["env.termination.head_tolerance=0.03"], "env.termination.head_tolerance: has no effect on the theory"),
    ("theory", ["tolerance=0.02", "env.reward.tolerance=0.03"], "env.reward.tolerance: has no effect on the theory"),
    ("export", ["evaluation.figures=false"], "evaluation.figures: has no effect on an export"),
    ("export", ["what=[policy]", "env.load=1"], "env.load: has no effect without trajectories in what"),
    ("export", ["what=[policy]", "in_degrees=true"], "in_degrees: has no effect without trajectories in what"),
    ("analyse", ["evaluation.duration=5"], "evaluation.duration: has no effect on recordings"),
    ("analyse", ["window=5"], "window: has no effect without ramp"),
    ("analyse", ["ramp=estimate", "freq=0.5"], "freq: has no effect beside ramp"),
    ("analyse", ["env.load=1"], "env.load: has no effect without prediction=true"),
    ("analyse", ["prediction=true", "env.physics=mujoco"], "env.physics: has no effect on the prediction"),
    ("film", ["films=[ramp]", "env.freq=0.3"], "env.freq: has no effect without two_modes in films"),
    ("film", ["films=[two_modes]", "env.ramp.start=0.1"], "env.ramp.start: has no effect without ramp in films"),
    ("play", ["evaluation.freq=[1]"], "evaluation.freq: has no effect on the page"),
    ("play", ["recording.hold=1"], "recording.hold: has no effect without record"),
    ("play", ["out=here"], "out: has no effect without record"),
    ("play", ["record=a.html", "port=8081"], "port: has no effect on a recording"),
    ("reproduce", ["stages=[report]", "seeds=1"], "seeds: has no effect without train or evaluate in stages"),
    ("reproduce", ["stages=[train]", "search=[0.1,1]"], "search: has no effect without report or ship in stages"),
    ("reproduce", ["launcher=basic", "parallel=3"], "parallel: has no effect with launcher=basic"),
]
ALLOWED = [
    ("analyse", ["env.torque_limit=50"]),
    ("analyse", ["prediction=true", "env.load=1", "prediction_tolerance=0.01"]),
    ("eval", ["policy=lqr", "lqr.angle=0.2", "lqr.env.load=1", "env.hip_k=60"]),
    ("eval", ["policy=lqr", "env/body=anthropometric", "env.body.mass=60"]),
    ("theory", ["env/body=anthropometric", "env.body.sex=female"]),
    ("eval", ["-m", "policy=trained,lqr", "lqr.angle=0.2", "ckpt=pretrained"]),
    ("eval", ["-m", f"env.ramp=none,{RAMP}", "evaluation.freq=[1]"]),
    ("theory", ["env=paper", "evaluation.tolerance=0.02"]),
    ("theory", ["env.reward.tolerance_weight=0", "env.termination.head_tolerance=0.03"]),
    ("play", ["ckpt=lqr", "record=a.html", "lqr.angle=0.2", "out=here"]),
    ("train", ["-m", "env.freq=0.3,[0.3,0.6]", "env.freq_draw=uniform"]),
]


@pytest.mark.parametrize(("command", "arguments", "expected"), REFUSED)
def test_a_key_without_effect_is_refused(tmp_path, command, arguments, expected):
    code, stderr, configs = answer(command, *arguments)
    assert (code, stderr, configs) == (2, f"error: {expected}\n", [])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("command", "arguments"), ALLOWED)
def test_a_key_with_an_effect_in_one_of_the_jobs_is_allowed(command, arguments):
    assert check(command, ENTRIES[command][0], arguments).jobs


@cache
def configured(command, *overrides):
    return compose(command, ENTRIES[command][0], *overrides)


NEEDED = {"import_checkpoint": ("file=model_1.pt",)}


@pytest.mark.parametrize(
    ("command", "overrides"),
    [*((command, NEEDED.get(command, ())) for command in ENTRIES), ("eval", ("policy=lqr",)), ("export", ("what=[policy]",))]
    + [("film", (f"films=[{name}]",)) for name in ("two_modes", "ramp")]
    + [("play", ("record=a.html",)), ("reproduce", ("stages=[train]",)), ("reproduce", ("stages=[ship]",))],
)
def test_the_keys_listed_exist(command, overrides):
    config = configured(command, *overrides)
    for name in config.without_effect().keys() - {"out"}:
        value = config.model_dump()
        for part in name.split("."):
            value = value[part]


@pytest.mark.parametrize(
    ("command", "override"),
    [("train", "paper.experiment_4a.duration_s=5"), ("train", "++paper.more=1")]
    + [(command, "paper.table_3.freq_hz=[1]") for command in ENTRIES],
)
def test_published_numbers_are_refused_by_every_command(command, override):
    code, stderr, _ = answer(command, override)
    assert code == 2 and stderr.startswith("error: paper: published numbers cannot be changed"), stderr


def test_frequencies_in_a_ramp_that_the_policy_was_trained_on(sound, monkeypatch, capsys, tmp_path):
    config = yaml.safe_load((sound / "config.yaml").read_text())
    config["env"]["ramp"] = {"start": 0.5, "rate": 0.1, "duration": 5.0}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    (tmp_path / "model_2.pt").write_bytes((sound / "model_2.pt").read_bytes())
    for command, more in (("eval", SHORT), ("export", SHORT[:1])):
        line = refused(monkeypatch, capsys, command, f"ckpt={tmp_path}", "evaluation.freq=[0.5]", *more)
        assert line.startswith("error: evaluation.freq: has no effect in a ramp") and "env.ramp=none" in line
