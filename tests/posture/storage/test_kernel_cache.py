"""Warp's kernel cache where it cannot be written to. A file in the place of a folder stops any user, root too."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from posture.storage import kernel_cache

WARP = "import warp; warp.init(); print(warp.config.kernel_cache_dir)"


def test_it_is_where_warp_looks(tmp_path):
    """By Warp, in processes of its own."""
    for named in ({}, {"XDG_CACHE_HOME": str(tmp_path / "xdg")}, {"WARP_CACHE_PATH": str(tmp_path / "warp")}):
        with pytest.MonkeyPatch.context() as patch:
            patch.delenv("WARP_CACHE_PATH", raising=False)
            patch.setenv("HOME", str(tmp_path / "home"))
            for name, value in named.items():
                patch.setenv(name, value)
            printed = subprocess.run([sys.executable, "-c", WARP], capture_output=True, text=True, timeout=100).stdout
            assert Path(printed.splitlines()[-1]) == kernel_cache._folder()


@pytest.mark.parametrize("variable", ["HOME", "XDG_CACHE_HOME", "WARP_CACHE_PATH"])
def test_a_cache_that_cannot_be_written_to(tmp_path, monkeypatch, capsys, variable):
    (tmp_path / "file").touch()
    for name in ("XDG_CACHE_HOME", "WARP_CACHE_PATH"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    monkeypatch.setenv(variable, str(tmp_path / "file"))
    with kernel_cache.writable():
        temporary = Path(os.environ["WARP_CACHE_PATH"])
        assert temporary.is_dir() and not temporary.is_relative_to(tmp_path)
    assert not temporary.exists()
    (line,) = capsys.readouterr().out.splitlines()
    assert str(tmp_path / "file") in line and "WARP_CACHE_PATH" in line


def test_a_user_without_a_home(tmp_path, monkeypatch):
    """In a container; Warp would make a folder called ~."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WARP_CACHE_PATH", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    with kernel_cache.writable():
        assert Path(os.environ["WARP_CACHE_PATH"]).is_absolute()
    assert list(tmp_path.iterdir()) == []


def test_a_cache_that_can_be_written_to_is_used(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path))
    with kernel_cache.writable():
        assert os.environ["WARP_CACHE_PATH"] == str(tmp_path)
    assert capsys.readouterr().out == ""
