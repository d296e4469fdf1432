"""Processes that torchrun starts share a training; variables of other job managers change nothing."""

import pytest

from posture.config import torchrun
from posture.storage.run_dir import folder_for
from tests.commands import answer

pytestmark = pytest.mark.usefixtures("elsewhere")

SET_BY_TORCHRUN = dict(zip(torchrun.VARIABLES, ("1", "2", "1", "localhost", "29500"), strict=True))


@pytest.fixture
def setenv(monkeypatch):
    """A function that sets torchrun's variables to exactly those given."""

    def setenv(variables):
        for name in torchrun.VARIABLES:
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)

    return setenv


def test_place_among_processes_of_torchrun(setenv, tmp_path):
    setenv(SET_BY_TORCHRUN)
    assert torchrun.place() == (1, 2, 1) and torchrun.rank() == 1
    assert answer("train")[:2] == (0, "")
    assert folder_for("runs", None) == "runs"  # where only the first process makes a folder of its own
    setenv(SET_BY_TORCHRUN | {"RANK": "0"})
    assert torchrun.place() == (0, 2, 1) and folder_for("runs", None).startswith("runs/")


@pytest.mark.parametrize(
    ("variables", "reason"),
    [
        ({"RANK": "1", "WORLD_SIZE": "2"}, "LOCAL_RANK, MASTER_ADDR, MASTER_PORT not set"),
        ({"WORLD_SIZE": "4"}, "RANK, LOCAL_RANK, MASTER_ADDR, MASTER_PORT not set"),
        ({"RANK": ""}, "RANK, WORLD_SIZE, LOCAL_RANK, MASTER_ADDR, MASTER_PORT not set"),
        (SET_BY_TORCHRUN | {"RANK": "one"}, "RANK='one' is not a number"),
        (SET_BY_TORCHRUN | {"RANK": "-1"}, "RANK='-1' is not a number"),
        (SET_BY_TORCHRUN | {"RANK": "2"}, "RANK=2 and LOCAL_RANK=1 must be below WORLD_SIZE=2"),
        (SET_BY_TORCHRUN | {"MASTER_PORT": "0"}, "MASTER_PORT=0 is not a port"),
    ],
)
def test_other_variables_have_no_effect_and_training_says_so(setenv, variables, reason):
    setenv(variables)
    assert torchrun.place() is None and torchrun.rank() == 0 and folder_for("runs", None) != "runs"
    code, err, configs = answer("train")
    assert code == 0 and len(configs) == 1
    assert err.startswith("RANK and WORLD_SIZE have no effect") and reason in err and len(err.splitlines()) == 1
    assert answer("theory")[:2] == (0, "")


@pytest.mark.parametrize("command", [["eval"], ["theory"], ["reproduce"], ["train", "-m", "seed=1,2"]])
def test_only_a_training_can_be_shared(setenv, command):
    setenv(SET_BY_TORCHRUN)
    code, err, configs = answer(*command)
    assert code == 2 and configs == [] and len(err.splitlines()) == 1
    assert err.startswith("error: WORLD_SIZE=2: only one training can be shared among processes")
