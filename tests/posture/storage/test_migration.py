"""Saved configurations of earlier versions stay readable."""

import shutil

import pytest
import yaml

from posture.config.errors import ConfigError
from posture.storage.migration import UPGRADES, VERSION
from posture.storage.run_dir import PRETRAINED, read_config


@pytest.fixture
def run(sound, tmp_path):
    return shutil.copytree(sound, tmp_path / "run")


def rewrite(run, **changes):
    values = yaml.safe_load((run / "config.yaml").read_text())
    values.update(changes)
    (run / "config.yaml").write_text(yaml.safe_dump({key: value for key, value in values.items() if value != "absent"}))


def test_a_run_is_saved_with_the_current_version_and_without_the_published_tables(run):
    values = yaml.safe_load((run / "config.yaml").read_text())
    assert values["version"] == VERSION and "paper" not in values


def test_there_is_an_upgrade_from_every_earlier_version():
    assert sorted(UPGRADES) == list(range(1, VERSION))


def test_version_1_has_no_number_and_holds_the_published_tables(run):
    expected = read_config(run)
    rewrite(run, version="absent", paper={"table_1": {"mass_kg": 40.15}, "table_9": "unknown"})
    assert read_config(run) == expected


def test_version_1_has_schedules_in_control_steps(run):
    expected = read_config(run)
    env = yaml.safe_load((run / "config.yaml").read_text())["env"]
    for name in ("stay_weight", "target_weight", "ended"):
        assert env["reward"][name].pop("until") == 0.4
        env["reward"][name]["steps"] = 3.2  # of 2 iterations of 4 steps
    rewrite(run, version="absent", env=env)
    assert read_config(run) == expected


def test_version_2_has_the_contacts_of_mujoco(run):
    values = yaml.safe_load((run / "config.yaml").read_text())
    values["env"]["solver"].pop("contact_bias")
    rewrite(run, version=2, env=values["env"])
    assert read_config(run).env.solver.contact_bias is False


def test_version_3_ended_the_episode_of_a_head_outside_its_tolerance(run):
    values = yaml.safe_load((run / "config.yaml").read_text())
    for name in ("tolerance", "tolerance_weight"):
        del values["env"]["reward"][name]
    del values["agent"]["std_floor"]
    rewrite(run, **values | {"version": 3})
    upgraded = read_config(run)
    assert upgraded.env.reward.tolerance_weight == 0 and upgraded.agent.std_floor is None


def test_a_version_1_schedule_may_be_longer_than_its_training(run):
    env = yaml.safe_load((run / "config.yaml").read_text())["env"]
    env["reward"]["stay_weight"] = {"start": 5.5, "end": 1.5, "steps": 24000}  # of 2 iterations of 4 steps
    rewrite(run, version="absent", env=env)
    assert read_config(run).env.reward.stay_weight.until == 3000


def test_in_version_8_everyone_had_the_papers_body(run):
    expected = read_config(run)
    env = yaml.safe_load((run / "config.yaml").read_text())["env"]
    del env["body"]
    rewrite(run, version=8, env=env)
    assert read_config(run) == expected and expected.env.body is None


@pytest.mark.parametrize("version", [0, VERSION + 1, "2", 1.5, None, [1], True])
def test_an_unknown_version_is_refused(run, version):
    rewrite(run, version=version)
    with pytest.raises(ConfigError, match=rf"config.yaml: version = .*: allowed is a whole number from 1 to {VERSION}"):
        read_config(run)


def test_keys_that_no_version_had_are_still_refused(run):
    rewrite(run, version="absent", papers={})
    with pytest.raises(ConfigError, match="papers: no such key"):
        read_config(run)


@pytest.mark.parametrize("folder", [path.parent for path in PRETRAINED.glob("*/config.yaml")], ids=lambda path: path.name)
def test_shipped_policies_are_readable(folder):
    assert read_config(folder).max_iterations >= 400


def test_version_4_began_with_random_weights_and_had_one_logger(run):
    expected = read_config(run)
    values = yaml.safe_load((run / "config.yaml").read_text())
    del values["agent"]["logger"]
    rewrite(
        run, version=4, agent=values["agent"], init="absent", evaluate_every="absent", film_every="absent", patience="absent"
    )
    assert read_config(run) == expected
