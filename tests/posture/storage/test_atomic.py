"""Files that are replaced as a whole or not at all."""

import os

import pytest

from posture.storage.atomic import clear, replacing


def test_a_file_is_replaced_only_at_the_end(tmp_path):
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half of the n")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert temporary.parent == tmp_path  # from another file system it could not be moved atomically
        assert path.read_text() == "old"
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_any_name_that_the_file_system_allows(tmp_path):
    path = tmp_path / ("x" * (os.pathconf(tmp_path, "PC_NAME_MAX") - 4) + ".txt")
    with replacing(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_only_temporary_files_are_cleared(tmp_path):
    other = tmp_path / ".mine.tmp"
    other.touch()
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "file") as temporary:
        temporary.touch()
        clear(tmp_path)
        assert list(tmp_path.iterdir()) == [other]
