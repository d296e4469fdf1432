"""The task as an environment of Gymnasium. Importing this package registers it:

    import gymnasium, posture.gymnasium
    env = gymnasium.make("posture/HeadTracking-v0", freq=1.2)
    envs = gymnasium.make_vec("posture/HeadTracking-v0", num_envs=1024)

or, in one string, gymnasium.make("posture.gymnasium:posture/HeadTracking-v0"). See docs/gymnasium.md.
"""

from gymnasium import register

ID = "posture/HeadTracking-v0"

register(
    ID,
    entry_point="posture.gymnasium.stander:StanderEnv",
    vector_entry_point="posture.gymnasium.stander_vector:StanderVectorEnv",
)
