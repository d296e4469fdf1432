"""The target against paper Eq. 5, its derivatives, and the statistics of drawn frequencies and lengths."""

import math

import pytest
import torch
import warp as wp
from hypothesis import assume, given
from hypothesis import strategies as st

from envs.config import Ramp
from envs.engines.factory import simulate
from envs.task.episodes import Episodes
from envs.task.target import Course, motion, uniform


@wp.kernel(enable_backward=False)
def move(times: wp.array[wp.float64], course: Course, out: wp.array2d[float]) -> None:
    i = wp.tid()
    now = motion(course, times[i])
    out[i, 0] = now.position
    out[i, 1] = now.velocity
    out[i, 2] = now.acceleration
    out[i, 3] = now.frequency


@wp.kernel(enable_backward=False)
def draw_numbers(
    seed: wp.uint64, worlds: wp.array[wp.int64], episode: wp.array[wp.int64], out: wp.array[wp.float64]
) -> None:
    i = wp.tid()
    out[i] = uniform(seed, wp.uint64(worlds[i]), wp.uint64(episode[i]))


def at(times, freq, rate=0.0, duration=0.0, offset=0.0, amplitude=0.1):
    """Position, velocity, acceleration and frequency at each of `times`, (4, N) float64."""
    wp.init()
    course = Course()
    course.freq, course.rate, course.duration = freq, rate, duration
    course.offset, course.amplitude = offset, amplitude
    out = torch.zeros(len(times), 4)
    place = wp.from_torch(torch.tensor(times, dtype=torch.float64))
    wp.launch(move, dim=len(times), inputs=[place, course], outputs=[wp.from_torch(out)])
    return out.double().T


def numbers(seed, worlds, episode):
    wp.init()
    out = torch.zeros(len(worlds), dtype=torch.float64)
    wp.launch(
        draw_numbers,
        dim=len(worlds),
        inputs=[seed, wp.from_torch(worlds), wp.from_torch(episode)],
        outputs=[wp.from_torch(out)],
    )
    return out


def test_fixed_frequency_is_equation_5():
    times = [0.0, 0.3, 1.7]
    expected = [-0.1 * math.cos(2 * math.pi * 1.2 * time) + 0.1 for time in times]
    assert at(times, 1.2)[0].tolist() == pytest.approx(expected, abs=2e-8)


def test_starts_at_rest_and_reaches_twice_the_amplitude():
    position, velocity, acceleration, _ = at([0.0, 1.0], 0.5)  # half a period of 2 s
    assert float(position[0]) == float(velocity[0]) == 0.0
    assert float(position[1]) == pytest.approx(0.2)
    assert acceleration.tolist() == pytest.approx([0.1 * math.pi**2, -0.1 * math.pi**2])


def test_offset_shifts_the_phase():
    assert at([0.0], 1.2, offset=math.pi / 2)[0].tolist() == pytest.approx([0.1])


@given(st.floats(0.0, 40.0), st.floats(0.0, 2.0), st.floats(-0.02, 0.1), st.floats(0.1, 30.0))
def test_derivatives(time, freq, rate, duration):
    """Velocity is the slope of the position, acceleration that of the velocity, by central differences."""
    h = 1e-3
    assume(abs(time - duration) >= 2 * h)  # the ramp's end is a kink
    position, velocity, acceleration, frequency = at([time - h, time, time + h], freq, rate, duration)
    speed = 2 * math.pi * (abs(float(frequency[1])) + 0.1)
    for of, slope, order in ((position, velocity, 3), (velocity, acceleration, 4)):
        # The third derivative bounds the error of the difference, beside rounding to single precision.
        allowed = 0.1 * speed**order * h**2 + 2e-7 * 0.2 * speed ** (order - 3) / h
        assert float((of[2] - of[0]) / (2 * h)) == pytest.approx(float(slope[1]), abs=allowed)


def test_ramp_of_experiment_4a():
    """0.036 Hz/s for 25 s from 0: 0.45 Hz half way, 0.9 Hz at the end and after; phase pi 0.036 25^2 there."""
    position, _, _, frequency = at([12.5, 25.0, 26.0, 40.0], 0.0, 0.036, 25.0)
    assert frequency.tolist() == pytest.approx([0.45, 0.9, 0.9, 0.9])
    end = math.pi * 0.036 * 25**2
    expected = [0.1 * (1 - math.cos(phase)) for phase in (end, end + 2 * math.pi * 0.9)]
    assert position[1:3].tolist() == pytest.approx(expected, abs=2e-8)


@pytest.fixture
def episodes(env_config):
    """Episodes of `worlds` worlds; only what is drawn matters here."""

    def make(*overrides, worlds=1000, of=None, seed=3):
        config = env_config(f"env.num_envs={of or worlds}", "env.termination.head_tolerance=null", *overrides)
        return Episodes(config, simulate(config, worlds, "cpu"), torch.arange(worlds), seed)

    return make


def draws(episodes, count=50):
    """Frequencies of the first episodes, (count, N)."""
    found = []
    for _ in range(count):
        found.append(episodes.freq.clone())
        episodes.begin(torch.ones(len(episodes.freq), dtype=torch.bool))
    return torch.stack(found)


@pytest.mark.parametrize("draw", ["uniform", "stratified"])
def test_drawn_frequencies_are_uniform(episodes, draw):
    found = draws(episodes("env.freq=[0.015,1.5]", f"env.freq_draw={draw}")).flatten()
    assert float(found.min()) >= 0.015 and float(found.max()) < 1.5
    # 50,000 draws: the standard error of the mean is 0.0019, of a decile's share 0.0013.
    assert float(found.mean()) == pytest.approx(0.7575, abs=0.008)
    assert float(found.std()) == pytest.approx(1.485 / math.sqrt(12), abs=0.006)
    shares = torch.histc(found, 10, 0.015, 1.5) / len(found)
    assert shares.tolist() == pytest.approx([0.1] * 10, abs=0.006)


def test_stratified_keeps_each_world_in_its_part(episodes):
    found = draws(episodes("env.freq=[0.015,1.5]", "env.freq_draw=stratified", worlds=10))
    part = 1.485 / 10
    for world in range(10):
        low = 0.015 + world * part
        assert low - 1e-6 <= float(found[:, world].min()) and float(found[:, world].max()) <= low + part + 1e-6
        assert float(found[:, world].max() - found[:, world].min()) > 0.5 * part  # and moves about in it


def test_draws_do_not_depend_on_the_number_of_worlds(episodes):
    many, few = (draws(episodes("env.freq_draw=uniform", "env.freq=[0.1,1.5]", worlds=n)) for n in (64, 8))
    assert torch.equal(many[:, :8], few)


def test_a_new_seed_draws_as_new_worlds_with_it(episodes):
    options = ("env.freq=[0.1,1.5]", "env.episode_steps=[3,900]")
    used, new = episodes(*options, worlds=8, seed=1), episodes(*options, worlds=8, seed=2)
    draws(used, 3)
    assert not torch.equal(used.freq, new.freq)
    used.reseed(2)
    used.begin(torch.ones(8, dtype=torch.bool))
    assert torch.equal(used.freq, new.freq) and torch.equal(used.length, new.length)


def test_seeds_worlds_and_episodes_draw_independently():
    worlds, episode = torch.arange(20_000), torch.zeros(20_000, dtype=torch.long)
    a, b, c = (numbers(s, worlds, e) for s, e in ((1, episode), (2, episode), (1, episode + 1)))
    for other in (b, c, a.roll(1)):
        assert abs(float(torch.corrcoef(torch.stack((a, other)))[0, 1])) < 0.03  # standard error 0.007


def test_numbers_of_splitmix64():
    """With seed, world and episode 0 the mixing function is applied thrice to 0, in Python's exact integers."""

    def mix(x):
        x = (x + 0x9E3779B97F4A7C15) % 2**64
        x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        x = (x ^ (x >> 27)) * 0x94D049BB133111EB % 2**64
        return x ^ (x >> 31)

    assert mix(0) == 0xE220A8397B1DCDAF  # the first number of the generator with seed 0, as published
    for seed, world, episode in ((0, 0, 0), (7, 5, 1), (2**64 - 2, 4095, 1000)):
        expected = (mix(mix((mix(seed) + world) % 2**64) + episode) >> 11) / 2**53
        assert numbers(seed, torch.tensor([world]), torch.tensor([episode])).tolist() == [expected]


def test_fixed_frequency_and_ramp(episodes):
    assert episodes("env.freq=1.2", worlds=4).freq.tolist() == [1.2] * 4
    ramp = Ramp(start=0.1, rate=0.036, duration=25.0)
    found = episodes(f"env.ramp={{start: {ramp.start}, rate: {ramp.rate}, duration: {ramp.duration}}}", worlds=4)
    found.step.fill_(1000)
    found.restore()
    now = ramp.start + ramp.rate * 1000 * 0.0166
    assert found.freq.tolist() == [0.1] * 4 and found.target_freq.tolist() == pytest.approx([now] * 4)
    found.follow(torch.tensor([0.2, 0.4, 0.6, 0.8]))
    found.begin(torch.ones(4, dtype=torch.bool))
    found.step.fill_(1000)
    found.restore()
    assert found.target_freq.tolist() == pytest.approx([0.2, 0.4, 0.6, 0.8])


def test_the_phase_does_not_jump_when_the_target_changes(episodes):
    """1.2 Hz for 60 steps, then 0.3 Hz for 30: the phase is 2 pi (1.2 x 60 + 0.3 x 30) dt."""
    found = episodes("env.freq=1.2", worlds=2)
    for _ in range(60):
        found.advance()
    before = found.target_x.clone()
    found.retarget(torch.tensor([0.3, 1.2], dtype=torch.float64), torch.tensor([0.1, 0.05], dtype=torch.float64))
    found.restore()
    assert found.target_x.tolist() == pytest.approx((before * torch.tensor([1.0, 0.5])).tolist(), abs=1e-7)
    for _ in range(30):
        found.advance()
    phase = 2 * math.pi * (1.2 * 60 + 0.3 * 30) * 0.0166
    assert float(found.phase[0]) == pytest.approx(phase)
    assert float(found.target_x[0]) == pytest.approx(0.1 * (1 - math.cos(phase)), abs=1e-7)
    found.begin(torch.tensor([True, True]))
    assert found.phase.tolist() == [0.0, 0.0] and found.freq.tolist() == [0.3, 1.2]


def test_drawn_lengths_are_uniform_and_not_the_frequencies(episodes):
    found = episodes("env.episode_steps=[2000,8000]", "env.freq=[0.1,1.1]", "env.freq_draw=uniform", worlds=20_000, seed=1)
    lengths = found.length
    assert int(lengths.min()) >= 2000 and int(lengths.max()) <= 8000
    assert float(lengths.double().mean()) == pytest.approx(5000, abs=50)  # standard error 12
    assert abs(float(torch.corrcoef(torch.stack((lengths.double(), found.freq)))[0, 1])) < 0.03
    assert episodes("env.episode_steps=7", worlds=30).length.unique().tolist() == [7]
    assert set(episodes("env.episode_steps=[1,3]", worlds=200).length.tolist()) == {1, 2, 3}
