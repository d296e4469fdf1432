"""The documents are true to the program: every command in README.md and docs/*.md is one that works, every link leads
somewhere, and every figure is made by a command that the documents name.

Quick: each command's arguments are composed and checked as the command line does, up to the moment before physics. Slow:
each command really runs, at tiny size. What cannot run in a test stands in NOT_RUN, with the reason.
"""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra

from posture.cli import entry as cli_entry
from posture.cli import jobs
from posture.storage import run_dir
from tests.commands import TINY

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRAMS = ("python ", "make ", "tensorboard ", "torchrun ", "pip ")

NO_FREQ = [option for option in TINY if not option.startswith("evaluation.freq")]  # some experiments fix their frequencies
EVALUATION = [option for option in NO_FREQ if option.startswith("evaluation")]
OVERRIDES = ",".join(repr(option) for option in NO_FREQ if not option.startswith("processes"))

SHRUNK = {
    "train": NO_FREQ,
    "eval": EVALUATION,
    "theory": [
        "evaluation.freq=[0.3]",
        "experiment_3.hip_k=[100]",
        "experiment_4b.step=4",
        "figure_13={hip_k: [50, 100], freq: [0.3, 0.5], step: 0.2}",
        "around={ankle_k: [25], load: [0], tolerance: [0.025]}",
    ],
    "film": ["width=120", "fps=6", "settle=0", "films=[two_modes]"],
    "export": EVALUATION,
    "reproduce": ["seeds=1", f"overrides=[{OVERRIDES}]", "out=report", "parallel=2"],
}
"""Of each entry point, python -m posture.<entry>: what is appended to a command so that it takes seconds."""
RESUMED = ["max_iterations=102"]
"""What is appended where a run goes on: all else is its own."""

INSTALLS = "installs into .venv"
SERVES = "serves until it is stopped"
LONG = "takes minutes at any size"
NOT_RUN = {
    "make play": INSTALLS,
    "make train": INSTALLS,
    "make check": INSTALLS,
    "make setup": INSTALLS,
    "make test-slow": INSTALLS,
    "make reproduce": INSTALLS,
    "make reproduce seeds=1": INSTALLS,
    "make benchmark": INSTALLS,
    "pip install -e '.[cluster]'": INSTALLS,
    "pip install -c constraints.txt -e '.[export]'": INSTALLS,
    "tensorboard --logdir runs": SERVES,
    "python -m posture.play": SERVES,
    "python -m posture.play ckpt=runs/<run>": SERVES,
    "python -m posture.reproduce launcher=submitit_slurm": "needs a cluster",
    "torchrun --nproc-per-node 4 -m posture.train device=cuda": "needs GPUs; test_parallel.py runs it on the CPU",
    "python benchmarks/learners.py --learners ours": LONG,
    "python benchmarks/play.py": LONG,
}
"""Commands of the documents that the slow test leaves out, and why. Their arguments are checked all the same."""

FIGURES = {
    "results/film/": "python -m posture.film",
    "docs/theory_map.png": "python -m posture.theory",
    "results/reproduction/figures/": "python -m posture.reproduce",
}
"""Figures that the documents show, by file or folder, and the command that makes them."""


def fenced(text):
    """Contents of the fenced code blocks."""
    return re.findall(r"^```\w*\n(.*?)^```", text, flags=re.S | re.M)


def commands_in(text):
    """Commands of a document, without their comments: lines of code blocks, and code within sentences and tables."""
    lines = [line for block in fenced(text) for line in block.splitlines()]
    prose = re.sub(r"^```\w*\n.*?^```", "", text, flags=re.S | re.M)
    lines += [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", prose)]
    return [re.sub(r"\s+#.*", "", line).strip() for line in lines if line.startswith(PROGRAMS)]


COMMANDS = sorted({command for document in DOCUMENTS for command in commands_in(document.read_text())})


def entry(command):
    """The name of a command's entry point, and its arguments; None where it is not one of ours."""
    words = shlex.split(command)
    if "-m" in words and words[words.index("-m") + 1].startswith("posture."):
        at = words.index("-m") + 1
        return words[at].removeprefix("posture."), words[at + 1 :]
    return None


OURS = [command for command in COMMANDS if entry(command)]


def filled(arguments):
    """Arguments with names in place of <run> and <sweep>."""
    arguments = [argument.replace("<run>", "one").replace("<sweep>", "several") for argument in arguments]
    assert not re.search(r"<\w+>", " ".join(arguments)), f"{arguments}: a placeholder that this test does not know"
    return arguments


def checked(monkeypatch, name, arguments):
    """The jobs that `python -m posture.<name> arguments` would run: all that it does before the first begins."""
    found = []

    def only_check(config_name, kind, task):
        GlobalHydra.instance().clear()
        found.append(jobs.check(config_name, kind, sys.argv[1:]))

    monkeypatch.setattr(cli_entry, "run", only_check)
    monkeypatch.setattr(jobs, "check_device", lambda device: None)  # a document may speak of a GPU that is not here
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    monkeypatch.setattr(run_dir, "find_run", lambda name: Path("runs") / name)  # `latest` is a run of the user's
    monkeypatch.setattr("signal.signal", lambda *_: None)  # these are the test's own
    runpy.run_module(f"posture.{name}", run_name="__main__")
    assert found, f"posture.{name} does not go through posture.cli.run"
    return found[0].jobs


# -- commands ----------------------------------------------------------------------------------------------------------


def test_the_documents_have_commands():
    assert {"python -m posture.theory", "make train", "tensorboard --logdir runs"} <= set(COMMANDS)
    assert commands_in("Say `make\nall`.\n```sh\npython -m a b=[1, 2]   # why\n```\n") == [
        "python -m a b=[1, 2]",
        "make all",
    ]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_no_line_beside_a_command_goes_unread(document):
    """A code block that holds a command holds nothing else, so that no line of it escapes these tests."""
    for block in fenced(document.read_text()):
        lines = [line for line in block.splitlines() if line.strip() and not line.startswith("#")]
        if any(line.startswith(PROGRAMS) for line in lines):
            assert [line for line in lines if not line.startswith(PROGRAMS)] == []


@pytest.mark.parametrize("command", OURS)
@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
def test_every_command_composes(command, monkeypatch):
    name, arguments = entry(command)
    for job in checked(monkeypatch, name, filled(arguments)):
        if getattr(job.config, "ckpt", "").startswith("pretrained"):
            run_dir.find_checkpoints(job.config.ckpt)


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith("make ")])
def test_every_make_target_exists(command):
    dry = subprocess.run([*shlex.split(command), "--dry-run"], cwd=ROOT, capture_output=True, text=True)
    assert dry.returncode == 0, dry.stderr


@pytest.mark.parametrize("command", [command for command in COMMANDS if re.match(r"python \w+/", command)])
def test_every_script_exists(command):
    assert (ROOT / shlex.split(command)[1]).is_file()


def test_every_command_is_run_or_listed():
    unknown = [command for command in COMMANDS if command not in NOT_RUN and not entry(command)]
    assert not unknown, f"neither run nor in NOT_RUN: {unknown}"
    assert set(NOT_RUN) <= set(COMMANDS), f"in NOT_RUN, but in no document: {sorted(set(NOT_RUN) - set(COMMANDS))}"
    entries = {entry(command)[0] for command in OURS if command not in NOT_RUN}
    assert entries <= set(SHRUNK), f"no way to make it tiny in SHRUNK: {sorted(entries - set(SHRUNK))}"


# -- links and figures -------------------------------------------------------------------------------------------------


def links(document):
    """Targets of a document's relative links and images."""
    found = re.findall(r"\]\(([^)\s]+)\)", document.read_text())
    return [link for link in found if not re.match(r"[a-z]+:", link)]


def anchors(path):
    """What a link's #part may name: headings as GitHub spells them, and explicit ids."""
    text = path.read_text()
    headings = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M), flags=re.M)
    slugs = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return slugs | set(re.findall(r'id="([^"]+)"', text))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_somewhere(document):
    for link in links(document):
        path, _, part = link.partition("#")
        target = (document.parent / path).resolve() if path else document
        assert target.exists(), f"{document.name}: {link}"
        assert not part or part in anchors(target), f"{document.name}: {link}"


def shown():
    """Images of all documents, relative to the repository."""
    images = [
        (document.parent / link).resolve().relative_to(ROOT).as_posix()
        for document in DOCUMENTS
        for link in links(document)
        if link.endswith((".png", ".gif", ".svg", ".jpg", ".mp4"))
    ]
    return sorted(set(images))


@pytest.mark.parametrize("image", shown())
def test_every_figure_is_made_by_a_command_of_the_documents(image):
    makers = [command for place, command in FIGURES.items() if image.startswith(place)]
    assert len(makers) == 1, f"{image}: FIGURES does not say what makes it"
    assert any(command.split()[:3] == makers[0].split()[:3] for command in OURS), f"{makers[0]} stands in no document"


# -- the same, really run ----------------------------------------------------------------------------------------------


def run(name, arguments, folder):
    """`python -m posture.<name> arguments` in `folder`, as a process of its own; fails with what it said."""
    done = subprocess.run(
        [sys.executable, "-m", f"posture.{name}", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},  # torch's threads wait actively
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A folder as a user has it after a while: tiny runs under runs/ by the names that the documents use."""
    folder = tmp_path_factory.mktemp("workspace")
    tiny = [*NO_FREQ, "evaluate=false"]
    run("train", ["-m", "env.hip_k=60,125", *tiny, "hydra.sweep.dir=runs/several"], folder)
    run("train", ["-m", "experiment=frequency", "seed=1", *NO_FREQ], folder)
    run("train", [*tiny, "max_iterations=100", "agent.save_interval=50", "hydra.run.dir=runs/one"], folder)
    return folder


def tiny(command):
    """Entry point and arguments of a command at tiny size."""
    name, arguments = entry(command)
    resumed = any(argument.startswith("resume=") for argument in arguments)
    return name, (*filled(arguments), *(RESUMED if resumed else SHRUNK[name]))


RUN = [command for command in OURS if command not in NOT_RUN and entry(command)[0] in SHRUNK]


@pytest.mark.slow
@pytest.mark.parametrize("command", RUN)
def test_every_command_runs(command, workspace, tmp_path):
    """In a copy of the workspace, so that no command builds on what another left."""
    folder = tmp_path / "copy"
    shutil.copytree(workspace, folder)
    before = set(folder.rglob("*"))
    name, arguments = tiny(command)
    run(name, arguments, folder)
    if not arguments[0].startswith("-") or arguments[0] == "-m":
        assert set(folder.rglob("*")) - before, "it wrote nothing"
    for image in shown():
        if image.startswith("docs/") and FIGURES.get(image) == command:
            assert list(folder.rglob(Path(image).name)), f"it does not make {image}"
