"""The documents match the program: commands are valid, links resolve, and a documented command makes each figure.

Quick tests compose and check the arguments of each command, as the command line does before it starts. Slow tests run each
command at a tiny size.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra

from posture.cli import console, entry, jobs
from posture.storage import run_dir
from tests.commands import ANY_FREQ, SHORT, TINY_THEORY

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "paper.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRAMS = ("python ", "posture ", "make ", "tensorboard ", "torchrun ", "pip ", "git ", "cd ")

# Appended to a command so that it takes seconds. play is not run: it serves until it is stopped.
OVERRIDES = ",".join(repr(option) for option in ANY_FREQ if not option.startswith("processes"))
SHRINK = {
    "train": ANY_FREQ,
    "eval": SHORT,
    "theory": TINY_THEORY,
    "film": ["width=120", "fps=6", "settle=0", "films=[two_modes]"],
    "export": ["evaluation.duration=1.0"],
    # tests/posture/reproduce/test_command.py has all experiments, and the commands for several seeds, which take minutes.
    "reproduce": ["seeds=1", f"overrides=[{OVERRIDES}]", "out=report", "parallel=2", "experiments=[frequency]"],
}
SHRINK_RESUMED = ["max_iterations=102"]  # a resumed run keeps all else
OF_TRAININGS = {"seeds", "parallel", "experiments"}
"""Keys of reproduce that have no effect on the report alone."""

# Which command makes the figures that the documents show, by file or folder.
FIGURES = {
    "results/film/": "film",
    "docs/theory_map.png": "theory",
    "docs/people_group.png": "analyse",
    "results/reproduction/dynamics/": "dynamics",
    "results/reproduction/figures/": "reproduce",
}


def code_blocks(text):
    """Contents of the fenced code blocks."""
    return re.findall(r"^```\w*\n(.*?)^```", text, flags=re.S | re.M)


def commands_in(text):
    """Commands in code blocks and in `code`, without their comments. Those with <command> describe a form."""
    lines = [line for block in code_blocks(text) for line in block.splitlines()]
    prose = re.sub(r"^```\w*\n.*?^```", "", text, flags=re.S | re.M)
    lines += [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", prose)]
    commands = [re.sub(r"\s+#.*", "", line).strip() for line in lines if line.startswith(PROGRAMS)]
    return [command for command in commands if "<command>" not in command]


def ours(command):
    """Name and arguments of one of our commands, `python -m posture.<name> ...` or `posture <name> ...`; None for others."""
    words = shlex.split(command)
    if words[0] == "posture":
        name, arguments = words[1], words[2:]
    elif match := re.search(r"-m posture\.(\w+)(.*)", command):
        name, arguments = match[1], shlex.split(match[2])
    else:
        return None
    return None if name.startswith("-") else (name, arguments)


def fill(arguments):
    """The arguments with names in place of <run> and <sweep>, and a run in place of `ckpt=...`."""
    named = ["ckpt=runs/<run>" if argument == "ckpt=..." else argument for argument in arguments]
    filled = [argument.replace("<run>", "one").replace("<sweep>", "several") for argument in named]
    assert not re.search(r"<\w+>", " ".join(filled)), f"unknown placeholder in {arguments}"
    return filled


COMMANDS = sorted({command for document in DOCUMENTS for command in commands_in(document.read_text(encoding="utf-8"))})
OURS = [command for command in COMMANDS if ours(command)]
RUN = [command for command in OURS if ours(command)[0] in SHRINK and "slurm" not in command and "cuda" not in command]


# -- commands ----------------------------------------------------------------------------------------------------------


def test_commands_are_found():
    text = "Say `make\nall` or `posture <command>`.\n```sh\npython -m a b=[1, 2]   # why\n```\n"
    assert commands_in(text) == ["python -m a b=[1, 2]", "make all"]
    assert {"python -m posture.theory", "make train"} <= set(COMMANDS)
    assert {ours(command)[0] for command in OURS} <= set(console.COMMANDS)
    assert {ours(command)[0] for command in RUN} == set(SHRINK)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_code_blocks_are_commands_or_not(document):
    """A code block with a command holds only commands and comments, so that no line goes unchecked."""
    for block in code_blocks(document.read_text(encoding="utf-8")):
        lines = [line for line in block.splitlines() if line.strip() and not line.startswith("#")]
        others = [line for line in lines if not line.startswith(PROGRAMS)]
        assert others in ([], lines)


@pytest.mark.parametrize("command", OURS)
def test_command_is_valid(command, monkeypatch):
    """With each value of each swept key, the others at their first: 17 jobs in place of 80 for 10 by 8 values."""
    found, combinations = [], jobs._combinations

    def each_value(overrides):
        first, *others = combinations(overrides)
        return [first, *(job for job in others if sum(a != b for a, b in zip(first, job, strict=True)) == 1)]

    def check(config_name, schema, *_):
        GlobalHydra.instance().clear()
        found.extend(jobs.check(config_name, schema, sys.argv[1:]).jobs)

    name, arguments = ours(command)
    monkeypatch.setattr(entry, "run", check)
    monkeypatch.setattr(jobs, "_combinations", each_value)
    monkeypatch.setattr(jobs, "check_device", lambda device: None)  # documents mention GPUs
    monkeypatch.setattr(run_dir, "find_run", lambda name: Path("runs") / name)  # as if the user had runs
    monkeypatch.setattr(sys, "argv", ["posture", name, *fill(arguments)])
    console.main()
    assert found or "--help" in arguments
    for job in found:
        if getattr(job.config, "ckpt", "").startswith("pretrained"):
            run_dir.find_checkpoints(job.config.ckpt)


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith("make ")])
def test_make_target_exists(command):
    dry = subprocess.run([*shlex.split(command), "--dry-run"], cwd=ROOT, capture_output=True, text=True)
    assert dry.returncode == 0, dry.stderr


@pytest.mark.parametrize("command", [command for command in COMMANDS if re.match(r"python \w+/", command)])
def test_script_exists(command):
    assert (ROOT / shlex.split(command)[1]).is_file()


# -- links and figures -------------------------------------------------------------------------------------------------


def links(document):
    """Targets of a document's relative links and images."""
    found = re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8"))
    return [link for link in found if not re.match(r"[a-z]+:", link)]


def anchors(path):
    """Valid #fragments of links: headings in GitHub's spelling, and explicit ids."""
    text = path.read_text(encoding="utf-8")
    headings = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M), flags=re.M)
    slugs = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return slugs | set(re.findall(r'id="([^"]+)"', text))


def figures():
    """Images of all documents, relative to the repository."""
    kinds = (".png", ".gif", ".svg", ".jpg", ".mp4")
    paths = {document.parent / link for document in DOCUMENTS for link in links(document) if link.endswith(kinds)}
    return sorted(path.resolve().relative_to(ROOT).as_posix() for path in paths)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_resolve(document):
    for link in links(document):
        path, _, fragment = link.partition("#")
        target = (document.parent / path).resolve() if path else document
        assert target.exists(), f"{document.name}: {link}"
        assert not fragment or fragment in anchors(target), f"{document.name}: {link}"


@pytest.mark.parametrize("figure", figures())
def test_figure_is_made_by_a_documented_command(figure):
    makers = [command for place, command in FIGURES.items() if figure.startswith(place)]
    assert len(makers) == 1, f"{figure}: not in FIGURES"
    assert makers[0] in {ours(command)[0] for command in OURS}


# -- the commands, run -------------------------------------------------------------------------------------------------


def run(name, arguments, folder):
    """Run `python -m posture.<name> arguments` in `folder` as a process; fail with its output."""
    done = subprocess.run(
        [sys.executable, "-m", f"posture.{name}", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A working directory with tiny runs, by the names that the documents use."""
    folder = tmp_path_factory.mktemp("workspace")
    tiny = [*ANY_FREQ, "evaluate=false"]
    run("train", ["-m", "env.hip_k=60,125", *tiny, "hydra.sweep.dir=runs/several"], folder)
    run("train", ["-m", "experiment=frequency", "seed=1", *ANY_FREQ], folder)
    for experiment in ("map", "human"):
        run("train", ["-m", f"experiment={experiment}", "seed=1", *tiny], folder)
    # Evaluated while it trains, in trials so short that it does not fall: only then there is a best.pt.
    often = ["evaluate_every=50", "evaluation.duration=0.5"]
    run("train", [*tiny, "max_iterations=100", "agent.save_interval=50", *often, "out=runs/one"], folder)
    assert (folder / "runs/one/best.pt").is_file()
    return folder


def shorter(name, arguments):
    """The overrides that make a command take seconds, without those that it has or that would have no effect."""
    given = {argument.partition("=")[0] for argument in arguments}
    if "resume" in given:
        return SHRINK_RESUMED
    if "what=[policy]" in arguments:
        return []
    if name == "train" and "evaluate_every" in given:
        return [*SHRINK["train"], "evaluate_every=1", "film_every=2"]  # within its two iterations
    left_out = OF_TRAININGS if "stages=[report]" in arguments else {"experiments"} & given
    return [option for option in SHRINK[name] if option.partition("=")[0] not in left_out]


@pytest.mark.slow
@pytest.mark.parametrize("command", RUN)
def test_command_runs(command, workspace, tmp_path):
    """Each in a copy of the workspace, so that no command depends on another."""
    folder = tmp_path / "copy"
    shutil.copytree(workspace, folder)
    before = set(folder.rglob("*"))
    name, arguments = ours(command)
    run(name, [*fill(arguments), *shorter(name, arguments)], folder)
    assert set(folder.rglob("*")) - before or "--help" in arguments
    if name == "theory" and not arguments:
        assert list(folder.rglob("theory_map.png"))
