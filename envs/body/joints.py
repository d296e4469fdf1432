"""Names and order of bodies and joints, the same in every array of the project.

A joint array has one column for each of `JOINTS`. `HIPS` and `ANKLES` are the columns of a kind, left and right, and HIP and
ANKLE the places in a pair (hip, ankle) of one value for each kind.
"""

BODIES = ("hat", "leg_left", "foot_left", "leg_right", "foot_right")
JOINTS = ("hip_left", "ankle_left", "hip_right", "ankle_right")
FEET = ("foot_left", "foot_right")
HIPS, ANKLES = (0, 2), (1, 3)
"""Places of the hips and of the ankles in `JOINTS`."""
