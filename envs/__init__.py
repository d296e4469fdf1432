"""The body and its task: a standing person who follows a target with the head, simulated in many worlds."""
