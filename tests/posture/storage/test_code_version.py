"""The digest of the code of the physics and the task."""

import shutil

import pytest

from posture.storage import code_version
from posture.storage.code_version import envs_version


@pytest.fixture(autouse=True)
def _uncached():
    yield
    envs_version.cache_clear()


def test_comments_and_docstrings_do_not_count_and_code_does(monkeypatch, tmp_path):
    def version_of(change, file="task/rewards.py"):
        copy = tmp_path / str(len(list(tmp_path.iterdir())))
        shutil.copytree(code_version.ENVS, copy, ignore=shutil.ignore_patterns("__pycache__"))
        (copy / file).write_text(change((copy / file).read_text()))
        monkeypatch.setattr(code_version, "ENVS", copy)
        envs_version.cache_clear()
        return envs_version()

    same = version_of(lambda text: text)
    assert version_of(lambda text: text.replace('"""', '"""Terms. ', 1)) == same
    assert version_of(lambda text: text + "\n# a remark\n") == same
    assert version_of(lambda text: text + "\nx = 1\n") != same
    assert version_of(lambda text: text.replace('density="1000"', 'density="999"'), "body/humanoid.xml") != same
