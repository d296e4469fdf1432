"""The report's text, in Markdown: how to read it, and captions of its figures. Numbers in braces are filled in."""

TITLE = "Does a learning stander switch its postural mode?"

SUBTITLE = (
    "An independent reproduction of Shen, Li, Chemori and Hayashibe, Self-organizing neural network for reproducing human "
    "postural mode alternation through deep reinforcement learning (Scientific Reports, 2023). {count} claims: {outcomes}."
)

HOW_TO_READ = """
A simulated person follows a target with the head, back and forth over {travel:g} m. The reward is for following it closely,
for standing in place and for using little torque; it contains nothing about coordination. **In-phase** is a positive
correlation of hip and ankle angle over a trial (the trunk bends forward as the body leans forward), **anti-phase** a
negative one.

Numbers are means over seeds, that is over trainings that differ by chance only, with 95 % bootstrap intervals in brackets.
With so few seeds these intervals are too narrow rather than too wide. Trials in which the person falls are counted, but not
averaged. The figures show every seed as a point.

**Theory** is the linear two-link stander with the same body, without learning. Its least-torque motion has the smallest mean
squared torque that keeps the head within {tolerance_mm:g} mm of the target and the centre of pressure within the foot. The
optimum of the trained reward is the motion that maximises the reward itself, including its energy term. A verdict states
whether the paper's claim was reproduced here, by the rule given [below](#rules). It does not state whether the paper is
right about people.
"""

STRICTER = """
Two targets are stricter than in earlier versions of this page, since the policies have come closer to the optimum: the
switch had to be within 0.05 Hz of that in theory, and the mean over seeds of the cost at most 1.15. The rules of the
verdicts are unchanged. Rank correlations are now rounded to 1e-9 before they are compared with a limit. Before, one of
exactly -0.4 in the published results missed "at least 0.4" by a rounding error: that the relative phase falls as effort
costs more was "not reproduced", and is "partly".
"""

THEORY = """
For this body the hip-ankle correlation changes sign at **{sinusoid}** for the sinusoid of least torque, at **{least}** for
the motion of least torque within the tolerance, and at **{reward}** for the optimum of the trained reward. Nothing is
fitted: masses, lengths and springs are those of the simulated body.
"""

AS_PUBLISHED = """
Our training differs from the published one in reward, observations, episodes and learner, because the published one is hard
to learn from. Here the reward, observations and episodes of the authors' code were trained on as well, with the values of
paper Table 2 and rsl-rl's PPO, which is not the authors' implementation: it measures the change of the policy over all
epochs of an iteration, so that the KL threshold is twice that of Table 2. These trainings took 262 million samples, the 1000
iterations of 8192 worlds and 32 steps that the authors' configuration allows. Table 2 has 5,000,000 training steps; if they
are samples, that is 19 iterations.

That code has two errors. The head's distance from its target is summed over all worlds before the reward is taken of it. And
the energy term and the penalty near joint limits take wrong entries of the observation: three torques are multiplied by the
velocity of the next joint, and one by a joint's moment. One training has the errors corrected, the other has them as they
are.

Theory tells the causes apart. What the least-torque motion shows comes from the body. Where the best motion for the reward
of a training differs from it, the cause is the reward. Where the policy differs from the best motion for its reward, the
cause is learning: the learner, what the policy observes, or too few samples.
"""

HOW_IT_WAS_MADE = """
Trained between {first} and {last} on {platforms}, Python {pythons}, with {versions}. Code of the task, the
physics and the learner: {codes}. Commits: {commits}.

All numbers in the figures are in the CSV files beside this page, with a row for each seed and condition. These commands
repeat everything; `python -m posture.reproduce` runs all of them and writes this page:

```sh
{commands}
```

How to cite this software and the paper: CITATION.cff.
"""

MIXED = "**These results are mixed:** their trainings differ in {what}. Numbers may differ for this reason alone."

LEFT_OUT = (
    "**Left out**, because they come from other code or another configuration than this page, or are damaged: {count} "
    "({names})."
)

FIGURES: dict[str, tuple[str, str]] = {
    "overview": (
        "Hip-ankle correlation against target frequency, of the trained policies, of theory, and the paper's modes",
        "Correlation of hip and ankle against target frequency: trained policies (with markers), the least-torque motion "
        "and the optimum of each trained reward in theory (without markers, in the colour of its training), and the paper's "
        "modes.",
    ),
    "figure_2": (
        "The body from the side during one cycle, at the lowest and at the highest frequency",
        "Fig. 2. One cycle in-phase and one in anti-phase, drawn from the joint angles of a trained policy.",
    ),
    "figure_3": ("Head and target over time at several frequencies", "Fig. 3. Head and target."),
    "figure_4": ("Hip and ankle angle over time at several frequencies", "Fig. 4. Hip and ankle angle."),
    "figure_5": (
        "Hip-ankle correlation and relative phase against frequency",
        "Fig. 5. Coordination against target frequency, with the paper's modes and the least-torque stander.",
    ),
    "figure_6": (
        "Ranges of hip and ankle angle and torque against frequency",
        "Fig. 6. Peak-to-peak ranges of angle and torque.",
    ),
    "figure_7": (
        "Centre of pressure against frequency, between heel and toe",
        "Fig. 7. Centre of pressure in the foot frame; the grey lines are the ends of ground contact.",
    ),
    "figure_8": (
        "Relative phase, energy and tracking against the weight of effort",
        "Fig. 8. Exp. 2: the weight gamma of effort in the reward, at {energy_hz:g} Hz; energy during {duration:g} s.",
    ),
    "figure_9": (
        "Coordination against hip stiffness at {stiffness_hz:g} Hz",
        "Fig. 9. Exp. 3: hip stiffness, with a policy for each, at {stiffness_hz:g} Hz.",
    ),
    "figure_10": (
        "Joint angles and their running correlation while the frequency rises",
        "Fig. 10. Exp. 4a: the target's frequency rises by {ramp_rate:g} Hz/s; running correlation in windows of "
        "{window_steps:d} steps.",
    ),
    "figure_11": (
        "Hip and ankle angle without load and with {load_kg:g} kg",
        "Fig. 11. Exp. 4b: joint angles without and with load.",
    ),
    "figure_12": (
        "Coordination against load at {load_hz:g} Hz",
        "Fig. 12. Exp. 4b: a load on the trunk, with policies trained without it.",
    ),
    "figure_13": (
        "Map of hip-ankle correlation over target frequency and hip stiffness",
        "Fig. 13. Correlation over frequency and hip stiffness; the lines show where it changes sign, here and in theory.",
    ),
    "many_bodies": (
        "Correlation and cost over frequency and hip stiffness, ankle stiffness, load and amplitude",
        "Policies that were trained on bodies and targets drawn at random, means over seeds. Above: correlation, with the "
        "frequencies at which it changes sign, here and in theory. Below: cost over least cost, which is computed without "
        "the approximation of small angles.",
    ),
    "dynamics": (
        "Correlation in staircases up and down, relative phase, its standard deviation and its relaxation time",
        "Policies with late and noisy senses and slow muscles: correlation while the frequency rises and falls in steps; "
        "relative phase, its standard deviation and its relaxation time after a push, against frequency.",
    ),
    "amplitude": (
        "Hip-ankle correlation against frequency at several amplitudes of the target",
        "Amplitude of the target (in the paper's text only), with policies that were trained on a range of amplitudes.",
    ),
    "engines": (
        "Hip-ankle correlation and cost ratio against frequency in each physics engine",
        "The same policies in each engine.",
    ),
    "tracking": (
        "Target-head correlation, head amplitude and head speed against frequency",
        "The columns of Table 3 against frequency.",
    ),
}
"""By name, the alternative text and the caption."""
