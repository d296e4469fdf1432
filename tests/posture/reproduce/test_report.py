"""From the folders that jobs leave to verdicts and the page, with made-up results whose answer is known."""

import csv
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from posture.analysis.results import NO_ORIGIN, NO_REWARD, Result, write_csv, write_rows
from posture.analysis.trajectory import Trajectory
from posture.cli.jobs import Job, check
from posture.config.eval import EvalConfig
from posture.config.reproduce import ReproduceConfig
from posture.config.train import TrainConfig
from posture.evaluation import trial
from posture.reproduce import __main__ as command
from posture.reproduce import collect
from posture.reproduce.experiments import EVALUATIONS
from posture.storage import checkpoint, provenance, yaml_files
from tests.posture.reproduce.examples import PAPER, REPORT, TRANSITIONS, paper_results, steady, swept
from tests.posture.reproduce.page.test_page import Reader

RESULTS = paper_results(seeds=2)


def make_plan() -> command.Plan:
    """The jobs of every experiment, two of three seeds wanted; a configuration is composed once for each experiment."""

    def vary(name: str, key: str, values: Iterable[object]) -> list[Job]:
        """The jobs that a sweep of `env.<key>` has, and for trainings of three seeds."""
        command_name, kind = ("train", TrainConfig) if name in command.TRAININGS else ("eval", EvalConfig)
        (job,) = check(command_name, kind, [f"experiment={name}"]).jobs
        assert isinstance(job.config, TrainConfig | EvalConfig)
        jobs = []
        for value in values:
            config = job.config.model_copy(update={"env": job.config.env.model_copy(update={key: value})})
            folder = Path("runs", name)
            if isinstance(config, EvalConfig):
                jobs.append(Job(config, folder / f"{key}-{value}"))
                continue
            for seed in (1, 2, 3):
                jobs.append(Job(config.model_copy(update={"seed": seed}), folder / f"{name}-{value}_seed-{seed}"))
        return jobs

    trainings = {
        "frequency": vary("frequency", "hip_k", [125.0]),
        "energy": vary("energy", "energy_weight", PAPER.table_4.gamma),
        "hip_stiffness": vary("hip_stiffness", "hip_k", PAPER.experiment_3.hip_k_nm_per_rad),
        "map": vary("map", "hip_k", [125.0]),
        "human": vary("human", "hip_k", [125.0]),
        "as_published": vary("as_published", "hip_k", [125.0]),
        "as_run": vary("as_run", "hip_k", [125.0]),
    }
    evaluations = {
        "ramp": (ramp := vary("ramp", "load", [None])),
        "load": (load := vary("load", "load", [0.5 * i for i in range(9)])),
        "load_trained": load,
        "amplitude": vary("amplitude", "amplitude", REPORT.grid.amplitudes_m),
        "engines": vary("engines", "physics", ["sagittal", "mujoco", "mujoco_c"]),
        **{f"{trial}_{name}": own for name in ("as_published", "as_run") for trial, own in (("ramp", ramp), ("load", load))},
    }
    wanted = {name: [job for job in own if command._seed(job) <= 2] for name, own in trainings.items()}
    return command.Plan(trainings, wanted, evaluations)


def write_training(job: Job) -> None:
    """The files of a training without its evaluation."""
    assert isinstance(job.config, TrainConfig)
    job.folder.mkdir(parents=True)
    provenance.write_config(job.folder, job.config)
    checkpoint.save({"actor_state_dict": {}, "iter": job.config.max_iterations}, model_of(job))
    checkpoint.save({"processes": [{"logger": {"tot_time": 360.0}}]}, job.folder / "resume.pt")
    yaml_files.write_yaml(job.folder / "status.yaml", {"state": "done"})


def model_of(job: Job) -> Path:
    assert isinstance(job.config, TrainConfig)
    return job.folder / f"model_{job.config.max_iterations}.pt"


def write_evaluation(out: Path, job: Job, evaluation: EvalConfig | None, results: list[Result], trace: Trajectory) -> None:
    """What an evaluation of the policy of `job` leaves; None: the training's own."""
    run = job.config
    assert isinstance(run, TrainConfig)
    how = evaluation.evaluation if evaluation else run.evaluation
    changes = evaluation.env if evaluation else trial.AS_TRAINED
    out.mkdir(parents=True)
    write_csv([replace(result, origin=NO_ORIGIN) for result in results], out / "metrics.csv")
    trace.save(out / "trajectories.npz")
    env = trial.trial_config(run.env, how, changes, run.device)
    record = trial.policy_record(model_of(job), run) | trial._conditions(how, env) | provenance.digests(out, trial.RESULTS)
    yaml_files.write_yaml(out / "trial.yaml", record)


def write_all(plan: command.Plan) -> None:
    """The folders of two seeds of every experiment."""
    for experiment, own in plan.wanted.items():
        for job in own:
            assert isinstance(job.config, TrainConfig)
            env, seed = job.config.env, job.config.seed
            results = [
                result
                for result in RESULTS[experiment]
                if (result.origin.seed, result.origin.energy_weight) == (seed, env.energy_weight)
                and result.hip_k_nm_per_rad == env.hip_k
            ]
            write_training(job)
            write_evaluation(job.folder / "evaluation", job, None, results, steady([0.15, 0.75, 1.5]))
    for experiment, trials in plan.evaluations.items():
        for job in plan.wanted[EVALUATIONS[experiment].policies]:
            for evaluation in trials:
                config, policy = evaluation.config, job.config
                assert isinstance(config, EvalConfig) and isinstance(policy, TrainConfig)
                env = config.env
                results = [
                    result
                    for result in RESULTS[experiment]
                    if result.origin.seed == policy.seed
                    and env.load in (None, result.load_kg)
                    and env.amplitude in (None, result.origin.amplitude_m)
                    and env.physics in (None, result.origin.physics)
                ]
                trace = swept() if experiment == "ramp" else steady([0.4])
                write_evaluation(evaluation.folder / job.folder.name, job, config, results, trace)


def write_map(folder: Path, policies: Sequence[Job]) -> None:
    """What `posture.map` leaves of two seeds: four random trials and two stiffnesses."""
    folder.mkdir(parents=True)
    spread = {"cost_ratio_mean": 1.04, "cost_ratio_p95": 1.18, "cost_ratio_max": 1.3, "below_120": 0.955}
    spread |= {"exact_ratio_mean": 1.03, "exact_ratio_p95": 1.1, "exact_below_120": 1.0}
    agreement = [
        {"varied": varied, "seed": seed, "trials": 4, "falls": 0, **spread, "same_mode": same}
        for seed in (1, 2)
        for varied, same in (("hip_k", 1.0), ("random", math.nan))
    ]
    transitions = [
        {"varied": "hip_k", "value": k, "seed": seed, "policy_hz": 0.5 + seed / 10, "least_hz": 0.65, "reward_hz": 0.68}
        for k in (100.0, 125.0)
        for seed in (1, 2)
    ]
    write_rows(agreement, folder / "agreement.csv")
    write_rows(transitions, folder / "transitions.csv")
    Image.new("RGB", (8, 8)).save(folder / "map.png")
    record = [trial.policy_record(model_of(job), job.config) for job in policies]
    digests = provenance.digests(folder, ["agreement.csv", "transitions.csv", "map.png"])
    yaml_files.write_yaml(folder / "map.yaml", {"policies": record} | digests)


def write_dynamics(folder: Path, policies: Sequence[Job]) -> None:
    """What `posture.dynamics` leaves of two seeds: one finding."""
    folder.mkdir(parents=True)
    found = {"name": "hysteresis_ramp", "seeds": 2, "value": 0.0123, "low": -0.004, "high": 0.028}
    write_rows([found | {"found": "no hysteresis", "people": ""}], folder / "findings.csv")
    Image.new("RGB", (8, 8)).save(folder / "dynamics.png")
    record = [trial.policy_record(model_of(job), job.config) for job in policies]
    digests = provenance.digests(folder, ["findings.csv", "dynamics.png"])
    yaml_files.write_yaml(folder / "dynamics.yaml", {"policies": record} | digests)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[command.Plan, ReproduceConfig]]:
    """The folders of all experiments, and the report on them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("reproduction"))
        # Theory has its own tests, and takes half a minute here.
        patch.setattr(collect, "theory_transitions", lambda *_: TRANSITIONS)
        patch.setattr(collect, "_with_reward_optimum", lambda results, *_: [replace(r, reward=NO_REWARD) for r in results])
        patch.setattr(collect, "reward_transition", lambda *_: 0.75)
        patch.setattr(collect, "reward_optimum", lambda *_: None)
        patch.setattr(collect, "hip_ankle_correlation", lambda _: 0.25)
        (job,) = check("reproduce", ReproduceConfig, ["stages=[report]"]).jobs
        assert isinstance(job.config, ReproduceConfig)
        plan = make_plan()
        write_all(plan)
        write_map(Path("report/map"), plan.wanted["map"])
        write_dynamics(Path("report/dynamics"), plan.wanted["human"])
        command.report(plan, job.config, Path("report"))
        yield plan, job.config


def verdicts(out: str) -> dict[str, str]:
    with Path(out, "tables", "verdicts.csv").open(newline="") as file:
        return {row["key"]: row["verdict"] for row in csv.DictReader(file)}


def test_results_like_the_papers_reproduce_every_claim(made: object) -> None:
    assert len(verdicts("report")) == 19 and set(verdicts("report").values()) == {"reproduced"}
    names = {path.stem for path in Path("report/tables").glob("*.csv")}
    assert names == {*RESULTS, "verdicts"}
    for name, own in RESULTS.items():
        assert len(Path(f"report/tables/{name}.csv").read_text().splitlines()) == 1 + len(own)


def test_the_page_is_whole(made: object) -> None:
    text = Path("report/report.html").read_text(encoding="utf-8")
    read = Reader(text)
    anchors = [section["id"] for section in read.all("section")]
    links = {str(a["href"]).removeprefix("#") for a in read.all("a") if str(a["href"]).startswith("#")}
    assert len(anchors) == len(set(anchors)) == 17 and links == set(anchors)
    assert len(read.all("img")) == 18 and all(image["alt"] for image in read.all("img"))
    assert [span["class"] for span in read.all("span") if "class" in span] == ["verdict reproduced"] * 19
    assert "19 claims: 19 reproduced." in read.text and "2 seeds; no falls" in read.text
    for table in re.findall(r"<table.*?</table>", text, re.S):
        assert len({len(re.findall(r"<t[hd][ >]", row)) for row in re.findall(r"<tr>.*?</tr>", table, re.S)}) == 1
    # tanh(3 (0.69 - 0.15)), tanh(3 (0.66 - 0.15)) and acos of the former, 2 of 2 seeds.
    summary = Path("report/summary.md").read_text(encoding="utf-8")
    row = "| 0.15 | 0.92 (0.92 to 0.92) | 22 (22 to 22) | in-phase | 0.91 | - | 1.04 (1.04 to 1.04) | 2/2 | in-phase |"
    assert row in summary
    codes = {"training_code": [provenance.training_code()], "analysis_code": provenance.analysis_code()}
    assert yaml_files.read_yaml(Path("report/provenance.yaml")) == codes
    assert "{" not in summary  # every number is filled in
    # tanh(3 (0.69 - f)) is 0 at 0.69 Hz; the cost ratio is 1.04.
    assert "The modes switch at 0.690 (0.690 to 0.690) Hz; the paper's at 0.69 Hz in a ramp." in summary
    own = "authors' code as it was run: 0.690 (0.690 to 0.690) (best for its reward: 0.750 Hz), 9 of 9 claims reproduced"
    assert own in summary
    assert "| hip-ankle r with 0 and 4 kg | positive, negative | 0.90 (0.90 to 0.90), -0.70 (-0.70 to -0.70) |" in summary
    # -0.9 - 25e-4 and -0.9 + 0.01, as the examples have them.
    assert "| hip-ankle r with hips of 100 Nm/rad at 0.5 Hz | negative | -0.90 (-0.90 to -0.90) | 0.25 |" in summary
    assert "| hip-ankle r at gamma 5 and 0.4 Hz | negative | -0.89 (-0.89 to -0.89) |" in summary
    assert "| energy | 18 of 27 | 1, 2 | 1.8 |" in summary  # nine weights, 360 s each
    assert "| random | 2 | 4 | 0 | 1.04 | 1.18 | 96% | 1.03 | 1.10 | 100% | - |" in summary
    assert "| the same, slow ramp [Hz] | 0.0123 | -0.004 to 0.028 | no hysteresis | - |" in summary
    assert "| 125 | 0.600 | 0.700 | 0.650 | 0.680 |" in summary and "policies trained with loads, 2 seeds" in summary


def test_a_map_of_other_policies_is_left_out(made: tuple[command.Plan, ReproduceConfig]) -> None:
    plan, config = made
    write_map(Path("mixed/map"), [*plan.wanted["map"], plan.wanted["frequency"][0]])
    Path("mixed/figures").mkdir()
    earlier = Path("mixed/figures/many_bodies.png")
    earlier.touch()
    command.report(plan, config, Path("mixed"))
    summary = Path("mixed/summary.md").read_text(encoding="utf-8")
    assert "(`mixed/map`)" in summary and "One policy for many bodies:" not in summary
    assert not earlier.exists()


def test_results_of_other_code_are_left_out_and_named(
    made: tuple[command.Plan, ReproduceConfig], capsys: pytest.CaptureFixture[str]
) -> None:
    plan, config = made
    first, second = plan.wanted["frequency"]
    path = first.folder / "evaluation" / "trial.yaml"
    yaml_files.write_yaml(path, yaml_files.read_yaml(path) | {"training_code": "other"})
    (trial_1, *_) = plan.evaluations["load"]
    damaged = trial_1.folder / second.folder.name
    (damaged / "metrics.csv").unlink()
    older = Job(second.config, second.folder.with_name("seed-2_older"))
    write_training(older)
    command.report(plan, config, Path("other"))
    names = f"3 (`{older.folder}`, `{path.parent}`, `{damaged}`)"
    assert "Left out" in (warning := capsys.readouterr().err) and names in warning
    summary = Path("other/summary.md").read_text(encoding="utf-8")
    assert names in summary and f"<code>{path.parent}</code>" in Path("other/report.html").read_text(encoding="utf-8")
    assert verdicts("other") == verdicts("report") and "1 seed; no falls" in summary  # one seed fewer in Exp. 1
