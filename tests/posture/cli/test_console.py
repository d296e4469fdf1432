"""The program `posture`, `python -m posture...` in fresh processes: what they import, and whose files they take."""

import subprocess
import sys

import pytest

from posture.cli.console import COMMANDS
from tests.commands import TINY

SLOW = {"torch", "warp", "newton", "mujoco", "scipy", "matplotlib", "rsl_rl", "pandas"}


def python(*arguments, cwd):
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, cwd=cwd, timeout=600)


def test_without_a_command_all_are_listed(tmp_path):
    for arguments in ([], ["--help"]):
        listed = python("-m", "posture", *arguments, cwd=tmp_path)
        assert listed.returncode == 0 and listed.stdout.startswith("usage: posture COMMAND")
        assert [line.split()[0] for line in listed.stdout.splitlines()[1:]] == list(COMMANDS)


def test_an_unknown_command_is_one_line(tmp_path):
    refused = python("-m", "posture", "trian", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr == f"error: trian: no such command; allowed are {', '.join(COMMANDS)}\n"


def test_every_command_refuses_bad_input_before_slow_imports(tmp_path):
    """All are imported in one process: if none of them imports a slow module, no single one does."""
    code = (
        "import sys\n"
        "from posture.cli import console\n"
        "for command in console.COMMANDS:\n"
        "    sys.argv = ['posture', command, 'env.hipk=5']\n"
        "    try: console.main()\n"
        "    except SystemExit as stop: print(command, stop.code)\n"
        f"print(sorted({SLOW} & sys.modules.keys()))"
    )
    done = python("-c", code, cwd=tmp_path)
    assert done.stdout.splitlines() == [*(f"{command} 2" for command in COMMANDS), "[]"], done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == len(COMMANDS) and all(line.startswith("error: env") for line in lines)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("start", [["posture.train"], ["posture", "train"]])
def test_a_refusal_in_a_process_of_its_own(tmp_path, start):
    refused = python("-m", *start, "env.hip_k=-5", cwd=tmp_path)
    assert refused.returncode == 2 and refused.stdout == ""
    assert refused.stderr == "error: env.hip_k = -5: must be greater than or equal to 0\n"


@pytest.fixture
def foreign(tmp_path):
    """A working directory whose `envs`, `conf` and `runs` are the user's own."""
    for package in ("envs", "envs/task", "conf", "runs"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("raise SystemExit('the wrong package')\n")
    (tmp_path / "envs" / "config.py").write_text("raise SystemExit('the wrong module')\n")
    (tmp_path / "conf" / "train.yaml").write_text("seed: wrong\n")
    return tmp_path


def test_an_envs_folder_in_the_working_directory_is_not_taken_for_ours(foreign):
    refused = python("-m", "posture.train", "env.hip_k=-5", cwd=foreign)
    assert refused.stderr == "error: env.hip_k = -5: must be greater than or equal to 0\n"


def test_another_envs_that_was_imported_first_is_one_clear_error(foreign):
    (foreign / "envs" / "__init__.py").write_text("")
    failed = python("-c", "import envs, posture", cwd=foreign)
    assert failed.stderr.splitlines()[-1].startswith("ImportError: posture has its own package envs")


@pytest.mark.slow
@pytest.mark.parametrize(
    "sweep", [["processes=2"], ["-m", "seed=1,2", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2"]], ids=["two", "joblib"]
)
def test_nor_in_child_processes(foreign, sweep):
    done = python("-m", "posture.train", *TINY, "evaluate=false", *sweep, cwd=foreign)
    assert done.returncode == 0, done.stderr
