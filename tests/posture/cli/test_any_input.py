"""Generated configurations and command lines: each is a valid configuration or is refused in one line, never a traceback."""

import contextlib
import copy
from collections import Counter

import hydra
import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from posture.cli.jobs import plain
from posture.config.errors import ConfigError
from posture.config.published import CONF, Published
from posture.config.reading import read
from tests.commands import ENTRIES, answer

COMMANDS = ["train", "eval", "analyse", "map", "theory", "reproduce", "export"]
"""`play` and `film` have tests of their own."""
TEXTS = {"device", "resume", "init", "ckpt", "out", "overrides", "actor", "critic", "observations", "log_ranges"} | {
    "recording", "subject", "columns", "exact"
}  # fmt: skip
"""Keys whose text is checked by functions: paths, devices, names of observations, their groups, ranges and columns, a
regular expression, further command lines."""


def composed(command):
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        return plain(hydra.compose(command))


WHOLE = {command: composed(command) for command in COMMANDS}


def places(values, above=()):
    """The path of every key and of every entry of a list, nested ones included."""
    pairs = values.items() if isinstance(values, dict) else enumerate(values)
    for key, value in pairs:
        yield (*above, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*above, key))


def value_at(values, place):
    for part in place:
        values = values[part]
    return values


# -- types and ranges ------------------------------------------------------------------------------------------------


def leaves(schema, definitions, path=()):
    """(path, schema) of every value in a JSON schema that is not a record, a list or a union of such."""
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


@pytest.mark.parametrize("kind", [*(ENTRIES[command][0] for command in COMMANDS), Published])
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


@pytest.mark.parametrize("command", COMMANDS)
def test_every_key_of_conf_is_read_and_none_is_missing(command):
    kind, values = ENTRIES[command][0], WHOLE[command]
    assert read(kind, values).model_dump(mode="json").keys() == values.keys()
    tried = 0
    for *above, last in places(values):
        if isinstance(last, int) or "observations" in above:  # users name the groups of observations
            continue
        for change in (lambda record, key: record.pop(key), lambda record, key: record.update({f"{key}_": record[key]})):
            changed = copy.deepcopy(values)
            change(value_at(changed, above), last)
            with pytest.raises(ConfigError, match=last):
                read(kind, changed)
            tried += 1
    assert tried >= 2 * len(values)


REFUSED = [  # beside the ranges, which every key has (test above)
    ("train", "env.freq=fast", "env.freq = fast"),
    ("train", "env.freq=[1.0,0.5]", "env.freq: a range goes from low to high"),
    ("train", "env.freq=[true,1.0]", "env.freq: true"),
    ("train", "env.control_dt=0.03", "env.control_dt: 0.03 s in 2 solver.substeps"),
    ("train", "env.control_dt=0.1 env.solver.substeps=10 env.freq=2", "env.freq: a period at 2 Hz has fewer than 6"),
    ("train", "env.control_dt=0.1 env.solver.substeps=10 evaluation.freq=[2]", "evaluation.freq: a period at 2 Hz has"),
    ("train", "env.num_envs=0", "env.num_envs = 0: must be greater than or equal to 1"),
    ("train", "env.num_envs=2.5", "env.num_envs = 2.5"),
    ("train", "env.num_envs=3", "env.num_envs = 3 cannot be shared equally among 2 processes"),
    ("train", "env.hip_k=-5", "env.hip_k = -5: must be greater than or equal to 0"),
    ("train", "env.hip_k=nan", "env.hip_k"),
    ("train", "env.ankle_k=inf", "env.ankle_k"),
    ("train", "env.friction=[0,1e400]", "env.friction = [0, inf]: allowed is a number, or a range [low, high]"),
    ("train", f"env.friction=[0,{10**400}]", "env.friction"),
    ("train", "env.hip_k=[25,200] env.ranges.hip_k=[50,60]", "env.ranges.hip_k: hip_k has a range, too"),
    ("train", "env.load_at=[0.1]", "env.load_at: too few values"),
    ("train", "env.load_at=[0.1,0.2,0.3]", "env.load_at = [0.1, 0.2, 0.3]: the number of values must be at most 2"),
    ("train", "env.log_ranges=hip_k", "env.log_ranges = hip_k: allowed is a list [..]"),
    ("train", "agent.average_from=1", "agent.average_from = 1: must be less than 1"),
    ("map", "ckpt=[]", "ckpt = []: allowed is a path, or a list of paths"),
    ("map", "ckpt=null", "ckpt = None: allowed is a path, or a list of paths"),
    ("map", "varied.hip_k=[100,100]", "varied.hip_k: 100.0 appears 2 times"),
    ("map", "varied.amplitude=[0.01]", "varied.amplitude: 0.01 m leaves the head no motion to make"),
    ("train", "env.load=true", "env.load: true is not allowed here"),
    ("train", "env.ramp={start:0.5,rate:-0.1,duration:10}", "env.ramp: the ramp ends at -0.5 Hz"),
    ("train", "env.ramp=3", "env.ramp = 3: allowed is a ramp {start: .., rate: .., duration: ..} in quotes"),
    (
        "eval",
        "env.ramp=duration:20",
        "env.ramp = duration:20: allowed is a ramp {start: .., rate: .., duration: ..} in quotes, or none",
    ),
    ("train", "env.ramp={start:0,rate:0,duration:10}", "env.ramp: the ramp stays below 0.001 Hz"),
    ("train", "env.episode_steps=0", "env.episode_steps = 0: must be greater than or equal to 1"),
    ("train", "env.episode_steps=[9,3]", "env.episode_steps: a range goes from low to high"),
    ("train", "env.termination.head_tolerance=0.11", "env.termination.head_tolerance: 0.11 m leaves the head no motion"),
    ("train", "env.termination.fall_height=1.3", "env.termination.fall_height"),
    ("train", "env.body=70", "env.body = 70: allowed is a group of keys"),
    ("train", "env.body={mass:5,height:1.7,sex:male}", "env.body.mass = 5: must be greater than or equal to 20"),
    ("train", "env.body={mass:70,height:1.7}", "env.body.sex: missing"),
    ("eval", "env.body.sex=man", "env.body.sex = 'man': must be 'female' or 'male'"),
    ("train", "env.reward.alive={start:1e-9,end:1e4,until:0.5}", "env.reward.alive: start and end must not lie further"),
    ("train", "env.reward.alive=x", "env.reward.alive = x: allowed is a number, or a schedule"),
    ("train", "env.observations.policy=[head,balance]", "env.observations.policy: unknown balance"),
    ("train", "env.observations.policy=[head,head]", "env.observations.policy: head appears 2 times; give each name once"),
    ("train", "agent.obs_groups.critic=[policy,policy]", "agent.obs_groups.critic: policy appears 2 times"),
    ("train", "agent.algorithm.num_mini_batches=40000", "env.num_envs x agent.num_steps_per_env = 32768 samples"),
    ("train", "agent.actor.hidden_dims=[1000000]", "agent.actor.hidden_dims.0"),
    ("train", "agent.actor.class_name=os.system", "agent.actor.class_name"),
    ("train", "agent.actor.class_name=RNNModel", "agent.actor.rnn_type: RNNModel needs it, MLPModel has none"),
    ("train", "agent.critic.rnn_num_layers=1", "agent.critic.rnn_num_layers: RNNModel needs it, MLPModel has none"),
    ("train", "agent.std_floor.end=0.05", "agent.std_floor.end = 0.05 must not exceed std_range[0] = 0.03"),
    (
        "train",
        "agent.obs_groups.actor=[target_motion] env.observations.target_motion=[]",
        "agent.obs_groups.actor: the groups",
    ),
    ("train", "env.reward.tolerance=0.11", "env.reward.tolerance: 0.11 m leaves the head no motion"),
    ("train", "agent.actor.distribution_cfg.init_std=2", "agent.actor.distribution_cfg.init_std = 2 must lie within"),
    ("train", "agent.obs_groups.actor=[foot_wrench]", "agent.obs_groups.actor: foot_wrench not among"),
    ("train", "evaluation.transient=100", "evaluation.transient: 100 s leaves nothing of a trial of 100 s"),
    ("train", "evaluation.duration=99999", "evaluation.duration = 99999: allowed is at most 16600 s at 10 frequencies"),
    (
        "train",
        "evaluation.duration=99999 evaluation.freq=[1]",
        "evaluation.duration = 99999: allowed is at most 83000 s at 1",
    ),
    ("eval", "policy=lqr lqr.tolerance_margin=0.03", "lqr.tolerance_margin: 0.03 m leaves nothing"),
    ("eval", "lqr.env.observations.policy=[balance]", "lqr.env.observations.policy: unknown balance"),
    ("eval", "policy=lqr env.ramp={start:0,rate:0.1,duration:10}", "env.ramp: policy=lqr plans its motion for constant"),
    ("eval", "policy=lqr lqr.env.ramp={start:0,rate:0.1,duration:10}", "env.ramp: policy=lqr plans its motion for constant"),
    ("eval", "ckpt=''", "ckpt: a path must not be empty"),
    ("theory", "tolerance=0.1", "tolerance: 0.1 m leaves the head no motion"),
]


@pytest.mark.parametrize(("command", "overrides", "expected"), REFUSED)
def test_a_bad_value_is_refused_by_name(command, overrides, expected):
    values = OmegaConf.create(WHOLE[command])
    for override in OverridesParser.create().parse_overrides(overrides.split()):
        OmegaConf.update(values, override.key_or_group, override.value())
    with pytest.raises(ConfigError) as refusal:
        read(ENTRIES[command][0], OmegaConf.to_container(values))
    assert str(refusal.value).startswith(expected) and "\n" not in str(refusal.value)


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
wild = st.one_of(
    anything, st.lists(numbers, max_size=3), st.fixed_dictionaries(dict.fromkeys(("start", "end", "until"), numbers))
)


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def near(value):
    """Numbers near `value`, which may well be allowed in its place."""
    scaled = st.floats(0.7, 1.5).map(lambda factor: factor * value)
    return scaled.map(round) if isinstance(value, int) else scaled


def check_random_values(examples):
    outcomes = Counter()

    @given(st.data())
    @settings(max_examples=examples)
    def check(data):
        command, mild = data.draw(st.sampled_from(COMMANDS)), data.draw(st.booleans())
        values = copy.deepcopy(WHOLE[command])
        every = [place for place in places(values) if not mild or is_number(value_at(values, place))]
        for place in data.draw(st.lists(st.sampled_from(every), min_size=1, max_size=3, unique=True)):
            with contextlib.suppress(KeyError, IndexError, TypeError):  # an earlier change removed this place
                new = data.draw(near(value_at(values, place)) if mild else wild)
                value_at(values, place[:-1])[place[-1]] = new
        try:
            config = read(ENTRIES[command][0], values)
        except ConfigError as refusal:
            assert str(refusal) and "\n" not in str(refusal) and len(str(refusal)) < 1000
            outcomes["refused"] += 1
        else:
            assert read(ENTRIES[command][0], config.model_dump(mode="json")) == config
            outcomes["accepted"] += 1

    check()
    assert min(outcomes["refused"], outcomes["accepted"]) >= examples // 10, outcomes


def test_any_values_are_a_configuration_or_refused_in_one_line():
    check_random_values(300)


@pytest.mark.slow
def test_many_values():
    check_random_values(30_000)


# -- command lines ---------------------------------------------------------------------------------------------------

KEYS = {
    ".".join(place): value_at(whole, place)
    for whole in WHOLE.values()
    for place in places(whole)
    if not any(isinstance(part, int) for part in place)
}
GROUPS = ["env", "agent", "evaluation", "experiment", "senses", "env@lqr.env"]
VALUES = """
    true null '' [] {} [1,2] [2,1] [true,1] {start:1,end:2,until:0.5} ${env.hip_k} ${nope} ${oc.env:NOPE} ??? 1,2 1,2,...,5
    [ } " ' \\ é a=b a,b x'y range(1,4) choice(1,2) glob(*) tag(a,1) sort(3,1) interval(0,1) ../.. /proc/x latest
    pretrained/none paper ramp load energy [0.1,0.2] [nan,1] {a:1} cuda cuda:99 cpu 0x10 1_000 1e5 -1 - -- @ $ ${ $} %s
"""
FLAGS = [
    "--run",
    "--config-dir=.",
    "--config-dir=none",
    "--config-name=eval",
    "--config-path=.",
    "--package=env",
    "--resolve",
    "-x",
    "--multi",
]
words = st.one_of(numbers.map(str), st.sampled_from(VALUES.split()), st.text(max_size=12))
wild_arguments = st.one_of(
    st.builds("{}{}={}".format, st.sampled_from(["", "", "", "+", "++", "~"]), st.sampled_from(sorted(KEYS)), words),
    st.builds("{}={}".format, st.sampled_from(GROUPS), words),
    st.builds("{}{}".format, st.sampled_from(["~", ""]), st.sampled_from([*KEYS, *GROUPS])),
    st.sampled_from(FLAGS),
    st.text(max_size=12).filter(lambda text: not text.startswith("-")),
)


def mild_arguments(command):
    """Overrides of the command's own numbers that are probably allowed."""
    numeric = [place for place in places(WHOLE[command]) if is_number(value_at(WHOLE[command], place))]
    named = [place for place in numeric if all(isinstance(part, str) for part in place)]
    return st.sampled_from(named).flatmap(
        lambda place: near(value_at(WHOLE[command], place)).map(lambda number: f"{'.'.join(place)}={number}")
    )


command_lines = st.sampled_from(COMMANDS).flatmap(
    lambda command: st.tuples(
        st.just(command),
        st.sampled_from([[], ["-m"]]),
        st.one_of(st.lists(wild_arguments, min_size=1, max_size=3), mild_arguments(command).map(lambda line: [line])),
    )
)


def check_command_lines(folder, examples):
    outcomes = Counter()

    @given(command_lines)
    @settings(max_examples=examples)
    def check(line):
        command, sweep, arguments = line
        code, stderr, configs = answer(command, *sweep, *arguments)
        outcomes[code] += 1
        if code == 0:
            assert configs and all(isinstance(config, ENTRIES[command][0]) for config in configs)
        else:
            lines = stderr.strip().splitlines()
            assert code == 2 and not configs, (code, stderr)
            assert len(lines) == 1 and lines[0].startswith("error: ") and len(lines[0]) > len("error: "), stderr

    with contextlib.chdir(folder):
        check()
    if examples >= 100:  # among few, all may be refused
        assert min(outcomes[0], outcomes[2]) >= examples // 10, outcomes


def test_any_command_line_runs_or_is_refused_in_one_line(tmp_path):
    check_command_lines(tmp_path, 20)


@pytest.mark.slow
def test_many_command_lines(tmp_path):
    check_command_lines(tmp_path, 3000)
