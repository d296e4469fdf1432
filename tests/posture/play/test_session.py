"""The session without a browser, against hand arithmetic, Newton's laws, the roll-out of posture.eval and the theory."""

import math

import numpy as np
import pytest
import torch

from envs.body.joints import BODIES
from envs.task.head_tracking import HeadTrackingEnv
from posture.evaluation.rollout import rollout
from posture.learning.networks import load_policy
from posture.play.history import History
from posture.play.measures import Trail, measure
from posture.play.pilot import candidates
from posture.play.planned import Planned
from posture.play.steered import steered_config
from posture.play.theory import Asked, least
from posture.storage import checkpoint, run_dir
from posture.theory.lqr import plan
from posture.theory.motion import joint_arrays
from posture.theory.optimum import bound
from posture.theory.stander import linearise
from posture.theory.transition import hip_ankle_correlation
from tests.posture.play.playing import Inline, compose_play, session, walk

MASS_KG, GRAVITY = 40.15, 9.81
DT = 0.0166


@pytest.fixture(scope="module")
def standing(body):
    """One session for all tests that begin with a reset."""
    return session(body)


@pytest.fixture
def fresh(standing):
    """The shared session, upright, with its knobs as at first."""
    standing.choose("pretrained/default")
    standing.set(freq=0.3)
    standing.paused, standing.falls = False, 0
    standing.reset()
    return standing


def test_the_target_keeps_its_phase_when_the_frequency_changes(fresh):
    walk(fresh, 100 * DT)
    fresh.set(freq=1.1)
    states = walk(fresh, 50 * DT)
    steps = np.arange(1, 51)
    expected = 0.1 * (1 - np.cos(2 * np.pi * DT * (0.3 * 100 + 1.1 * steps)))
    assert np.allclose([state.target for state in states], expected, atol=1e-6)


def test_it_moves_as_the_evaluation_does(fresh):
    (model,) = run_dir.find_checkpoints("pretrained")
    run = run_dir.read_config(model.parent)
    env = HeadTrackingEnv(steered_config(run.env), 0, "cpu")
    trial = rollout(env, load_policy(checkpoint.load(model, "cpu"), run, model, "cpu"), torch.tensor([0.3]), 8.0)
    states = walk(fresh, 8.0)
    assert np.allclose([state.head for state in states], trial.head_x[:, 0], atol=1e-3)
    assert np.allclose([state.cop for state in states], trial.cop_x[:, 0], atol=1e-2)
    assert np.ptp(trial.head_x) > 0.1
    assert fresh.history.last("cost", 10**6).mean() == pytest.approx(
        float(np.mean(np.sum((trial.joint_torque[:, 0] / 100.0) ** 2, axis=1))), rel=0.01
    )


@pytest.mark.parametrize("load", [0.0, 4.0])
def test_the_ground_carries_the_body_and_its_load(fresh, load):
    fresh.set(load=load)
    states = walk(fresh, 20.0)[-600:]  # three cycles of 200.8 steps: the vertical acceleration averages out
    weight = np.mean([state.force[:, 2].sum() for state in states])
    assert weight == pytest.approx((MASS_KG + load) * GRAVITY, rel=0.005)
    assert np.allclose([state.force[0] for state in states], [state.force[1] for state in states])


def test_forces_act_under_the_feet(fresh):
    heel, toe = fresh.sole
    for state in walk(fresh, 5.0):
        foot = state.pose[BODIES.index("foot_left"), 0]
        assert heel - 2e-4 <= state.cop <= toe + 2e-4  # a tilted sole rolls on its round ends
        assert state.at[:, 0] == pytest.approx(foot + state.cop, abs=2e-3)
        assert np.abs(state.at[:, 2]).max() < 2e-3


def test_stiffer_hips_need_another_torque(fresh):
    """Springs act in the simulation: held at an angle, the spring's moment is k times it."""
    walk(fresh, 3.0)
    sim = fresh._env.sim
    for hip_k in (50.0, 200.0):
        fresh.set(hip_k=hip_k)
        fresh.step()
        angle = float(sim.joint_angle[0, 0])
        own = 100.0 * float(fresh._env.action[0, 0]) - 1.0 * float(sim.joint_velocity[0, 0]) - hip_k * angle
        # joint_force is of the last substep's beginning, half a control step ago.
        assert float(sim.joint_force[0, 0]) == pytest.approx(own, abs=1.5)


def test_a_push_gives_the_impulse_it_says(fresh):
    fresh.set(load=3.0)
    walk(fresh, 4.0)
    env = fresh._env
    masses = torch.tensor(_masses())
    masses[0] += 3.0

    def momentum():
        return float((masses * env.sim.body_velocity[0, :, 0]).sum())

    before = momentum()
    fresh._pusher.push(env, 5.0)
    assert momentum() - before == pytest.approx(5.0, rel=1e-3)


def _masses():
    import mujoco

    from envs.body.model import MJCF

    model = mujoco.MjModel.from_xml_path(str(MJCF))
    return [float(model.body(name).mass[0]) for name in BODIES]


def test_a_push_moves_the_head_forward_and_is_withstood(fresh):
    walk(fresh, 6.0)
    kept = fresh._env.state_dict(), fresh._env.phase
    alone = walk(fresh, 0.2)[-1].head
    fresh._env.load_state_dict(kept[0])
    fresh._env.phase = kept[1]
    fresh.push()
    # 4 Ns on the HAT alone would be 0.17 m/s, 17 mm in 0.1 s; the whole body is heavier.
    assert 0.003 < walk(fresh, 0.2)[-1].head - alone < 0.017
    walk(fresh, 5.0)
    assert fresh.falls == 0


def test_a_ramp_rises_by_its_rate_stops_at_the_end_and_can_be_held(fresh):
    fresh.ramp(1)
    walk(fresh, 10.0)
    assert fresh.knobs.freq == pytest.approx(0.3 + 0.036 * DT * round(10.0 / DT), abs=1e-9)
    fresh.ramp(1)
    held = fresh.knobs.freq
    walk(fresh, 1.0)
    assert fresh.knobs.freq == held and fresh.ramping == 0
    fresh.set(freq=0.06)
    fresh.ramp(-1)
    walk(fresh, 1.0)
    assert fresh.knobs.freq == 0.05 and fresh.ramping == 0
    fresh.ramp(1)
    fresh.set(freq=0.5)
    assert fresh.ramping == 0


def test_the_mode_switches_in_a_ramp(body):
    swift = session(body, "ramp_rate=0.1", "freq=0.4")
    walk(swift, 8.0)
    assert swift.measures().mode == "in-phase"
    swift.ramp(1)
    walk(swift, 12.0)
    assert swift.knobs.freq == 1.5 and swift.falls == 0
    assert swift.measures().mode == "anti-phase"
    ways = {way for _, _, way in swift.trail.points}
    assert ways == {0, 1}


def test_paused_nothing_moves(fresh):
    walk(fresh, 1.0)
    state, time = fresh.state, fresh.time
    fresh.paused = True
    walk(fresh, 1.0)
    assert fresh.state is state and fresh.time == time


def test_a_fall_is_shown_and_then_it_stands_again(body):
    weak = session(body, "push.force=3000", "push.limit=3000")
    walk(weak, 1.0)
    weak.push()
    while not weak.fallen and weak.time < 10:
        weak.step()
    assert weak.fallen and weak.falls == 1
    lying = weak.state
    walk(weak, 1.0)
    assert weak.state is lying and lying.pose[0, 2] < 1.2
    walk(weak, 1.5)
    assert not weak.fallen and weak.state.pose[0, 2] > 1.2 and len(weak.history) < 100


def test_knobs_beyond_their_range_are_refused(fresh):
    with pytest.raises(ValueError, match=r"freq = 3: allowed is 0.05..1.5"):
        fresh.set(freq=3.0)
    with pytest.raises(ValueError, match="load = -1"):
        fresh.set(load=-1.0)


def test_another_policy_goes_on_from_the_same_pose_in_the_body_it_was_trained_in(fresh):
    walk(fresh, 5.0)
    before, phase = fresh._env.sim.state_dict()["q"], fresh._env.phase
    fresh.choose("pretrained/hip_k-75")
    assert torch.equal(fresh._env.sim.state_dict()["q"], before) and fresh._env.phase == phase
    assert fresh.knobs.hip_k == 75.0 and float(fresh._env.sim.hip_k) == 75.0 and fresh.pilot == "pretrained/hip_k-75"
    walk(fresh, 5.0)
    assert fresh.falls == 0


def test_a_policy_that_cannot_be_loaded_changes_nothing(fresh, monkeypatch):
    from posture.config.errors import ConfigError

    def damaged(*_):
        raise ConfigError("not readable")

    walk(fresh, 1.0)
    monkeypatch.setattr("posture.play.pilot.checkpoint.load", damaged)
    with pytest.raises(ConfigError, match="not readable"):
        fresh.choose("pretrained/hip_k-25")
    assert fresh.pilot == "pretrained/default" and fresh.knobs.hip_k == 125.0
    walk(fresh, 1.0)


def test_every_shipped_policy_and_the_controller_can_be_chosen():
    config = compose_play()
    names = [candidate.name for candidate in candidates(config.ckpt, config.lqr)]
    assert names[0] == "pretrained/default" and names[-1] == "lqr" and len(set(names)) == len(names) == 19
    assert [c.name for c in candidates("lqr", config.lqr)][0] == "lqr"


def test_the_model_based_controller_follows(body):
    steady = session(body, "ckpt=lqr", "freq=0.5")
    walk(steady, 15.0)
    found = steady.measures()
    assert steady.falls == 0 and found.error < 0.03
    steady.theory()
    theory = steady.theory()
    assert found.cost / theory.at(0.5) == pytest.approx(1.0, abs=0.2)
    steady.set(hip_k=60.0)
    walk(steady, 10.0)
    assert steady.falls == 0 and steady.measures().mode == "anti-phase"


def test_the_controllers_reference_is_the_planned_motion(body):
    """Once settled, against posture.lqr and posture.motion."""
    config = compose_play("ckpt=lqr", "freq=0.5")
    env = steered_config(config.lqr.env)
    steady = session(body, "ckpt=lqr", "freq=0.5")
    pilot = Planned(config.lqr, Inline(), body)
    pilot._know(steady._env, steady.knobs)
    pilot._know(steady._env, steady.knobs)
    for _ in range(round(10 * config.lqr.fade_in / DT)):
        pilot._approach(DT)
    motion = plan(linearise(body, env), 0.5, 0.1, 0.025, config.lqr)
    for time in (0.0, 0.3, 1.7):
        reference = pilot._reference(2 * math.pi * 0.5 * time, 0.5)
        at = np.array([time])
        assert np.allclose(reference[0], motion.angle(at)[0], atol=1e-6)
        assert np.allclose(reference[1], motion.velocity(at)[0], atol=1e-5)
        assert np.allclose(pilot._torque(*reference), motion.torque(at)[0], atol=1e-3)


def test_least_cost_is_that_of_the_bound_and_the_mode_changes_at_the_transition(body, config):
    freqs = np.linspace(0.05, 1.5, 16)
    found = least(body, config, 0.025, freqs)
    stander = linearise(body, config)
    for freq in (0.1, 0.62, 1.33):
        motion = bound(stander, freq, 0.1, 0.025)
        exact = float(np.mean(np.sum((joint_arrays(motion)[0] / 100.0) ** 2, axis=1)))
        assert found.at(freq) == pytest.approx(exact, rel=0.01)
    for side in (-0.01, 0.01):
        assert hip_ankle_correlation(bound(stander, found.transition + side, 0.1, 0.025)) * side < 0


def test_least_cost_is_nan_where_nothing_keeps_the_foot_flat(body, env_config):
    found = least(body, env_config("env.amplitude=0.6"), 0.025, np.array([0.1, 1.5]))
    assert math.isnan(found.at(1.5))


def test_theory_answers_to_the_sliders(fresh):
    fresh.theory()
    here = fresh.theory()
    fresh.set(hip_k=60.0)
    fresh.theory()
    there = fresh.theory()
    assert there is not None and there.transition < here.transition  # soft hips switch earlier (paper Fig. 13)


def test_of_questions_the_last_is_answered():
    class Slow(Inline):
        held = ()

        def submit(self, function, *arguments):
            from concurrent.futures import Future

            future = Future()
            self.held += ((future, function, arguments),)
            return future

    office = Slow()
    asked = Asked(office, lambda x: 2 * x)
    assert not asked.about(1, 1) and not asked.about(2, 2) and not asked.about(3, 3)
    assert len(office.held) == 1, "one at a time"
    future, function, arguments = office.held[0]
    future.set_result(function(*arguments))
    assert not asked.about(3, 3) and asked.answer == 2
    future, function, arguments = office.held[1]
    future.set_result(function(*arguments))
    assert asked.about(3, 3) and asked.answer == 6


# -- measures ---------------------------------------------------------------------------------------------------------


def filled(freq, sign, steps=2000):
    history = History(1500)
    for i in range(steps):
        angle = 2 * math.pi * freq * i * DT
        history.append(i * DT, freq, 0.1 * math.sin(angle), sign * 0.05 * math.sin(angle), 0.0, 0.03 * (i % 2), 0.01, 0.5)
    return history


@pytest.mark.parametrize(("sign", "mode"), [(1, "in-phase"), (-1, "anti-phase")])
def test_measures_by_hand(sign, mode):
    found = measure(filled(1.0, sign), DT, 300, 0.01, 0.02)
    assert found.r == pytest.approx(sign) and found.mode == mode
    assert found.cost == 0.5 and found.freq == pytest.approx(1.0) and found.window == pytest.approx(300 * DT)
    assert found.error == pytest.approx(0.03 / math.sqrt(2)) and found.beyond == 0.5


def test_the_cost_is_over_whole_cycles():
    """At 0.3 Hz the window of 300 steps holds a cycle and a half: 1 + sin is 1 over a cycle, 1.6 over half of one."""
    history = History(1500)
    for i in range(1000):
        angle = 2 * math.pi * 0.3 * i * DT
        history.append(i * DT, 0.3, math.sin(angle), math.sin(angle), 0.0, 0.0, 0.01, 1 + math.sin(angle))
        if i >= 300:
            assert measure(history, DT, 300, 0.01, 0.02).cost == pytest.approx(1.0, abs=0.01)


def test_a_slow_target_is_measured_over_its_cycle():
    assert measure(filled(0.1, 1), DT, 300, 0.01, 0.02).window == pytest.approx(10.0, abs=DT)


def test_no_mode_before_the_window_is_full_or_where_a_joint_is_still():
    assert measure(filled(1.0, 1, steps=299), DT, 300, 0.01, 0.02).mode == "undefined"
    assert measure(filled(1.0, 1), DT, 300, 0.2, 0.02).mode == "undefined"
    assert measure(History(10), DT, 300, 0.01, 0.02).mode == "undefined"
    trail = Trail()
    trail.add(measure(History(10), DT, 300, 0.01, 0.02), 1)
    assert not trail.points


def test_the_history_is_what_a_list_would_be():
    history, kept = History(7), []
    for i in range(40):
        history.append(*(float(i + k) for k in range(8)))
        kept.append(float(i))
        assert history.last("time", 5).tolist() == kept[-5:]
        assert history.last("time", 100).tolist() == kept[-7:]
