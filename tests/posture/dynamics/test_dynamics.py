"""The trials in the simulation, and the command."""

import errno
import math

import numpy as np
import pytest

from posture.cli import jobs
from posture.config.dynamics import DynamicsConfig, check_trials
from posture.dynamics import courses, trials
from posture.storage import run_dir
from tests.commands import call, refused, table

RAMP = "ramp={start: 0.8, end: 1.2, rate: 0.2, window: 1}"
SMALL = [
    "repeats=2",
    "staircase.cycles=2",
    "staircase.skip=0",
    "~staircase.courses.platform",
    "~staircase.courses.head_tracking",
    "+staircase.courses.short=[0.8,1.2]",
    RAMP,
    "perturbation={freq: {low: 0.8, high: 1.2, step: 0.4}, force: 20, time: 0.1, first: 1.5, every: 1.5, pushes: 2}",
    "fluctuation.freq={low: 0.8, high: 1.2, step: 0.2}",
    "evaluation.duration=5",
    "evaluation.transient=1",
]


@pytest.fixture(scope="module")
def shipped():
    model = run_dir.find_checkpoint("pretrained/universal")
    return model, run_dir.read_config(model.parent)


def config(*overrides):
    return jobs.compose("dynamics", DynamicsConfig, *SMALL, *overrides)


def test_the_target_follows_the_course_without_a_jump(shipped):
    """Its phase is the sum of the frequencies: x = A (1 - cos(2 pi sum f dt)), paper Eq. 5."""
    conf, (_, run) = config(), shipped
    dt, amplitude = run.env.control_dt, run.env.without_ranges().amplitude
    freq = courses.frequency_of(courses.staircase((0.8, 1.2), conf.staircase, dt))
    trajectory = trials.following(*shipped, freq, conf)
    phase = 2 * math.pi * dt * np.cumsum(freq)
    assert trajectory.target_x == pytest.approx(np.repeat((amplitude * (1 - np.cos(phase)))[:, None], 2, 1), abs=1e-5)
    assert np.isnan(trajectory.freq).all() and (trajectory.fall_step == -1).all()


def test_a_push_moves_the_stander_forward_and_its_twin_is_the_same_before(shipped):
    """20 N on the trunk for 0.1 s are 2 Ns: the head of the 40 kg body gains less than 2 Ns / 10 kg."""
    conf, (_, run) = config(), shipped
    pushed, twin = trials.pushed_and_twin(*shipped, conf)
    dt = run.env.control_dt
    first = int(trials.push_starts(conf.perturbation, dt)[0])
    end = first + round(0.1 / dt)
    assert np.array_equal(pushed.joint_angle[:first], twin.joint_angle[:first])
    gained = (pushed.head_vx - twin.head_vx)[end - 1]
    assert (gained > 0.01).all() and (gained < 0.2).all()
    assert np.array_equal(trials.pushed_and_twin(*shipped, conf)[0].head_x, pushed.head_x)  # a second trial is the same


def test_the_command_writes_tables_findings_and_a_figure(monkeypatch, tmp_path, capsys):
    call(monkeypatch, "dynamics", "ckpt=pretrained/universal", f"out={tmp_path}", *SMALL)
    assert {path.name for path in tmp_path.iterdir()} == {
        *("staircase.csv", "switches.csv", "fluctuation.csv", "relaxation.csv", "findings.csv"),
        *("dynamics.png", "dynamics.yaml"),
    }
    assert len(table(tmp_path / "staircase.csv")) == 4  # this policy has no noise: two repeats would be the same
    assert len(table(tmp_path / "switches.csv")) == 2
    assert [row["freq_hz"] for row in table(tmp_path / "fluctuation.csv")] == ["0.8", "1", "1.2"]
    assert [row["freq_hz"] for row in table(tmp_path / "relaxation.csv")] == ["0.8", "1.2"]
    printed = capsys.readouterr().out
    assert "hysteresis_short" in printed and "without noise all repeats are the same: one is made" in printed
    # Only what is asked for, also where there was more.
    call(monkeypatch, "dynamics", "ckpt=pretrained/universal", f"out={tmp_path}", "repeats=1", RAMP, "what=ramp")
    assert {path.name for path in tmp_path.iterdir()} == {"switches.csv", "findings.csv", "dynamics.yaml"}
    # Results that are current are left as they are, damaged ones are made again.
    again = ["dynamics", "ckpt=pretrained/universal", f"out={tmp_path}", "repeats=1", RAMP, "what=ramp", "again=false"]
    before = table(tmp_path / "switches.csv")
    call(monkeypatch, *again)
    assert capsys.readouterr().out.endswith(f"made before: {tmp_path}\n")
    (tmp_path / "switches.csv").write_text("")
    call(monkeypatch, *again)
    assert table(tmp_path / "switches.csv") == before


def test_a_full_disk_leaves_the_tables_of_an_earlier_start(monkeypatch, tmp_path):
    (tmp_path / "switches.csv").write_text("earlier")

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("posture.analysis.results.write_rows", full)
    with pytest.raises(SystemExit) as stopped:
        call(monkeypatch, "dynamics", "ckpt=pretrained/universal", f"out={tmp_path}", "repeats=1", RAMP, "what=[ramp]")
    assert stopped.value.code == 1
    assert (tmp_path / "switches.csv").read_text() == "earlier"


def test_targets_too_fast_for_the_control_steps_of_the_policy_are_refused():
    """At 0.1 s a period of six steps is 1 / 0.6 s = 1.667 Hz."""
    for key, value in (
        ("+staircase.courses.fast", "[1,2]"),
        ("ramp.end", "2"),
        ("perturbation.freq.high", "2"),
        ("fluctuation.freq.high", "2"),
    ):
        with pytest.raises(ValueError, match="allowed is at most 1.667 Hz"):
            check_trials(jobs.compose("dynamics", DynamicsConfig, f"{key}={value}"), 0.1)


def test_there_may_be_more_trials_at_once_than_frequencies_in_an_evaluation(shipped):
    conf = config("repeats=501")
    assert trials.opened(*shipped, conf.repeats * [1.0], 1.0, conf)[0].num_envs == 501


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["staircase.courses.platform=[0.5,0.4]"], "platform: frequencies must rise"),
        (["staircase.skip=10"], "skip: 10 leaves nothing of 10 cycles"),
        (["ramp.start=1.4"], "a ramp rises from start to end, got 1.4 and 1.2"),
        (["perturbation.force=0"], "force: 0 N is no push"),
        (["perturbation.time=5"], "time: 5 s leaves no time to recover in 7.3 s"),
        (["evaluation.duration=20"], "fewer than 3 cycles at 0.1 Hz"),
        (["what=[hysteresis]"], "what"),
        (["what=stairs"], "what.0 = 'stairs': must be 'staircase'"),
        (
            ["staircase.courses.own=[0.3,0.5]"],
            "own: no such key; there are platform, head_tracking; +staircase.courses.own=..",
        ),
        (["what=[ramp,ramp]"], "what: ramp appears 2 times"),
        (["what=[ramp]", "staircase.cycles=20"], "staircase.cycles: has no effect without staircase in what"),
        (["ckpt=nowhere"], "nowhere"),
        (["device=tpu"], "device: 'tpu' is not known"),
        (["ckpt=[pretrained,pretrained]"], "several policies of one seed"),
        (["~staircase.courses.platform", "~staircase.courses.head_tracking"], "staircase.courses = {}"),
        # A push of no control step would never end.
        (["perturbation.time=0.005"], "perturbation.time: 0.005 s is less than a control step of 0.0166 s"),
        (["perturbation.every=0.1", "perturbation.time=0.04"], "perturbation.every: 0.1 s leaves no time to recover"),
        (["ramp.rate=1e-12"], "ramp: 2.2e+12 s; allowed is at most 20750 s for 8 trials"),
        (["ramp.rate=10"], "ramp.window: 3.077 s, but each way of the ramp takes 0.11 s"),
        (["repeats=1000", "what=[fluctuation]"], "fluctuation: 100 s; allowed is at most 7.2044 s for 23000 trials"),
        (["staircase.courses.platform=[0.001,0.002]", "staircase.cycles=1000"], "staircase.courses.platform: 3e+06 s"),
    ],
)
def test_bad_input_is_refused_in_one_line(monkeypatch, tmp_path, capsys, overrides, message):
    assert message in refused(monkeypatch, capsys, "dynamics", "ckpt=pretrained", f"out={tmp_path / 'out'}", *overrides)
