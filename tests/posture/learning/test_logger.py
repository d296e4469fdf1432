"""The logger's sums over long episodes."""

import pytest
import torch

from posture.learning.logger import NullWriter, TrainingLogger


def test_reward_of_an_episode_of_ten_million_steps():
    """The last thousand steps of 0.09 each are added in full, although the sum is already 900,000."""
    logger = TrainingLogger(
        log_dir=None,
        cfg={"algorithm": {}},
        env_cfg={},
        num_envs=1,
        is_distributed=False,
        gpu_world_size=1,
        gpu_global_rank=0,
        device="cpu",
    )
    logger.writer = NullWriter()
    logger.cur_reward_sum.fill_(900_000.0)
    logger.cur_episode_length.fill_(9_999_000)
    for step in range(1000):
        logger.process_env_step(torch.tensor([0.09]), torch.tensor([step == 999]), {})
    assert list(logger.rewbuffer) == pytest.approx([900_090.0], abs=1e-3)
    assert list(logger.lenbuffer) == [10_000_000]
