"""A session without a browser, against hand arithmetic, Newton's laws, the roll-out of posture.eval and the theory."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from envs.body.joints import BODIES
from envs.body.segments import read_segments
from envs.config import Person
from envs.task.head_tracking import HeadTrackingEnv
from posture.config.errors import ConfigError
from posture.config.play import SETTINGS, PlayConfig
from posture.evaluation.rollout import rollout
from posture.learning.networks import load_policy
from posture.play.environment import PlayEnv, play_config
from posture.play.lqr import ReplanningLqr
from posture.play.policies import policy_choices
from posture.play.session import Session
from posture.storage import checkpoint, run_dir
from posture.theory.lqr import plan
from posture.theory.nonlinear import exact_stander
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition
from tests.conftest import composed
from tests.posture.play.sessions import DT, InlineWorker, advance, compose_play, new_session, policies

MASS_KG, GRAVITY = 40.15, 9.81


@pytest.fixture(scope="module")
def shared(body):
    return new_session(body)


@pytest.fixture
def session(shared):
    """The shared session, upright, with its first policy and settings."""
    shared.choose("pretrained/default")
    shared.set(freq=0.3)
    shared.paused, shared.falls = False, 0
    shared.reset()
    return shared


def test_phase_of_the_target_is_continuous_when_the_frequency_changes(session):
    advance(session, 100 * DT)
    session.set(freq=1.1)
    states = advance(session, 50 * DT)
    expected = 0.1 * (1 - np.cos(2 * np.pi * DT * (0.3 * 100 + 1.1 * np.arange(1, 51))))
    assert np.allclose([state.target for state in states], expected, atol=1e-6)


def test_says_which_settings_the_policy_was_not_trained_on(session):
    assert session.message == ""
    session.set(hip_k=60.0, load=2.0)
    assert session.message == "outside what this policy was trained on: hip stiffness, load"
    choice = session._policies[session.policy]
    ranges = choice.run.env.ranges.model_copy(update={"hip_k": (50.0, 70.0), "amplitude": (0.04, 0.09)})
    wide = replace(choice, run=choice.run.model_copy(update={"env": choice.run.env.model_copy(update={"ranges": ranges})}))
    assert wide.not_trained_on(session.settings) == ["load", "amplitude"]
    session.choose("lqr")
    session.set(hip_k=60.0)
    assert "trained" not in session.message


def test_every_slider_of_the_page_is_within_what_its_first_policy_was_trained_on(body):
    config = composed("play", PlayConfig, ())
    page = Session(config, policy_choices(config.ckpt, config.lqr), body, InlineWorker())
    assert page.policy == "pretrained/universal" and page.message == ""
    for end in (0, 1):
        for name in SETTINGS:
            page.set(**{name: getattr(config.sliders, name)[end]})
        assert page.message == ""
        advance(page, 10.0)
    assert page.falls == 0


def test_same_motion_as_in_the_evaluation(session):
    (model,) = run_dir.find_checkpoints("pretrained")
    run = run_dir.read_config(model.parent)
    env = HeadTrackingEnv(play_config(run.env), 0, "cpu")
    trial = rollout(env, load_policy(checkpoint.load(model, "cpu"), run, model, "cpu"), torch.tensor([0.3]), 8.0)
    states = advance(session, 8.0)
    assert np.allclose([state.head for state in states], trial.head_x[:, 0], atol=1e-3)
    assert np.allclose([state.cop for state in states], trial.cop_x[:, 0], atol=1e-2)
    assert np.ptp(trial.head_x) > 0.1
    cost = np.mean(np.sum((trial.joint_torque[:, 0] / 100.0) ** 2, axis=1))
    assert session.history.last("cost", 10**6).mean() == pytest.approx(cost, rel=0.01)


@pytest.mark.parametrize("load", [0.0, 4.0])
def test_ground_force_equals_the_weight(session, load):
    session.choose("pretrained/universal")  # it was trained with loads
    session.set(load=load)
    states = advance(session, 20.0)[-600:]  # three cycles of 200.8 steps: the vertical acceleration averages out
    weight = np.mean([state.force[:, 2].sum() for state in states])
    assert weight == pytest.approx((MASS_KG + load) * GRAVITY, rel=0.005)
    assert np.allclose([state.force[0] for state in states], [state.force[1] for state in states])


def test_ground_force_acts_at_the_centre_of_pressure_under_the_foot(session):
    heel, toe = session.sole
    for state in advance(session, 5.0):
        foot = state.pose[BODIES.index("foot_left"), 0]
        assert heel - 2e-4 <= state.cop <= toe + 2e-4  # a tilted sole rolls on its round ends
        assert state.point[:, 0] == pytest.approx(foot + state.cop, abs=2e-3)
        assert np.abs(state.point[:, 2]).max() < 2e-3


def test_joint_torque_includes_the_spring_of_the_chosen_stiffness(session):
    advance(session, 3.0)
    sim = session._env.sim
    for hip_k in (50.0, 200.0):
        session.set(hip_k=hip_k)
        session.step()
        angle, velocity = float(sim.joint_angle[0, 0]), float(sim.joint_velocity[0, 0])
        expected = 100.0 * float(session._env.state.action[0, 0]) - 1.0 * velocity - hip_k * angle
        # joint_force belongs to the start of the last substep, half a control step earlier.
        assert float(sim.joint_force[0, 0]) == pytest.approx(expected, abs=1.5)


def test_push_moves_the_head_forward_without_a_fall(session):
    advance(session, 6.0)
    state = session._env.state_dict()
    without = advance(session, 0.2)[-1].head
    session._env.load_state_dict(state)
    session.push()
    # 4 Ns on the trunk alone would give 0.17 m/s, 17 mm in 0.1 s; the whole body is heavier.
    assert 0.003 < advance(session, 0.2)[-1].head - without < 0.017
    advance(session, 5.0)
    assert session.falls == 0


def test_ramp_rises_at_its_rate_and_stops_at_the_end_or_when_asked(session):
    session.ramp(1)
    advance(session, 10.0)
    assert session.settings.freq == pytest.approx(0.3 + 0.036 * DT * round(10.0 / DT), abs=1e-9)
    session.ramp(1)
    freq = session.settings.freq
    advance(session, 1.0)
    assert session.settings.freq == freq and session.ramping == 0
    session.set(freq=0.06)
    session.ramp(-1)
    advance(session, 1.0)
    assert session.settings.freq == 0.05 and session.ramping == 0
    session.ramp(1)
    session.set(freq=0.5)
    assert session.ramping == 0


def test_mode_switches_in_a_ramp(body):
    fast = new_session(body, "ramp_rate=0.1", "freq=0.4")
    advance(fast, 8.0)
    assert fast.measures().mode == "in-phase"
    fast.ramp(1)
    advance(fast, 12.0)
    assert fast.settings.freq == 1.5 and fast.falls == 0
    assert fast.measures().mode == "anti-phase"
    assert {point.direction for point in fast.trail.points} == {0, 1}


def test_pause(session):
    advance(session, 1.0)
    state, time = session.state, session.time
    session.paused = True
    advance(session, 1.0)
    assert session.state is state and session.time == time


def test_after_a_fall_the_stander_lies_then_restarts(body):
    pushed = new_session(body, "push.force=3000", "push.limit=3000")
    advance(pushed, 1.0)
    pushed.push()
    while not pushed.fallen and pushed.time < 10:
        pushed.step()
    assert pushed.fallen and pushed.falls == 1
    lying = pushed.state
    advance(pushed, 1.0)
    assert pushed.state is lying and lying.pose[0, 2] < 1.2
    advance(pushed, 1.5)
    assert not pushed.fallen and pushed.state.pose[0, 2] > 1.2 and len(pushed.history) < 100


@pytest.mark.parametrize(
    ("value", "message"), [({"freq": 3.0}, r"freq = 3: allowed is 0.05..1.5"), ({"load": -1.0}, "load = -1")]
)
def test_setting_out_of_range_is_refused(session, value, message):
    with pytest.raises(ValueError, match=message):
        session.set(**value)


def test_another_policy_continues_from_the_same_pose_with_its_own_body(session):
    advance(session, 5.0)
    before, phase = session._env.sim.state_dict()["q"], session._env.phase
    session.choose("pretrained/hip_k-75")
    assert torch.equal(session._env.sim.state_dict()["q"], before) and session._env.phase == phase
    assert session.settings.hip_k == 75.0 == float(session._env.sim.hip_k) and session.policy == "pretrained/hip_k-75"
    advance(session, 5.0)
    assert session.falls == 0


@pytest.mark.parametrize("first", ["pretrained/default", "pretrained/human"])
def test_every_policy_continues_the_motion_of_one_without_and_one_with_senses(session, first):
    for name in session.policies:
        session.choose(first)
        session.set(freq=0.1)  # slow: hips that become much softer in a fast motion make the stander fall
        session.reset()
        advance(session, 1.0)
        before, phase = session._env.sim.state_dict()["q"], session._env.phase
        session.choose(name)
        assert session.policy == name and torch.equal(session._env.sim.state_dict()["q"], before)
        assert session._env.phase == pytest.approx(phase, abs=1e-9)
        states = advance(session, 1.0)
        assert np.isfinite([state.head for state in states]).all() and np.ptp([state.head for state in states]) > 0.01
    assert session.falls == 0


def session_of(body, *names, **changes):
    """A session with these shipped policies, and with `own`: the last of them in an environment with these changes."""
    config = compose_play()
    by_name = {choice.name: choice for choice in policies(config)}
    choices = [by_name[f"pretrained/{name}"] for name in names]
    own = replace(choices[-1], name="own", env=choices[-1].env.model_copy(update=changes))
    return Session(config, [*choices, own], body, InlineWorker())


def test_senses_begin_with_a_policy_and_go_on_with_one_that_has_the_same(body):
    session = session_of(body, "default", "human")
    advance(session, 1.0)
    session.choose("pretrained/human")
    env = session._env
    senses, values = env._senses, env._exact()
    exact = torch.cat([values[name] for name in senses.sizes], dim=-1)
    past = senses.past.reshape(-1, exact.shape[1])
    assert torch.equal(past, past[:1].expand_as(past))  # nothing was sensed before
    assert ((past[0] - exact[0]).abs() <= 3.47 * sum(senses._deviations) + 1e-6).all()  # the largest noise there is
    assert abs(float(exact[0, 0])) > 0.02  # the stander is not upright
    assert torch.equal(env.episodes.activation, env.episodes.action) and bool(env.episodes.action.any())
    advance(session, 0.5)
    now, past = int(env._senses.now), env._senses.past.clone()
    session.choose("own")
    assert int(session._env._senses.now) == now > 0 and torch.equal(session._env._senses.past, past)


def test_another_policy_has_its_own_physics_and_theory(body):
    session = session_of(body, "default", joint_damping=5.0, torque_limit=60.0)
    session.theory()
    before = session.theory().transition
    session.choose("own")
    assert float(session._env.sim.joint_damping) == 5.0
    assert session.theory() is None  # that of the policy before is not shown
    env = session._env.config
    expected = bound_transition(linearise(body, env), env.amplitude, session.settings.tolerance, (0.05, 1.5))
    assert session.theory().transition == pytest.approx(expected, abs=1e-6) and abs(expected - before) > 0.005


def test_policy_with_another_control_step_starts_upright(body):
    session = session_of(body, "default", control_dt=0.01)
    advance(session, 1.0)
    session.choose("own")
    assert session.dt == 0.01 and len(session.history) == 0 and session._env.phase == 0.0
    assert session.state.pose[0, 2] == pytest.approx(1.286, abs=1e-3)
    advance(session, 1.0)


def test_policy_that_fails_when_it_takes_over_changes_nothing(session, monkeypatch):
    advance(session, 1.0)
    env = session._env
    with monkeypatch.context() as patch, pytest.raises(ZeroDivisionError):
        patch.setattr(PlayEnv, "continue_from", lambda *_: 1 / 0)
        session.choose("pretrained/hip_k-25")
    assert session._env is env and session.policy == "pretrained/default" and session.settings.hip_k == 125.0
    advance(session, 1.0)


def test_policy_that_cannot_be_loaded_changes_nothing(session, monkeypatch):
    def damaged(*_):
        raise ConfigError("not readable")

    advance(session, 1.0)
    monkeypatch.setattr("posture.play.policies.checkpoint.load", damaged)
    with pytest.raises(ConfigError, match="not readable"):
        session.choose("pretrained/hip_k-25")
    assert session.policy == "pretrained/default" and session.settings.hip_k == 125.0
    advance(session, 1.0)


def test_choices_are_all_shipped_policies_and_the_controller():
    config = compose_play()
    names = [choice.name for choice in policy_choices(config.ckpt, config.lqr)]
    assert names[0] == "pretrained/default" and names[-1] == "lqr" and len(set(names)) == len(names) == 23
    assert policy_choices("lqr", config.lqr)[0].name == "lqr"


def test_a_policy_of_another_run_is_refused_before_the_page_opens(tmp_path):
    """The configuration of one shipped policy beside the weights of another, which observes more."""
    one, other = (run_dir.find_checkpoint(f"pretrained/{name}") for name in ("default", "universal"))
    shutil.copy(one.with_name("config.yaml"), tmp_path)
    shutil.copy(other, tmp_path)
    with pytest.raises(ConfigError, match="does not hold this run's policy"):
        policy_choices(str(tmp_path), compose_play().lqr)


def test_lqr_tracks_at_the_least_cost_and_replans_for_another_body(body):
    session = new_session(body, "ckpt=lqr", "freq=0.5")
    advance(session, 15.0)
    measures = session.measures()
    assert session.falls == 0 and measures.error < 0.03
    session.theory()
    assert measures.cost / session.theory().at(0.5) == pytest.approx(1.0, abs=0.2)
    session.set(hip_k=60.0)
    advance(session, 10.0)
    assert session.falls == 0 and session.measures().mode == "anti-phase"


def test_reference_of_the_lqr_converges_to_the_planned_motion(body):
    """Against `posture.theory.lqr.plan`."""
    session = new_session(body, "ckpt=lqr", "freq=0.5")
    config = compose_play("ckpt=lqr", "freq=0.5")
    controller = ReplanningLqr(config.lqr, InlineWorker(), body)
    for _ in range(2):
        controller._update_plan(session._env, session.settings)
    for _ in range(round(10 * config.lqr.fade_in / DT)):
        controller._approach_plan(DT)
    motion = plan(exact_stander(body, play_config(config.lqr.env)), 0.5, 0.1, 0.025, config.lqr)
    for time in (0.0, 0.3, 1.7):
        reference = controller._reference(2 * math.pi * 0.5 * time, 0.5)
        at = np.array([time])
        assert np.allclose(reference[0], motion.angle(at)[0], atol=1e-6)
        assert np.allclose(reference[1], motion.velocity(at)[0], atol=1e-5)
        assert np.allclose(controller._stander.torque(*reference), motion.torque(at)[0], atol=1e-3)


def test_theory_follows_the_settings(session):
    session.theory()
    stiff = session.theory()
    session.set(hip_k=60.0)
    session.theory()
    assert session.theory().transition < stiff.transition  # softer hips switch at a lower frequency (paper Fig. 13)


HEAVY = Person(mass=80.3, height=1.57, sex="male")  # twice the mass of paper Table 1, at its height


def test_another_body_stands_upright_with_its_own_weight_and_joints(session):
    """Twice as heavy as the paper's: twice the stiffness and the torque limit, and so do the sliders of stiffness go."""
    advance(session, 2.0)
    session.set_body(HEAVY)
    assert session.body == HEAVY
    session.step()
    env = session._env.config
    assert (session.settings.hip_k, session.settings.ankle_k, env.torque_limit) == (250.0, 50.0, 200.0)
    assert float(session._env.sim.hip_k) == 250.0 and session.slider("hip_k") == (50.0, 400.0, 5.0)
    assert len(session.history) == 1 and session.state.pose[0, 2] == pytest.approx(0.8140 * 1.57, abs=2e-3)
    assert session.message == "outside what this policy was trained on: body, hip stiffness, ankle stiffness"
    session.set_body(None)
    session.step()
    assert session.settings.hip_k == 125.0 and session._env.config.torque_limit == 100.0 and session.message == ""
    session.choose("lqr")  # it plans for the heavy body; the policy falls in it
    session.set_body(HEAVY)
    weight = np.mean([state.force[:, 2].sum() for state in advance(session, 13.4)[-200:]])  # a cycle of the target
    assert session.falls == 0 and weight == pytest.approx(80.3 * GRAVITY, rel=0.02)
    session.set_body(None)


def test_theory_is_that_of_the_present_body(session):
    session.set_body(HEAVY)
    session.step()
    session.theory()
    env = session.settings.apply_to(session._env.config)
    expected = bound_transition(linearise(read_segments(env), env), env.amplitude, session.settings.tolerance, (0.05, 1.5))
    assert session.theory().transition == pytest.approx(expected, abs=1e-6)


def test_a_body_changes_while_paused_and_another_policy_has_its_own(session):
    session.paused = True
    session.set_body(HEAVY)
    session.step()
    assert session.settings.body == HEAVY and session.state.pose[0, 2] == pytest.approx(0.8140 * 1.57, abs=1e-3)
    session.choose("pretrained/hip_k-75")
    assert session.body is None and session.settings.hip_k == 75.0
    assert session.state.pose[0, 2] == pytest.approx(1.286, abs=1e-3)


def test_body_at_the_start(body):
    given = ("body.mass=80.3", "body.height=1.57", "body.sex=male")
    session = new_session(body, *given, "hip_k=300")
    assert (session.body, session.settings.hip_k, session.settings.ankle_k) == (HEAVY, 300.0, 50.0)
    with pytest.raises(ConfigError, match="^body.height: missing; the policy was trained with the paper's body"):
        new_session(body, "body.mass=70")


def test_body_whose_scaled_joints_are_not_allowed_is_refused_and_the_session_continues(body):
    session = new_session(body, "ckpt=lqr", "lqr.env.ankle_k=200")
    with pytest.raises(ConfigError, match="^joints scaled to this body: ankle_k = 8.*must be less than or equal to 400$"):
        session.set_body(HEAVY.model_copy(update={"mass": 161.0}))
    assert session.body is None
    advance(session, 1.0)
    with pytest.raises(ConfigError, match="^joints scaled to this body: ankle_k"):
        new_session(body, "ckpt=lqr", "lqr.env.ankle_k=200", "body.mass=120", "body.height=1.8", "body.sex=male")


def test_lqr_balances_another_body(body):
    session = new_session(body, "ckpt=lqr", "freq=0.5", "body.mass=60", "body.height=1.65", "body.sex=female")
    advance(session, 15.0)
    session.theory()
    assert session.falls == 0
    assert session.measures().cost / session.theory().at(0.5) == pytest.approx(1.0, abs=0.2)
