"""The digests of code change only with code that affects a result."""

import os
import shutil
import subprocess

import grimp
import pytest

from posture.config.errors import ConfigError
from posture.storage import provenance
from posture.storage.provenance import ANALYSIS, PRESENTATION, ROOT, TRAINING, source_files

NOT_DECIDING = (
    "envs.config",
    "posture.config",
    "posture.storage",
    "posture.cli",
    "posture.drawing",
    "posture.operating_system",
    *(f"{package.replace('/', '.')}.{name.removesuffix('.py')}" for package in TRAINING + ANALYSIS for name in PRESENTATION),
)
"""Modules that training and evaluation import, and whose code decides no result."""

REWARDS, KERNEL = "envs/task/rewards.py", "envs/engines/sagittal_kernel.py"
BODY, PERSON = "envs/body/humanoid.xml", "envs/body/proportions.yaml"


@pytest.fixture
def digest_after(tmp_path, monkeypatch):
    """A function: the digest of the training's code after a change of one file."""
    for package in TRAINING:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(provenance, "ROOT", tmp_path)

    def digest(file=REWARDS, before="", after=""):
        path, original = tmp_path / file, (tmp_path / file).read_text()
        assert before in original
        path.write_text(original.replace(before, after, 1) if before else original + after)
        provenance.training_code.cache_clear()
        try:
            return provenance.training_code()
        finally:
            path.write_text(original)

    yield digest
    provenance.training_code.cache_clear()


FUNCTION = """
def added(x: float) -> float:
    '''Something.'''
    y: float = x
    if x < 0:
        raise ValueError("x is negative")
    print("done")
    return 2.0 * y
"""


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("'''Something.'''", "'''Something else.'''"),
        ("    if x < 0", "    # a comment\n\n    if x < 0"),
        ("x is negative", "x must not be negative"),
        ('print("done")', 'print("finished")'),
        ("x: float) -> float", "x: int) -> int"),
        ("y: float", "y: int"),
    ],
)
def test_text_and_annotations_do_not_change_the_digest(digest_after, before, after):
    assert before in FUNCTION
    assert digest_after(after=FUNCTION.replace(before, after)) == digest_after(after=FUNCTION)


@pytest.mark.parametrize(
    ("before", "after"), [("2.0 * y", "3.0 * y"), ("x < 0", "x <= 0"), ("raise ValueError", "return abs")]
)
def test_code_changes_the_digest(digest_after, before, after):
    assert before in FUNCTION
    assert digest_after(after=FUNCTION.replace(before, after)) != digest_after(after=FUNCTION)


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [(KERNEL, ": float", ": wp.float64"), (BODY, 'density="1000"', 'density="999"'), (PERSON, "0.039", "0.040")],
)
def test_types_of_kernels_and_the_body_model_change_the_digest(digest_after, file, before, after):
    assert digest_after(file, before, after) != digest_after()


def test_every_module_that_takes_part_is_in_a_digest():
    """All modules that training and evaluation import, directly or not, except those that do not affect a result."""
    graph = grimp.build_graph("envs", "posture", cache_dir=None)
    covered = {".".join(path.relative_to(ROOT).with_suffix("").parts) for path in source_files(TRAINING + ANALYSIS)}
    for start in ("posture.learning.learner", "posture.evaluation.trial"):
        imported = graph.find_upstream_modules(start) | {start}
        assert len(imported) > 10
        deciding = {name for name in imported if not any(f"{name}.".startswith(f"{other}.") for other in NOT_DECIDING)}
        packages = {name for name in deciding if any(other.startswith(f"{name}.") for other in graph.modules)}
        assert deciding - packages - covered == set()


def test_the_named_packages_and_files_exist():
    for package in TRAINING + ANALYSIS:
        assert list((ROOT / package).glob("*.py"))
    names = {path.name for package in TRAINING + ANALYSIS for path in (ROOT / package).rglob("*.py")}
    assert set(PRESENTATION) <= names


FILE = "posture/storage/provenance.py"


@pytest.fixture
def commit_of(tmp_path, monkeypatch):
    """A function: the commit that is recorded by a copy of this code whose top folder is `root`."""
    for name in list(os.environ):
        if name.startswith("GIT_"):
            monkeypatch.delenv(name)

    def commit_of(root):
        (root / FILE).parent.mkdir(parents=True, exist_ok=True)
        (root / FILE).touch()
        monkeypatch.setattr(provenance, "ROOT", root)
        monkeypatch.setattr(provenance, "__file__", str(root / FILE))
        return provenance._git_commit()

    return commit_of


def git(folder, *command):
    own = ["-c", "user.name=Someone", "-c", "user.email=someone@example.org"]
    return subprocess.run(["git", *own, *command], cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


def repository(folder, *files):
    """A repository in `folder` with one commit of `files`; the commit."""
    for file in ("README.md", *files):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).touch()
    git(folder, "init")
    git(folder, "add", ".")
    git(folder, "commit", "-m", "first")
    return git(folder, "rev-parse", "HEAD")


def test_commit_of_a_checkout_and_of_its_worktrees(tmp_path, commit_of):
    commit = repository(tmp_path / "own", FILE)
    git(tmp_path / "own", "tag", "-a", "v1", "-m", "a tag is not a commit")
    git(tmp_path / "own", "worktree", "add", tmp_path / "tree")
    assert commit_of(tmp_path / "own") == commit_of(tmp_path / "tree") == commit
    (tmp_path / "own" / "README.md").write_text("changed")
    assert commit_of(tmp_path / "own") == f"{commit}-dirty"


def test_commit_of_another_repository_is_never_recorded(tmp_path, commit_of, monkeypatch):
    repository(tmp_path, "copy/" + FILE)
    assert commit_of(tmp_path / "copy") is None  # tracked in a subfolder
    assert commit_of(tmp_path / "venv/lib/python3/site-packages") is None
    assert commit_of(tmp_path) is None  # unpacked at the top
    (tmp_path / "copy" / ".git").mkdir()
    assert commit_of(tmp_path / "copy") is None
    commit = repository(tmp_path / "own", FILE)
    monkeypatch.setenv("GIT_DIR", str(tmp_path / ".git"))
    monkeypatch.setenv("GIT_WORK_TREE", str(tmp_path))
    monkeypatch.setenv("GIT_INDEX_FILE", str(tmp_path / ".git" / "index"))
    assert commit_of(tmp_path / "copy") is None
    assert commit_of(tmp_path / "own") == commit


def test_no_commit_without_git(tmp_path, commit_of, monkeypatch):
    repository(tmp_path, FILE)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert commit_of(tmp_path) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, "does not say which code made this run"),
        ("[]", "does not say which code made this run"),
        ("a: 1", "not a list"),
        ("- {}", "start 1 has no command, started, git_commit, training_code, python, platform, versions"),
        ("- 5", "start 1 has no command"),
        (
            "- {command: [], started: x, git_commit: x, training_code: x, python: x, platform: x, versions: 3}",
            "versions or a command that cannot be read",
        ),
    ],
)
def test_damaged_provenance_is_refused(tmp_path, text, expected):
    if text is not None:
        (tmp_path / "provenance.yaml").write_text(text)
    with pytest.raises(ConfigError, match=expected) as caught:
        provenance.whole_starts(tmp_path)
    assert "\n" not in str(caught.value)
