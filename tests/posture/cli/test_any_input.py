"""Generated configurations and command lines: each is a valid configuration or is refused in one line, never a traceback."""

import contextlib
import copy
import io
import subprocess
import sys

import hydra
import pytest
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from posture.cli import entry
from posture.cli.jobs import plain
from posture.config.errors import ConfigError
from posture.config.eval import EvalConfig
from posture.config.export import ExportConfig
from posture.config.published import CONF, Published
from posture.config.reading import read
from posture.config.reproduce import ReproduceConfig
from posture.config.theory import TheoryConfig
from posture.config.train import TrainConfig

ENTRIES = {
    "train": (TrainConfig, "train"),
    "eval": (EvalConfig, "evaluate_all"),
    "theory": (TheoryConfig, "theory"),
    "export": (ExportConfig, "export"),
    "reproduce": (ReproduceConfig, "reproduce"),
}
TEXTS = {"device", "resume", "ckpt", "out", "overrides", "actor", "critic", "observations"}
"""Keys whose text is checked by functions: paths, devices, names of observations, further command lines."""


def composed(command):
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        return plain(hydra.compose(command))


WHOLE = {command: composed(command) for command in ENTRIES}


def places(values, above=()):
    """The path of every key, and of every entry of a list, inner ones included."""
    pairs = values.items() if isinstance(values, dict) else enumerate(values)
    for key, value in pairs:
        yield (*above, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*above, key))


def values_of(values):
    """The value of each of `places`, in its order."""
    for value in values.values() if isinstance(values, dict) else values:
        yield value
        if isinstance(value, (dict, list)):
            yield from values_of(value)


# -- types and ranges ------------------------------------------------------------------------------------------------


def leaves(schema, definitions, path=()):
    """(path, schema) of everything in a JSON schema that is no record, list or choice of such."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].rsplit("/", 1)[-1]]
    inner = [
        *schema.get("anyOf", []),
        *schema.get("prefixItems", []),
        *([schema["items"]] if isinstance(schema.get("items"), dict) else []),
        *([schema["additionalProperties"]] if isinstance(schema.get("additionalProperties"), dict) else []),
        *schema.get("patternProperties", {}).values(),
    ]
    for name, part in schema.get("properties", {}).items():
        yield from leaves(part, definitions, (*path, name))
    for part in inner:
        yield from leaves(part, definitions, path)
    if not inner and "properties" not in schema:
        yield path, schema


@pytest.mark.parametrize("kind", [*(kind for kind, _ in ENTRIES.values()), Published])
def test_every_key_has_a_type_and_a_range(kind):
    schema = kind.model_json_schema()
    found = list(leaves(schema, schema.get("$defs", {})))
    assert len(found) > 5
    for path, leaf in found:
        if leaf.get("type") in ("number", "integer"):
            assert {"minimum", "exclusiveMinimum"} & leaf.keys() and {"maximum", "exclusiveMaximum"} & leaf.keys(), path
        elif leaf.get("type") == "string":
            assert {"enum", "const"} & leaf.keys() or TEXTS & set(path), path
        else:
            assert leaf.get("type") in ("boolean", "null"), (path, leaf)


@pytest.mark.parametrize("command", ENTRIES)
def test_every_key_of_conf_is_read_and_none_is_missing(command):
    kind, _ = ENTRIES[command]
    values = WHOLE[command]
    assert read(kind, values).model_dump(mode="json").keys() == values.keys()
    for *above, last in places(values):
        if isinstance(last, int) or "observations" in above:  # groups of observations have names of the user's
            continue
        for harm in (lambda record, last: record.pop(last), lambda record, last: record.update({f"{last}_": record[last]})):
            harmed = copy.deepcopy(values)
            record = harmed
            for part in above:
                record = record[part]
            harm(record, last)
            with pytest.raises(ConfigError, match=last):
                read(kind, harmed)


REFUSED = [
    ("train", "env.control_dt=0", "env.control_dt"),
    ("train", "env.control_dt=-0.01", "env.control_dt"),
    ("train", "env.control_dt=nan", "env.control_dt"),
    ("train", "env.control_dt=0.03", "env.control_dt: 0.03 s in 2 solver.substeps"),
    ("train", "env.control_dt=0.1 env.solver.substeps=10 env.freq=2", "env.freq: a period at 2 Hz has fewer than 6"),
    ("train", "env.control_dt=0.1 env.solver.substeps=10 evaluation.freq=[2]", "evaluation.freq: a period at 2 Hz has"),
    ("train", "env.num_envs=0", "env.num_envs"),
    ("train", "env.hip_k=-1", "env.hip_k"),
    ("train", "env.ankle_k=inf", "env.ankle_k"),
    ("train", "env.ankle_k=1e6", "env.ankle_k"),
    ("train", "env.load=1e39", "env.load"),
    ("train", "env.load=-1", "env.load"),
    ("train", "env.friction=0", "env.friction"),
    ("train", "env.torque_limit=0", "env.torque_limit"),
    ("train", "env.amplitude=0", "env.amplitude"),
    ("train", "env.amplitude=1e39", "env.amplitude"),
    ("train", "env.freq=[true,1.0]", "env.freq: true"),
    ("train", "env.ramp={start:0.5,rate:-0.1,duration:10}", "env.ramp: the ramp ends at -0.5 Hz"),
    ("train", "env.ramp={start:0,rate:0,duration:10}", "env.ramp: the ramp stays below 0.001 Hz"),
    ("train", "env.ramp={start:0,rate:1e400,duration:10}", "env.ramp.rate"),
    ("train", "env.episode_steps=1e30", "env.episode_steps"),
    ("train", "env.termination.head_tolerance=0.11", "env.termination.head_tolerance: 0.11 m leaves the head no motion"),
    ("train", "env.termination.fall_height=1.3", "env.termination.fall_height"),
    ("train", "env.reward.alive=1e39", "env.reward.alive"),
    ("train", "env.reward.alive={start:1e-9,end:1e4,steps:5}", "env.reward.alive: start and end must not lie further"),
    ("train", "env.observations.policy=[balance]", "env.observations.policy.0 = 'balance'"),
    ("train", "agent.num_steps_per_env=0", "agent.num_steps_per_env"),
    ("train", "agent.algorithm.num_mini_batches=0", "agent.algorithm.num_mini_batches"),
    ("train", "agent.algorithm.num_mini_batches=40000", "env.num_envs x agent.num_steps_per_env = 32768 samples"),
    ("train", "agent.algorithm.learning_rate=nan", "agent.algorithm.learning_rate"),
    ("train", "agent.algorithm.learning_rate=10", "agent.algorithm.learning_rate"),
    ("train", "agent.actor.hidden_dims=[64,0]", "agent.actor.hidden_dims.1"),
    ("train", "agent.actor.hidden_dims=[1000000]", "agent.actor.hidden_dims.0"),
    ("train", "agent.actor.distribution_cfg.std_range=[0,1]", "agent.actor.distribution_cfg.std_range.0"),
    ("train", "threads=1e6", "threads"),
    ("train", "evaluation.tolerance=0", "evaluation.tolerance"),
    ("train", "evaluation.duration=99999", "evaluation.duration: 99999 s"),
    ("train", "paper.experiment_4a.window_steps=1", "paper: published numbers cannot be changed"),
    ("eval", "paper.table_3.mode=[in]", "paper: published numbers cannot be changed"),
    ("eval", "env.load=-1", "env.load"),
    ("eval", "env.hip_k=nan", "env.hip_k"),
    ("eval", "policy=lqr lqr.torque=0", "lqr.torque"),
    ("eval", "policy=lqr lqr.tolerance_margin=0.03", "lqr.tolerance_margin: 0.03 m leaves nothing"),
    ("eval", "lqr.env.observations.policy=[balance]", "lqr.env.observations.policy.0 = 'balance'"),
    ("eval", "ckpt=''", "ckpt: a path must not be empty"),
    ("theory", "experiment_4b.step=1e-9", "experiment_4b.step"),
    ("theory", "figure_13.step=1e-9", "figure_13.step"),
    ("theory", "tolerance=0.1", "tolerance: 0.1 m leaves the head no motion"),
    ("reproduce", "seeds=0", "seeds"),
]


@pytest.mark.parametrize(("command", "arguments", "expected"), REFUSED)
def test_refused_by_name(tmp_path, monkeypatch, command, arguments, expected):
    monkeypatch.chdir(tmp_path)
    code, told, called = answer(command, arguments.split())
    assert code == 2 and not called
    assert told.startswith(f"error: {expected}") and len(told.splitlines()) == 1, told


# -- values of any kind ----------------------------------------------------------------------------------------------

numbers = st.one_of(
    st.integers(-3, 20),
    st.integers(-(10**40), 10**40),
    st.floats(),
    st.sampled_from([0.0, -0.0, 1e-320, 1e-45, 1e38, 1e39, 1.7e308, 2**31, 2**63, 10**400]),
)
anything = st.recursive(
    st.one_of(st.none(), st.booleans(), numbers, st.text(max_size=8)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=6), inner, max_size=3)),
    max_leaves=6,
)
spoilt = st.one_of(
    anything, st.lists(numbers, max_size=3), st.fixed_dictionaries(dict.fromkeys(("start", "end", "steps"), numbers))
)


def near(value):
    """What may well be allowed in place of `value`."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return st.just(value)
    scaled = st.floats(0.7, 1.5).map(lambda factor: factor * value)
    return scaled.map(round) if isinstance(value, int) else scaled


def check_values(data):
    command = data.draw(st.sampled_from(sorted(ENTRIES)))
    values = copy.deepcopy(WHOLE[command])
    every, mild = list(places(values)), data.draw(st.booleans())
    for place in data.draw(st.lists(st.sampled_from(every), min_size=1, max_size=3)):
        record = values
        with contextlib.suppress(KeyError, IndexError, TypeError):  # what was spoilt before has no such place
            for part in place[:-1]:
                record = record[part]
            record[place[-1]] = data.draw(near(record[place[-1]]) if mild else spoilt)
    try:
        config = read(ENTRIES[command][0], values)
    except ConfigError as refusal:
        event("refused")
        assert str(refusal) and "\n" not in str(refusal) and len(str(refusal)) < 1000
    else:
        event("a configuration")
        assert read(ENTRIES[command][0], config.model_dump(mode="json")) == config


@given(st.data())
@settings(max_examples=2000, deadline=None)
def test_any_values_are_a_configuration_or_refused_in_one_line(data):
    check_values(data)


@pytest.mark.slow
@given(st.data())
@settings(max_examples=30_000, deadline=None)
def test_many_values(data):
    check_values(data)


# -- command lines ---------------------------------------------------------------------------------------------------

OVERRIDES = {
    ".".join(map(str, place)): value
    for whole in WHOLE.values()
    for place, value in zip(places(whole), values_of(whole), strict=True)
    if not any(isinstance(part, int) for part in place)
}
NUMBERS = {key: value for key, value in OVERRIDES.items() if isinstance(value, (int, float))}
GROUPS = ["env", "agent", "evaluation", "experiment", "env@lqr.env"]
VALUES = """
    true null '' [] {} [1,2] [2,1] [true,1] {start:1,end:2,steps:3} ${env.hip_k} ${nope} ${oc.env:NOPE} ??? 1,2 1,2,...,5
    [ } " ' \\ é a=b a,b x'y range(1,4) choice(1,2) glob(*) tag(a,1) sort(3,1) ../.. /proc/x latest pretrained/none
    paper ramp load energy [0.1,0.2] [nan,1] {a:1} cuda cuda:99 cpu 0x10 1_000 1e5 -1 - -- @ $ ${ $} %s
"""
words = st.one_of(numbers.map(str), st.sampled_from(VALUES.split()), st.text(max_size=12))
argument = st.one_of(
    st.builds("{}{}={}".format, st.sampled_from(["", "", "", "+", "++", "~"]), st.sampled_from(sorted(OVERRIDES)), words),
    st.builds("{}={}".format, st.sampled_from(GROUPS), words),
    st.builds("{}{}".format, st.sampled_from(["~", ""]), st.sampled_from([*OVERRIDES, *GROUPS])),
    st.text(max_size=12).filter(lambda text: not text.startswith("-")),
)
mild_argument = st.sampled_from(sorted(NUMBERS)).flatmap(
    lambda key: near(NUMBERS[key]).map(lambda x: f"{key}={str(x).lower()}")
)
command_lines = st.tuples(
    st.sampled_from(sorted(ENTRIES)),
    st.booleans(),
    st.one_of(st.lists(argument, min_size=1, max_size=3), st.lists(mild_argument, min_size=1, max_size=2)),
)


def answer(command, arguments):
    """Exit code, stderr and the configurations that the task was called with, of `python -m posture.<command> arguments`."""
    kind, name = ENTRIES[command]
    called = []

    def task(config, folder):
        called.append(config)

    task.__name__ = name
    told = io.StringIO()
    GlobalHydra.instance().clear()
    HydraConfig.instance().cfg = None
    code = 0
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stderr(told), contextlib.redirect_stdout(io.StringIO()):
        module = f"posture.{command}" if command in ("train", "eval") else f"posture.{command}.__main__"
        patch.setattr(f"{module}.{name}", task)
        patch.setattr(sys, "argv", [f"posture.{command}", *arguments])
        try:
            entry.run(command, kind, task)
        except SystemExit as stop:
            code = stop.code
    return code, told.getvalue(), called


def check(command, sweep, arguments):
    code, told, called = answer(command, ["-m"] * sweep + arguments)
    event(f"exit code {code}")
    if code == 0:
        assert called and all(isinstance(config, ENTRIES[command][0]) for config in called)
        return
    lines = told.strip().splitlines()
    assert code == 2 and not called, (code, told)
    assert len(lines) == 1 and lines[0].startswith("error: ") and len(lines[0]) > len("error: "), told


@given(command_lines)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_command_line_runs_or_is_refused_in_one_line(tmp_path_factory, line):
    with contextlib.chdir(tmp_path_factory.getbasetemp()):
        check(*line)


@pytest.mark.slow
@given(command_lines)
@settings(max_examples=3000, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_many_command_lines(tmp_path_factory, line):
    with contextlib.chdir(tmp_path_factory.getbasetemp()):
        check(*line)


SPOILT_LINES = [
    ("train", ["env.control_dt=nan"]),
    ("train", ["-m", "env.hip_k=25,-1"]),
    ("eval", ["env.amplitude=inf"]),
    ("eval", ["ckpt='a\nb'"]),
    ("theory", ["env=[0]"]),
    ("reproduce", ["seeds=1e400"]),
]


def test_real_processes_say_one_line(tmp_path):
    started = [
        subprocess.Popen(
            [sys.executable, "-m", f"posture.{command}", *arguments],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for command, arguments in SPOILT_LINES
    ]
    for (command, arguments), process in zip(SPOILT_LINES, started, strict=True):
        out, told = process.communicate(timeout=120)
        assert process.returncode == 2, (command, arguments, told)
        assert told.startswith("error: ") and len(told.splitlines()) == 1 and out == "", (command, arguments, told)
    assert list(tmp_path.iterdir()) == []
