"""Names and order of bodies and joints, the same in every array of the project.

A joint array has one column for each of `JOINTS`; `HIPS` and `ANKLES`, `LEFT` and `RIGHT` select two of its columns. An
array with one value for both sides has one column for each of `KINDS`; `HIP` and `ANKLE` select one of them.
"""

BODIES = ("hat", "leg_left", "foot_left", "leg_right", "foot_right")
FEET = ("foot_left", "foot_right")

JOINTS = ("hip_left", "ankle_left", "hip_right", "ankle_right")
HIPS, ANKLES = slice(0, 4, 2), slice(1, 4, 2)
LEFT, RIGHT = slice(0, 2), slice(2, 4)

KINDS = ("hip", "ankle")
HIP, ANKLE = 0, 1
