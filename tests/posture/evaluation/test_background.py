"""Evaluations and films beside a training: the best policy is kept, the log has both, and a plateau ends the training.

The other processes are replaced by functions that write the results of an evaluation which the test has chosen.
"""

import os
import re
import shutil
import sys
import time
from pathlib import Path

import pytest
import yaml
from PIL import Image
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from posture.analysis.results import read_csv, write_csv
from posture.evaluation import background, best
from posture.evaluation.background import Background
from posture.storage import checkpoint
from tests.commands import CONSTANT, TINY, call, refused, same
from tests.conftest import compose
from tests.posture.evaluation.test_best import NAN, result

LONG = [*(option for option in TINY if "max_iterations" not in option), *CONSTANT, "evaluate=false", "out=run"]


@pytest.fixture
def ratios(tmp_path, monkeypatch):
    """Cost ratios by iteration, nan for a fall: what each evaluation will find."""
    monkeypatch.chdir(tmp_path)
    found: dict[int, float] = {}

    def process(_, line):
        ckpt = Path(next(word for word in line if word.startswith("ckpt=")).removeprefix("ckpt=").strip("'"))
        iteration, run = int(re.findall(r"\d+", ckpt.name)[0]), ckpt.parent
        if "posture.film" in line:
            folder = run / "films" / ckpt.stem
            folder.mkdir(parents=True)
            Image.new("P", (8, 6)).save(folder / background.FILM)
            return ""
        if iteration not in found:
            return "no results"
        config = yaml.safe_load((run / "config.yaml").read_text())
        name = "evaluation" if iteration == config["max_iterations"] else f"evaluation_model_{iteration}"
        write_csv([result(found[iteration])], run / name / "metrics.csv")
        return ""

    monkeypatch.setattr(Background, "_process", process)
    for module in (background, best):
        monkeypatch.setattr(module, "is_current", lambda out, *_: (out / "metrics.csv").exists())
    return found


def iterations(run):
    return sorted(int(path.stem.removeprefix("model_")) for path in Path(run).glob("model_*.pt"))


def test_the_best_policy_is_kept_and_logged(ratios, monkeypatch, capsys):
    ratios |= {2: NAN, 4: 1.2, 6: 1.4}
    call(monkeypatch, "train", *LONG, "max_iterations=6", "evaluate_every=2", "film_every=4")
    printed = capsys.readouterr().out
    assert "model_4.pt: falls at 0 of 2 frequencies, 1.200 times the least cost" in printed
    run = Path("run")
    assert (run / "best.pt").read_bytes() == (run / "model_4.pt").read_bytes()
    record = yaml.safe_load((run / "best.yaml").read_text())
    assert (record["iteration"], record["falls"], record["cost_ratio"]) == (4, 0, 1.2)
    assert [(one["iteration"], one["falls"]) for one in record["compared"]] == [(2, 1), (4, 0), (6, 0)]
    log = EventAccumulator(str(run)).Reload()
    assert [(event.step, event.value) for event in log.Scalars("Evaluation/falls")] == [(2, 1.0), (4, 0.0), (6, 0.0)]
    (film,) = log.Images("film")
    assert (film.step, film.width, film.height) == (4, 8, 6) and film.encoded_image_string.startswith(b"GIF8")


def test_a_run_whose_policies_all_fall_has_no_best(ratios, monkeypatch, capsys):
    ratios |= {1: NAN, 2: NAN}
    call(monkeypatch, "train", *LONG, "max_iterations=2", "evaluate_every=1")
    assert "best: none" in capsys.readouterr().out and not list(Path("run").glob("best*"))


def test_a_failed_evaluation_is_named_and_the_training_goes_on(ratios, monkeypatch, capsys):
    ratios |= {2: 1.3}
    call(monkeypatch, "train", *LONG, "max_iterations=2", "evaluate_every=1")
    printed = capsys.readouterr()
    assert "posture.eval of model_1.pt failed: no results" in printed.err and iterations("run") == [1, 2]
    assert yaml.safe_load(Path("run/best.yaml").read_text())["iteration"] == 2


def test_a_plateau_ends_the_training_which_can_be_resumed(ratios, monkeypatch, capsys):
    """The best is that of iteration 4; the evaluations of 6 and 8 are known at the checkpoint after 10 iterations."""
    ratios |= {2: 1.3, 4: 1.1, 6: 1.2, 8: 1.15, 12: 1.0, 14: 1.4}
    command = ["train", *LONG, "max_iterations=14", "evaluate_every=2", "patience=2"]
    call(monkeypatch, *command)
    assert iterations("run")[-1] == 10
    assert yaml.safe_load(Path("run/best.yaml").read_text())["iteration"] == 4
    capsys.readouterr()
    call(monkeypatch, *command)  # the same command has nothing left to do
    assert "already trained" in capsys.readouterr().out and iterations("run")[-1] == 10
    line = refused(monkeypatch, capsys, "train", "resume=run", "max_iterations=14")
    assert "patience = 2 ended this training after 10 iterations" in line
    line = refused(monkeypatch, capsys, "train", "resume=run", "max_iterations=14", "evaluate_every=0")
    assert "evaluate_every = 0" in line
    line = refused(monkeypatch, capsys, "train", "resume=run", "max_iterations=14", "evaluate_every=null", "patience=3")
    assert "patience: has no effect without evaluate_every" in line
    ratios[10] = 1.3
    call(monkeypatch, "train", "resume=run", "patience=null", "max_iterations=14")
    assert iterations("run")[-1] == 14
    assert yaml.safe_load(Path("run/best.yaml").read_text())["iteration"] == 12
    call(monkeypatch, "train", *LONG, "max_iterations=14", "out=whole")
    assert same(*(checkpoint.load(Path(run, "model_14.pt"), "cpu") for run in ("run", "whole")))


def test_what_a_stopped_training_lacks_is_evaluated_when_it_goes_on(ratios, monkeypatch):
    ratios |= {1: 1.2, 2: 1.1}
    call(monkeypatch, "train", *LONG, "max_iterations=2", "evaluate_every=1")
    shutil.rmtree("run/evaluation_model_1")
    call(monkeypatch, "train", *LONG, "max_iterations=2", "evaluate_every=1")
    assert read_csv("run/evaluation_model_1/metrics.csv")[0].cost_ratio == 1.2


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other priorities")
def test_its_process_has_the_lowest_priority_and_ends_with_the_training(tmp_path):
    config = compose("agent.save_interval=1", "evaluate_every=1")
    with Background(tmp_path, config) as work:
        assert work._process([sys.executable, "-c", "import os, sys; sys.exit(str(os.nice(0)))"]) == "19"
        work._thread.submit(work._process, [sys.executable, "-c", "import time; time.sleep(600)"])
        while work._child is None or work._child.returncode is not None:
            time.sleep(0.01)
        child = work._child
    assert child.returncode == -9
    with pytest.raises(ProcessLookupError):
        os.kill(child.pid, 0)


@pytest.mark.slow
def test_the_commands_themselves(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = [option for option in LONG if not option.startswith(("out=", "evaluate="))]
    options += ["max_iterations=2", "evaluate_every=1", "film_every=2", "evaluation.figures=false"]
    call(monkeypatch, "train", *options, "out='a, = run'")
    assert " failed: " not in capsys.readouterr().err
    run = Path("a, = run")
    assert len(read_csv(run / "evaluation_model_1" / "metrics.csv")) == 2
    assert len(read_csv(run / "evaluation" / "metrics.csv")) == 2
    assert (run / "films" / "model_2" / background.FILM).stat().st_size > 1000
