"""What the optimum of the reward costs where bodies differ, by the exact equations, over the least possible cost.

python benchmarks/effort_of_bodies.py                                    two minutes; docs/many_bodies.md has its result
python benchmarks/effort_of_bodies.py -- env.reward.effort_scale_max=100     another reward
"""

import argparse

from shared import compose

from envs.body.segments import read_segments
from envs.config import EnvConfig
from posture.analysis.coordination import torque_cost
from posture.theory.least_costs import weighted
from posture.theory.motion import joint_arrays
from posture.theory.nonlinear import exact_bound, exact_reward_optimum, exact_stander
from posture.theory.program import InfeasibleError

HIP_K = (25.0, 40.0, 60.0, 90.0, 125.0, 200.0)
"""Hip stiffness [Nm/rad]."""
FREQ_HZ = (0.1, 0.3, 0.5, 0.8, 1.2)
SAMPLES = 200
"""Instants of a cycle."""


def ratio(config: EnvConfig, hip_k: float, freq: float) -> str:
    """Cost of the reward's optimum over the least cost, for one body and frequency [Hz]."""
    own = config.model_copy(update={"hip_k": hip_k})
    body = read_segments(own)
    stander, tolerance = exact_stander(body, own), own.reward.tolerance
    try:
        best = exact_reward_optimum(stander, freq, weighted(own, body, freq), tolerance)
        least = exact_bound(stander, freq, own.amplitude, tolerance)
    except InfeasibleError:
        return "-"
    of_reward, of_torque = (torque_cost(joint_arrays(motion, SAMPLES)[0], stander.torque_limit) for motion in (best, least))
    return f"{of_reward / of_torque:.2f}"


def main() -> None:
    """Print a table for effort of equal weight, and one for effort weighed as `env=many_bodies` does."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("overrides", nargs="*", help="Hydra overrides")
    overrides = ["env=many_bodies", "agent=universal", *parser.parse_args().overrides]
    for title, more in (("one weight of effort for all", ["env.reward.effort_exponent=0"]), ("as trained", [])):
        config = compose(*overrides, *more).env
        print(f"{title}\n{'hip [Nm/rad]':<14}" + "".join(f"{freq:<6g}" for freq in FREQ_HZ) + "Hz")
        for hip_k in HIP_K:
            print(f"{hip_k:<14g}" + "".join(f"{ratio(config, hip_k, freq):<6}" for freq in FREQ_HZ), flush=True)


if __name__ == "__main__":
    main()
