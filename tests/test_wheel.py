"""The installed wheel: it holds all that the commands need, and they work from any folder without the checkout."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.commands import EVALUATION, TINY, TINY_THEORY

ROOT = Path(__file__).parents[1]
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
SOURCES = ["conf", "envs", "posture", "pyproject.toml", "setup.py", "README.md", "LICENSE"]
NOT_CODE = {".yaml", ".xml", ".css", ".html", ".j2", ".js", ".md", ".pt"}


def files(folder: str) -> set[str]:
    """Files of the package in `folder` of the checkout, relative to the checkout."""
    found = (path for path in (ROOT / folder).rglob("*") if path.suffix in {".py", *NOT_CODE})
    return {path.relative_to(ROOT).as_posix() for path in found}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, built from a copy of the sources so that the build leaves nothing in the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / "source" / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder / "source" / name)
    build = [*PIP, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, folder / "source"]
    subprocess.run(build, check=True)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the wheel is installed into, without its dependencies."""
    folder = tmp_path_factory.mktemp("site")
    subprocess.run([*PIP, "install", "--no-deps", "--target", folder, wheel], check=True)
    return folder


def installed(site: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`python <arguments>` in `folder` with the installed wheel, which comes before an editable install on the path."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(site), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=600,
    )


def works(site: Path, folder: Path, *arguments: str) -> str:
    """The output of a command, which must succeed."""
    done = installed(site, folder, "-m", *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_content(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    conf = {f"posture/{name}" for name in files("conf")}
    assert packed == files("envs") | files("posture") | conf
    assert "posture/conf/env/head_tracking.yaml" in conf


def test_from_another_folder(site: Path, tmp_path: Path) -> None:
    where = installed(site, tmp_path, "-c", "import envs, posture; print(envs.__file__, posture.__file__, sep='\\n')")
    assert [Path(line).parents[1] for line in where.stdout.split()] == [site, site]
    works(site, tmp_path, "posture.theory", *TINY_THEORY, "out=theory")
    assert list(tmp_path.glob("theory/*.csv"))
    program = subprocess.run(
        [site / "bin" / "posture", "--version"], env={**os.environ, "PYTHONPATH": str(site)}, text=True, capture_output=True
    )
    assert program.stdout.strip() == "0.1.0", program.stderr
    refused = installed(site, tmp_path, "-m", "posture.train", "env.hipk=5")
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: ") and len(refused.stderr.splitlines()) == 1


@pytest.mark.slow
def test_every_command(site: Path, tmp_path: Path) -> None:
    """Runs go to runs/ of the working directory."""
    works(site, tmp_path, "posture.train", *TINY)
    (run,) = (tmp_path / "runs").iterdir()
    assert (run / "evaluation" / "metrics.csv").exists()
    works(site, tmp_path, "posture.eval", "ckpt=pretrained/default", "out=evaluation", *EVALUATION)
    assert (tmp_path / "evaluation" / "metrics.csv").exists()
    works(site, tmp_path, "posture.export", "out=export", "evaluation.duration=1.0", "evaluation.freq=[0.5,1.5]")
    assert list(tmp_path.glob("export/*.onnx"))
    works(site, tmp_path, "posture.film", "out=film", "width=120", "fps=6", "settle=0", "films=[two_modes]")
    assert list(tmp_path.glob("film/*.mp4"))
    assert "port:" in works(site, tmp_path, "posture.play", "--help")
    assert "seeds:" in works(site, tmp_path, "posture.reproduce", "--help")
