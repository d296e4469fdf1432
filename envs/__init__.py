"""The body and its task: a standing person who follows a target with the head, simulated in many worlds."""

import warp

# Warp reports every kernel module that it loads, some fifty lines before anything of ours.
warp.config.log_level = warp.LOG_ERROR
