"""Verdicts on results with a known answer: the paper's own numbers, and single changes to them."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posture.analysis.results import RampTransitions, Result
from posture.reproduce.claims.evaluate import verdicts
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.rules import Outcome
from posture.reproduce.claims.stiffness import map_grid, map_modes
from posture.reproduce.claims.verdict import Verdict
from tests.posture.reproduce.examples import (
    FREQS,
    PAPER,
    REPORT,
    TEN,
    TRANSITIONS,
    changed,
    fallen,
    flipped,
    frequency_result,
    paper_results,
    result,
    with_r,
)

Results = list[Result]
EXAMPLE = paper_results()


def judge(**results: Results) -> dict[str, Verdict]:
    return {verdict.key: verdict for verdict in verdicts(results, PAPER, TRANSITIONS, REPORT)}


def test_the_papers_own_results_reproduce_every_claim() -> None:
    claims = judge(**EXAMPLE)
    experiments = ["Exp. 1"] * 7 + ["Exp. 2"] * 3 + ["Exp. 3"] * 3 + ["Exp. 4a", "Exp. 4b"] + ["Fig. 13"] * 3 + ["Amplitude"]
    assert [claim.experiment for claim in claims.values()] == experiments
    for claim in claims.values():
        assert claim.verdict is Outcome.REPRODUCED, claim.key
        assert claim.claim and claim.published and claim.rule and "3 seeds; no falls" in claim.measured
        assert claim.comment == ""


def test_without_results_no_claim_is_measured() -> None:
    for claim in judge().values():
        assert (claim.verdict, claim.measured, claim.comment) == (Outcome.NOT_MEASURED, "no results", "")
    claims = judge(**EXAMPLE | {"energy": []})
    missing = {key for key, claim in claims.items() if claim.verdict is Outcome.NOT_MEASURED}
    assert missing == {"energy_modes", "energy_phase", "energy_energy"}


def at(hz: float) -> Callable[[Result], bool]:
    return lambda trial: math.isclose(trial.freq_hz, hz)


def stiff(k: float, hz: float | None = None) -> Callable[[Result], bool]:
    return lambda trial: trial.hip_k_nm_per_rad == k and (hz is None or math.isclose(trial.freq_hz, hz))


def gamma(weight: float) -> Callable[[Result], bool]:
    return lambda trial: trial.origin.energy_weight == weight


FREQUENCY, ENERGY, STIFFNESS, RAMP, LOAD = (EXAMPLE[n] for n in ("frequency", "energy", "hip_stiffness", "ramp", "load"))
NO_RAMP_TRANSITION = RampTransitions(math.nan, math.nan, math.nan, math.nan)
MOST_FELL = {
    name: [fallen(trial) if where(trial) and trial.origin.seed > 1 else trial for trial in EXAMPLE[name]]
    for name, where in {"frequency": at(1.35), "energy": gamma(40), "load": lambda t: t.load_kg == 4}.items()
}


@pytest.mark.parametrize(
    ("key", "results", "outcome", "measured"),
    [
        # Modes by pattern: all ten, 8 of 10, 7 of 10.
        ("frequency_modes", changed(FREQUENCY, flipped, at(0.3)), "partly", "9 of 10 conditions, not at 0.3 Hz"),
        ("frequency_modes", changed(FREQUENCY, flipped, lambda t: t.freq_hz <= 0.3), "partly", "8 of 10"),
        ("frequency_modes", changed(FREQUENCY, flipped, lambda t: t.freq_hz <= 0.45), "not", "7 of 10"),
        ("frequency_modes", MOST_FELL["frequency"], "partly", "not at 1.35 Hz (no mode)"),
        # Seven of the nine conditions of paper Table 4 are in-phase: one mode throughout agrees with these.
        ("energy_modes", changed(ENERGY, with_r(0.9)), "not", "7 of 9"),
        ("energy_modes", [t for t in ENERGY if t.origin.energy_weight <= 20], "not measured", "results in 5 of 9"),
        ("energy_modes", [t for t in ENERGY if t.origin.energy_weight <= 35], "partly", "no value at gamma 40"),
        ("energy_phase", [t for t in ENERGY if t.origin.energy_weight <= 20], "not measured", "5 of 9"),
        # One switch from in-phase to anti-phase: back at 1.5 Hz, one mode throughout, the other way.
        ("frequency_switch", changed(FREQUENCY, with_r(0.5), at(1.5)), "not", "sign: seed 1 2, seed 2 2, seed 3 2;"),
        (
            "frequency_switch",
            changed(FREQUENCY, with_r(0.5), lambda t: at(1.5)(t) and t.origin.seed == 2),
            "partly",
            "changes of sign: seed 2 2;",
        ),
        ("frequency_switch", [frequency_result(hz, 1, 9.0) for hz in TEN], "not", "changes of sign: seed 1 0"),
        ("frequency_switch", [frequency_result(hz, 1, -9.0) for hz in TEN], "not", "changes of sign: seed 1 0"),
        ("frequency_switch", changed(FREQUENCY, flipped), "not", "0 of 3 seeds"),
        # Tracking: no dip, a dip from 1.2 Hz only; claims on each frequency need all of them.
        ("frequency_tracking", changed(FREQUENCY, lambda t: replace(t, target_head_r=0.99)), "not", "0.9900"),
        (
            "frequency_tracking",
            changed(FREQUENCY, lambda t: replace(t, target_head_r={0.15: 0.95, 1.2: 0.99}.get(t.freq_hz, 0.98))),
            "partly",
            "at 1.2 Hz 0.9900",
        ),
        ("frequency_tracking", [t for t in FREQUENCY if not at(1.35)(t)], "not measured", "no results at 1.35 Hz"),
        ("frequency_tracking", MOST_FELL["frequency"], "not", "most seeds have no value at 1.35 Hz"),
        ("frequency_ankle", [t for t in FREQUENCY if not at(1.35)(t)], "not measured", "no results at 1.35 Hz"),
        ("frequency_ankle", MOST_FELL["frequency"], "not", "most seeds have no value at 1.35 Hz"),
        # An ankle that moves like the hip; one that moves as far but always the same.
        (
            "frequency_ankle",
            changed(FREQUENCY, lambda t: replace(t, ankle_range_deg=t.hip_range_deg)),
            "not",
            "at most 100% of the hip's",
        ),
        ("frequency_ankle", changed(FREQUENCY, lambda t: replace(t, ankle_range_deg=30.0)), "partly", "by 0.0 deg"),
        # The paper's ranks 9 8 6 4 1 7 2 5 3 against 1 .. 9: rho = 1 - 6 x 196 / 720 = -0.633.
        ("energy_energy", ENERGY, "reproduced", "rho = -0.63; the head follows"),
        (
            "energy_energy",
            changed(ENERGY, lambda t: replace(t, target_head_r=0.9), gamma(40)),
            "partly",
            "the head does not follow at gamma 40",
        ),
        ("energy_energy", [t for t in ENERGY if not gamma(40)(t)], "not", "does not follow at gamma 40"),
        ("energy_energy", MOST_FELL["energy"], "partly", "does not follow at gamma 40"),
        # Load: falls without a change of sign, the ends only, most seeds fell with the heaviest load, rises.
        (
            "load_modes",
            changed(LOAD, lambda t: with_r(0.8 - 0.1 * t.load_kg)(t)),
            "partly",
            "rho = -1.00; from 0.80 at 0 kg to 0.40 at 4 kg",
        ),
        ("load_modes", [t for t in LOAD if t.load_kg in (0, 4)], "not measured", "results in 2 of 9"),
        ("load_modes", MOST_FELL["load"], "partly", "-0.70 at 4 kg (most seeds fell)"),
        ("load_modes", changed(LOAD, lambda t: with_r(0.5 + 0.1 * t.load_kg)(t)), "not", "rho = +1.00"),
        # The map between soft and stiff: a mixed order, one mode, the other way round.
        (
            "map_between",
            changed(STIFFNESS, with_r(0.5), stiff(75, 0.4)),
            "partly",
            "at 75 Nm/rad in-phase at 6, anti-phase at 4 of 10 frequencies, the in-phase ones lower",
        ),
        (
            "map_between",
            changed(STIFFNESS, with_r(-0.9), stiff(50)),
            "partly",
            "at 50 Nm/rad in-phase at 0, anti-phase at 10 of 10 frequencies, at 75 Nm/rad in-phase up to 0.25 Hz",
        ),
        ("map_between", changed(STIFFNESS, flipped), "not", "anti-phase at 5 of 10"),
        # Amplitudes are compared where every condition has a value.
        ("amplitude", [t for t in EXAMPLE["amplitude"] if t.origin.amplitude_m != 0.12], "not measured", "10 of 40"),
    ],
)
def test_a_single_change(key: str, results: Results, outcome: str, measured: str) -> None:
    experiment = key.split("_")[0].replace("map", "hip_stiffness")
    verdict = judge(**{experiment: results})[key]
    assert verdict.verdict == {"not": "not reproduced"}.get(outcome, outcome)
    assert measured in verdict.measured


def test_falls_are_named_and_not_averaged() -> None:
    one = changed(FREQUENCY, fallen, lambda t: at(1.5)(t) and t.origin.seed == 2)
    verdict = judge(frequency=one)["frequency_modes"]
    assert verdict.verdict is Outcome.REPRODUCED and "1 of 30 trials fell: 1.5 Hz (seed 2)" in verdict.measured
    everyone = {name: [fallen(t) for t in results] for name, results in EXAMPLE.items() if name not in ("ramp", "amplitude")}
    claims = judge(**everyone)
    assert {c.verdict for key, c in claims.items() if not key.startswith(("ramp", "amplitude"))} == {Outcome.NOT}


def test_a_single_seed_has_no_interval() -> None:
    verdict = judge(**paper_results(seeds=1))["frequency_modes"]
    assert verdict.verdict is Outcome.REPRODUCED
    assert "1 seed; no falls" in verdict.measured and "(" not in verdict.measured


def test_the_switch_is_judged_for_each_seed() -> None:
    switch_hz = {1: 0.66, 2: 0.72, 3: 0.8}  # between neighbours 0.025 or 0.15 Hz apart
    results = [frequency_result(hz, seed, switch) for seed, switch in switch_hz.items() for hz in FREQS]
    assert switches(results) == pytest.approx(switch_hz, abs=0.01)
    verdict = judge(frequency=results)["frequency_switch"]
    assert verdict.verdict is Outcome.PARTLY and "2 of 3 seeds" in verdict.measured
    assert "0.656 Hz (least torque)" in verdict.theory and "0.672" in verdict.comment


@pytest.mark.parametrize(
    ("seeds", "dip", "scatter", "outcome"),
    [
        (1, 0.0015, 0.0, Outcome.REPRODUCED),
        (1, 0.0005, 0.0, Outcome.NOT),  # without an interval
        (3, 0.0005, 0.0, Outcome.REPRODUCED),
        (3, 0.0005, 0.001, Outcome.NOT),  # intervals that overlap
        (3, 0.01, 0.001, Outcome.REPRODUCED),
    ],
)
def test_a_dip_must_be_larger_than_the_scatter(seeds: int, dip: float, scatter: float, outcome: Outcome) -> None:
    results = [
        replace(frequency_result(hz, seed), target_head_r=0.98 - dip * (hz > 1.2) + scatter * (seed - 1))
        for seed in range(1, seeds + 1)
        for hz in TEN
    ]
    assert judge(frequency=results)["frequency_tracking"].verdict is outcome


def ramps(*transitions: RampTransitions) -> Results:
    return [result(0.1, seed, freq_hz=math.nan, ramp=ramp) for seed, ramp in enumerate(transitions, 1)]


@pytest.mark.parametrize(
    ("results", "outcome", "measured"),
    [
        (ramps(*[RampTransitions(0.65, 1, 0.3, 1)] * 2), Outcome.REPRODUCED, "trailing window: seed 1 0.300"),
        (ramps(*[RampTransitions(0.61, 1, 0.3, 1)] * 2), Outcome.PARTLY, "centred window: seed 1 0.610"),
        (ramps(*[RampTransitions(0.5, 1, 0.69, 1)] * 2), Outcome.NOT, "seed 2 0.690"),  # the trailing window does not count
        (ramps(NO_RAMP_TRANSITION), Outcome.NOT, "seed 1 none"),
        (ramps(NO_RAMP_TRANSITION, RampTransitions(0.69, 1, 0.78, 1)), Outcome.PARTLY, "seed 1 none"),
        # The mean is within 0.05 Hz, but not both seeds.
        (
            ramps(RampTransitions(0.69, 1, 0.78, 1), RampTransitions(0.75, 1, 0.84, 3)),
            Outcome.PARTLY,
            "0.840; mean 0.810 (0.780 to 0.840) Hz, changes of sign: seed 2 3",
        ),
    ],
)
def test_the_ramp(results: Results, outcome: Outcome, measured: str) -> None:
    verdict = judge(ramp=results)["ramp_transition"]
    assert verdict.verdict is outcome and measured in verdict.measured


@pytest.mark.parametrize(("slope", "outcome"), [(4.0, Outcome.REPRODUCED), (2.0, Outcome.PARTLY), (0.8, Outcome.NOT)])
def test_amplitude_against_frequency(slope: float, outcome: Outcome) -> None:
    # r = 10 (A - 0.06) + slope f: 0.6 between amplitudes. Ranges of a factor of two begin at 0.15, 0.3, 0.45, 0.6, 0.75 Hz
    # and are as wide as that: 0.45 slope on average. Over all frequencies, ten times as far apart: 1.35 slope.
    def linear(t: Result) -> Result:
        return replace(t, hip_ankle_r=10 * (t.origin.amplitude_m - 0.06) + slope * t.freq_hz)

    results = changed(EXAMPLE["amplitude"], linear)
    verdict = judge(amplitude=results)["amplitude"]
    assert verdict.verdict is outcome
    assert "by 0.60 with amplitude (0.06 to 0.12 m)" in verdict.measured
    assert f"by {0.45 * slope:.2f} with frequency over the same factor of 2" in verdict.measured
    assert f"by {1.35 * slope:.2f} over all frequencies (0.15 to 1.5 Hz)" in verdict.measured
    # Without 1.5 Hz the range that begins at 0.75 Hz ends at 1.35 Hz, which is no longer a factor of 2.
    some = changed(results, fallen, lambda t: at(1.5)(t) and t.origin.amplitude_m == 0.12)
    verdict = judge(amplitude=some)["amplitude"]
    assert verdict.verdict is Outcome.NOT_MEASURED and "in 1 of 40 conditions; at the 9 frequencies" in verdict.measured
    assert f"by {0.375 * slope:.2f} with frequency over" in verdict.measured  # the mean of 0.15, 0.3, 0.45, 0.6
    assert f"by {1.2 * slope:.2f} over all frequencies (0.15 to 1.35 Hz)" in verdict.measured


def test_theory_is_judged_by_the_same_rule() -> None:
    verdict = judge(frequency=changed(FREQUENCY, flipped, at(0.3)))["frequency_modes"]
    # tanh(3 (0.66 - f)) has the paper's mode at all ten.
    assert verdict.theory.startswith("least torque: the paper's mode in 10 of 10")
    assert "Theory shows it (least torque)" in verdict.comment and "was not tested" in verdict.comment
    no_trend = changed(FREQUENCY, lambda t: replace(t, relative_phase_deg=90.0))
    verdict = judge(frequency=no_trend)["frequency_phase"]
    assert verdict.verdict is Outcome.NOT and "In theory the correlation is judged" in verdict.rule
    assert "Theory shows it (least torque)" in verdict.comment
    least = [replace(t, least=replace(t.least, hip_ankle_r=0.83 - 0.02 * t.load_kg)) for t in LOAD]
    verdict = judge(load=changed(least, lambda t: with_r(0.8 - 0.1 * t.load_kg)(t)))["load_modes"]
    assert "least torque: correlation: rho = -1.00; from 0.83 at 0 kg to 0.75 at 4 kg" in verdict.theory
    assert "(least torque: partly)" in verdict.comment


def test_the_papers_map_names_thirty_of_eighty_conditions() -> None:
    modes = map_modes(PAPER, REPORT)
    assert len(map_grid(PAPER, REPORT)) == 80 and len(modes) == 30
    assert {k for k, _ in modes} == {25.0, 175.0, 200.0}
    assert modes[25.0, 0.05] == "anti" and modes[200.0, 0.5] == "in"


@settings(max_examples=20, deadline=None)
@given(st.permutations(range(20)))
def test_the_order_of_results_does_not_matter(order: list[int]) -> None:
    results = [frequency_result(hz, seed) for seed in (1, 2) for hz in TEN]
    assert judge(frequency=[results[i] for i in order])["frequency_modes"].verdict is Outcome.REPRODUCED
