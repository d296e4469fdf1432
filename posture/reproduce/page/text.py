"""What the report says in words: how to read it, and what its figures show. Numbers in braces are filled in."""

TITLE = "Does a learning stander switch its postural mode?"

SUBTITLE = """
An independent reproduction of Shen, Li, Chemori and Hayashibe, Self-organizing neural network for reproducing human
postural mode alternation through deep reinforcement learning (Scientific Reports, 2023). {count} claims: {told}.
"""

HOW_TO_READ = """
A simulated person follows a target with the head, back and forth by {travel:g} m, and is rewarded for closeness, for
standing where it stands and for little torque. Nothing in the reward speaks of coordination. **In-phase** is a positive
correlation of hip and ankle angle over a trial (the trunk bends forward as the body leans forward), **anti-phase** a
negative one.

Numbers are means over seeds, that is over trainings that differ in nothing but chance, with 95 % bootstrap intervals in
brackets; with so few seeds such an interval is too narrow rather than too wide. A trial in which the person falls is
counted and never averaged in. Every seed is a point in the figures.

**Theory** is the linear two-link stander of the same body, without learning. Its least-torque motion keeps the head
within {tolerance_mm:g} mm of the target, and the centre of pressure within the foot, for the least mean squared torque;
the optimum of the trained reward is what the reward itself asks for, its energy term included. A verdict says whether
the paper's claim came out here, by a rule that stands [below](#rules). It does not say whether the paper is right or
wrong about people.
"""

THEORY = """
For this body the hip-ankle correlation changes sign at **{sinusoid}** for the sinusoid of least torque, at **{least}**
for the motion of least torque within the tolerance, and at **{reward}** for the optimum of the reward that was trained.
Nothing is fitted: masses, lengths and springs are those of the simulated body.
"""

MADE = """
Trained between {first} and {last} on {platforms}, Python {pythons}, with {versions}. Code of the physics and the task:
{codes}. Commits: {commits}.

All numbers of the figures are in the CSV files beside this page, a row a seed and condition. These commands make all of
it anew; `python -m posture.reproduce` runs them all and writes this page:
"""

MIXED = """
**These results are mixed:** their trainings differ in {what}. Numbers that differ may differ for that reason alone.
"""

LEFT_OUT = """
**Left out**, for they are of other code or another configuration than this page: {count} ({names}).
"""

FIGURES: dict[str, tuple[str, str]] = {
    # name: (what one sees, caption)
    "figure_2": (
        "The body from the side through one cycle, at the lowest and at the highest frequency",
        "Fig. 2. One cycle in-phase and one in anti-phase, drawn from the joint angles of a trained policy.",
    ),
    "figure_3": ("Head and target over time at three frequencies", "Fig. 3. Head and target."),
    "figure_4": ("Hip and ankle angle over time at three frequencies", "Fig. 4. Hip and ankle angle."),
    "figure_5": (
        "Hip-ankle correlation and relative phase against frequency",
        "Fig. 5. Coordination against target frequency, with the paper's modes and the least-torque stander.",
    ),
    "figure_6": (
        "Ranges of hip and ankle angle and torque against frequency",
        "Fig. 6. Ranges of angle and torque, peak to peak.",
    ),
    "figure_7": (
        "Centre of pressure against frequency, between heel and toe",
        "Fig. 7. Centre of pressure in the foot frame; the dashed lines are the ends of ground contact.",
    ),
    "figure_8": (
        "Relative phase, energy and tracking against the weight of effort",
        "Fig. 8. Exp. 2: the weight gamma of effort in the reward, at {energy_hz:g} Hz; energy in {duration:g} s.",
    ),
    "figure_9": (
        "Coordination against hip stiffness at {stiffness_hz:g} Hz",
        "Fig. 9. Exp. 3: hip stiffness, a policy each, at {stiffness_hz:g} Hz.",
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
        "Fig. 12. Exp. 4b: a load on the trunk, policies not trained again.",
    ),
    "figure_13": (
        "Map of hip-ankle correlation over target frequency and hip stiffness",
        "Fig. 13. Correlation over frequency and hip stiffness; lines where it changes sign, ours and theory's.",
    ),
    "amplitude": (
        "Hip-ankle correlation against frequency at several amplitudes of the target",
        "Amplitude of the target (in the paper's text only). The policies were trained at {amplitude:g} m alone.",
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
"""By name, what is seen, for those who cannot see it, and the caption; numbers in braces are those of `document.numbers`."""
