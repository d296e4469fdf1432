"""Exported files as other programs read them: against the trajectories of the evaluation, and onnxruntime against torch."""

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
import yaml

from envs.body.joints import JOINTS, KINDS
from envs.task.head_tracking import HeadTrackingEnv
from envs.task.observations import PAST, PAST_STEPS, TERMS, TaskState
from posture.analysis.trajectory import Trajectory
from posture.config.eval import EvaluationConfig
from posture.evaluation.rollout import rollout
from posture.evaluation.trial import AS_TRAINED, trial_config
from posture.export import onnx_policy
from posture.export.onnx_policy import write_onnx
from posture.export.trajectory_files import write_csv, write_sto
from posture.learning.networks import load_policy, network
from posture.storage import checkpoint, run_dir
from tests.commands import call, refused
from tests.conftest import compose
from tests.posture.analysis.test_trajectory import trajectory

FREQ = (0.5, 1.5)
TRIAL = ["evaluation.freq=[0.5,1.5]", "evaluation.duration=1.66", "evaluation.transient=0"]  # 100 steps
# What OpenSim's reader of version 1 accepts: C++'s `stream >> double`, which does not read nan.
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The shipped policy, evaluated into `eval` and exported into `out` under the same conditions."""
    folder = tmp_path_factory.mktemp("export")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        call(patch, "eval", "ckpt=pretrained", "out=eval", "evaluation.figures=false", *TRIAL)
        call(patch, "export", "out=out", *TRIAL[:2])
    return folder


@pytest.fixture(scope="module")
def shipped():
    model = run_dir.find_checkpoint("pretrained")
    run = run_dir.read_config(model.parent)
    return model, run, load_policy(checkpoint.load(model, "cpu"), run, model, "cpu")


@pytest.fixture(scope="module")
def session(exported):
    return onnxruntime.InferenceSession(exported / "out" / "policy.onnx", providers=["CPUExecutionProvider"])


def read_sto(path):
    """(name, header, columns by label) of a storage file, read as OpenSim does: keys until endheader, labels, numbers."""
    lines = iter(path.read_text().split("\n"))
    name, header = next(lines), {}
    for line in lines:
        if line == "endheader":
            break
        key, separator, value = line.partition("=")
        if separator:
            header[key] = value
    labels = next(lines).split()
    numbers = " ".join(lines).split()
    assert [text for text in numbers if not NUMBER.fullmatch(text)] == []
    rows, width = int(header["nRows"]), int(header["nColumns"])
    assert len(labels) == width == len(set(labels)) and len(numbers) == rows * width
    values = np.array(numbers, dtype=float).reshape(rows, width)
    return name, header, dict(zip(labels, values.T, strict=True))


def read_csv(path):
    with path.open(newline="") as file:
        heading, *rows = csv.reader(file)
    return dict(zip(heading, np.array(rows, dtype=float).T, strict=True))


def signals(trial, world):
    """Name without unit, unit, and array of each signal of the evaluation."""
    yield "time", "_s", trial.time
    for name, unit in (("target_x", "_m"), ("head_x", "_m"), ("head_vx", "_m_per_s"), ("cop_x", "_m")):
        yield name, unit, getattr(trial, name)[:, world]
    for name, unit in (("torso_height", "_m"), ("foot_displacement", "_m"), ("foot_flat", "")):
        yield name, unit, getattr(trial, name)[:, world]
    for place, joint in enumerate(JOINTS):
        yield f"{joint}_angle", "_rad", trial.joint_angle[:, world, place]
        yield f"{joint}_velocity", "_rad_per_s", trial.joint_velocity[:, world, place]
        yield f"{joint}_torque", "_nm", trial.joint_torque[:, world, place]


def test_files_and_the_description_of_the_trial(exported, shipped):
    names = [f"trajectory_{freq}Hz.{kind}" for freq in FREQ for kind in ("sto", "csv")]
    assert sorted(path.name for path in (exported / "out").iterdir()) == sorted([*names, "policy.onnx", "export.yaml"])
    description = yaml.safe_load((exported / "out" / "export.yaml").read_text())
    assert description["policy"] == str(shipped[0]) and description["evaluation"]["freq"] == [0.5, 1.5]
    assert description["env"]["hip_k"] == 125.0


@pytest.mark.parametrize(("world", "freq"), list(enumerate(FREQ)))
def test_trajectories_equal_those_of_the_evaluation(exported, world, freq):
    trial = Trajectory.read(exported / "eval" / "trajectories.npz")
    assert trial.freq[world] == freq and len(trial.time) == 100
    name, header, storage = read_sto(exported / "out" / f"trajectory_{freq}Hz.sto")
    comma = read_csv(exported / "out" / f"trajectory_{freq}Hz.csv")
    assert name == f"posture_{freq}_Hz" and header["version"] == "1" and header["inDegrees"] == "no"
    assert next(iter(storage)) == "time" and next(iter(comma)) == "time_s"
    names = []
    for name, unit, values in signals(trial, world):
        np.testing.assert_array_equal(storage[name], values, name)
        np.testing.assert_array_equal(comma[name + unit], values, name)
        names.append((name, name + unit))
    assert set(storage) == {name for name, _ in names} | {"foot_loaded"}
    assert set(comma) == {heading for _, heading in names} | {"foot_loaded"}
    assert np.ptp(storage["head_x"]) > 0.01  # it moves


def test_in_degrees_converts_only_angles_and_angular_velocities(tmp_path):
    trial = trajectory()
    assert write_sto(trial, 0, tmp_path / "rad.sto", in_degrees=False)
    assert write_sto(trial, 0, tmp_path / "deg.sto", in_degrees=True)
    _, radians, plain = read_sto(tmp_path / "rad.sto")
    _, degrees, turned = read_sto(tmp_path / "deg.sto")
    assert radians["inDegrees"] == "no" and degrees["inDegrees"] == "yes"
    for name, values in plain.items():
        factor = 180 / np.pi if name.endswith(("_angle", "_velocity")) else 1.0
        np.testing.assert_allclose(turned[name], factor * values, rtol=1e-15)


def test_nan_after_a_fall_and_without_load(tmp_path):
    cop_x, head_x = trajectory().cop_x.copy(), trajectory().head_x.copy()
    cop_x[1, 1] = np.nan  # feet without load
    cop_x[3:, 1] = head_x[3:, 1] = np.nan  # fallen
    trial = trajectory(cop_x=cop_x, head_x=head_x)
    assert trial.fall_step[1] == 3
    assert write_sto(trial, 1, tmp_path / "a.sto", in_degrees=False)
    write_csv(trial, 1, tmp_path / "a.csv")
    name, _, storage = read_sto(tmp_path / "a.sto")
    assert name == "posture_ramp"  # the frequency is nan
    np.testing.assert_array_equal(storage["head_x"], head_x[:3, 1])
    np.testing.assert_array_equal(storage["cop_x"], [cop_x[0, 1], 0.0, cop_x[2, 1]])
    np.testing.assert_array_equal(storage["foot_loaded"], [1, 0, 1])
    comma = read_csv(tmp_path / "a.csv")
    np.testing.assert_array_equal(comma["cop_x_m"], cop_x[:, 1])
    np.testing.assert_array_equal(comma["head_x_m"], head_x[:, 1])
    np.testing.assert_array_equal(comma["foot_loaded"], [1, 0, 1, 0, 0])


def test_opensim_reads_every_row(exported, tmp_path, monkeypatch):
    """If OpenSim is installed (pip install opensim): through its table and its older storage class."""
    monkeypatch.chdir(tmp_path)  # importing it writes a log into the working directory
    opensim_ = pytest.importorskip("opensim")
    path = exported / "out" / "trajectory_0.5Hz.sto"
    comma = read_csv(path.with_suffix(".csv"))
    rows = opensim_.TimeSeriesTable(str(path))
    np.testing.assert_array_equal(rows.getMatrix().to_numpy(), np.stack(list(comma.values())[1:], axis=1))
    storage, head = opensim_.Storage(str(path)), opensim_.ArrayDouble()
    storage.getDataColumn("head_x", head)
    assert storage.getName() == "posture_0.5_Hz" and not storage.isInDegrees() and storage.getSize() == 100
    assert [head.get(row) for row in range(head.getSize())] == comma["head_x_m"].tolist()


def test_no_storage_file_after_a_fall_in_the_first_step(tmp_path):
    assert not write_sto(trajectory(fall_step=np.array([0, -1, -1])), 0, tmp_path / "a.sto", in_degrees=False)
    assert list(tmp_path.iterdir()) == []


def test_ramp_is_one_file(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    ramp = "env.ramp={start: 0.2, rate: 0.5, duration: 1.0}"
    call(monkeypatch, "export", "what=[trajectories]", ramp, TRIAL[1])
    (folder,) = Path("runs").iterdir()
    assert {path.name for path in (folder).iterdir()} == {
        "trajectory_ramp.sto", "trajectory_ramp.csv", "export.yaml",
    }  # fmt: skip
    _, _, storage = read_sto(folder / "trajectory_ramp.sto")
    time = storage["time"]
    ramped = np.minimum(time, 1.0)
    # A (1 - cos(phase)), with the integral of 2 pi f as phase; f stays at 0.7 Hz after the ramp.
    phase = 2 * np.pi * (0.2 * ramped + 0.25 * ramped**2 + 0.7 * (time - ramped))
    np.testing.assert_allclose(storage["target_x"], 0.1 * (1 - np.cos(phase)), atol=1e-5)


def test_onnx_gives_the_actions_of_the_policy(session, shipped):
    """For observations with twice the spread of those in training, in batches of any size."""
    _, _, policy = shipped
    normaliser = policy.obs_normalizer
    draw = torch.Generator().manual_seed(7)
    for count in (1, 3, 1000):
        seen = normaliser.mean + 2.0 * normaliser.std * torch.randn(count, 18, generator=draw)
        with torch.inference_mode():
            expected = policy({"policy": seen[:, :16], "target_motion": seen[:, 16:]}).numpy()
        (given,) = session.run(None, {"observation": seen.numpy()})
        assert given.shape == (count, 2) and given.dtype == np.float32
        assert np.abs(given - expected).max() < 1e-5
        assert np.ptp(expected) > 0.1 or count == 1


def test_onnx_against_the_network_in_numpy(session, shipped):
    """In double precision: (x - mean) / (std + 0.01), then affine layers with x sigmoid(x) between them."""
    model, _, _ = shipped
    weights = {name: value.double().numpy() for name, value in checkpoint.load(model, "cpu")["actor_state_dict"].items()}
    seen = np.random.default_rng(3).normal(weights["obs_normalizer._mean"], weights["obs_normalizer._std"], (50, 18))
    x = (seen - weights["obs_normalizer._mean"]) / (weights["obs_normalizer._std"] + 0.01)
    for layer in (0, 2, 4):
        x = x @ weights[f"mlp.{layer}.weight"].T + weights[f"mlp.{layer}.bias"]
        x = x / (1 + np.exp(-x)) if layer < 4 else x
    (given,) = session.run(None, {"observation": seen.astype(np.float32)})
    np.testing.assert_allclose(given, x, atol=1e-4)


def test_rollout_with_onnxruntime(session, shipped):
    _, run, policy = shipped
    values = run.evaluation.model_dump() | {"freq": FREQ, "duration": 1.66, "transient": 0.0}
    trial = trial_config(run.env, EvaluationConfig(**values), AS_TRAINED, "cpu")

    def roll_out(act):
        return rollout(HeadTrackingEnv(trial, run.seed, "cpu"), act, torch.tensor(FREQ, dtype=torch.float64), 1.66)

    def onnx(seen):
        observation = torch.cat([seen["policy"], seen["target_motion"]], dim=1)
        return torch.from_numpy(session.run(None, {"observation": observation.numpy()})[0])

    one = roll_out(policy)
    other = roll_out(onnx)
    assert len(one.time) == 100 and np.ptp(one.joint_angle, axis=0).min() > 0.01
    for name in ("joint_angle", "joint_velocity", "head_x", "cop_x"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), atol=1e-4, err_msg=name)
    np.testing.assert_allclose(other.joint_torque / 100.0, one.joint_torque / 100.0, atol=1e-4)


def test_metadata_of_the_onnx_file(exported, shipped):
    model, run, _ = shipped
    proto = onnx.load(exported / "out" / "policy.onnx")
    metadata = {entry.key: entry.value for entry in proto.metadata_props}
    assert [value.name for value in proto.graph.input] == ["observation"]
    assert [value.name for value in proto.graph.output] == ["action"]
    assert [entry["name"] for entry in json.loads(metadata["action"])] == list(KINDS)
    components = [(entry["name"], entry["unit"]) for entry in json.loads(metadata["observation"])]
    assert components == [
        ("hip_angle_mean", "rad"), ("ankle_angle_mean", "rad"), ("hip_velocity_mean", "rad/s"),
        ("ankle_velocity_mean", "rad/s"), ("torso_pitch", "rad"), ("torso_vx", "m/s"), ("torso_vz", "m/s"),
        ("torso_wy", "rad/s"), ("feet_x_mean", "m"), ("feet_z_mean", "m"), ("head_x", "m"), ("head_vx", "m/s"),
        ("hip_last_action", "1"), ("ankle_last_action", "1"), ("target_x", "m"), ("target_x_minus_head_x", "m"),
        ("target_vx", "m/s"), ("target_ax", "m/s2"),
    ]  # fmt: skip
    assert float(metadata["torque_limit_nm"]) == 100.0 and float(metadata["control_dt_s"]) == 0.0166
    assert not (exported / "out" / "policy.onnx.data").exists()  # the weights are inside


def test_metadata_tell_of_delays_and_muscles(shipped):
    model, run, _ = shipped
    exact, human = (onnx_policy.metadata(one, model) for one in (run, compose("env=human", "agent=human")))
    assert "activation" not in exact["torque"] and "delay" not in exact
    assert "x activation" in human["torque"] and "exp(-control_dt_s / 0.05)" in human["torque"]
    assert human["delay"].startswith("observations are those of 6 steps before")  # 0.1 s / 0.0166 s


def test_names_of_the_components_belong_to_their_values():
    """Every term, for a state with known numbers."""

    def exact(values):
        return torch.tensor(values, dtype=torch.float64)

    number = {joint: value for value, joint in enumerate(JOINTS, 1)}
    force = exact([[[[1, 2, 3], [10, 20, 30]], [[100, 200, 300], [1000, 2000, 3000]]]])  # foot, end, axis
    place = exact([0.1, 0.0, -0.05]).expand(1, 2, 2, 3)
    turned = [0.0, 0.0, np.sin(0.15), np.cos(0.15)]  # by 0.3 rad about z
    level = [0.0, 0.0, 0.0, 1.0]
    state = TaskState(
        hat_pose=exact([[0.11, 0.12, 1.3, *turned]]),
        hat_velocity=exact([[0.21, 0.22, 0.23, 0.24, 0.25, 0.26]]),
        foot_pose=exact([[[0.31, 0.32, 0.33, *level], [0.35, 0.36, 0.39, *level]]]),
        foot_displacement=exact([[0.0, 0.0]]),
        head_x=exact([0.5]), head_vx=exact([0.6]),
        target_x=exact([0.75]), target_vx=exact([0.8]), target_ax=exact([0.9]),
        target_freq=exact([1.1]), target_past=exact([[0.75 - 0.01 * i for i in range(1, PAST + 1)]]),
        action=exact([[0.01 * number[joint] for joint in ("hip_left", "ankle_left") * 2]]),
        command=exact([[0.01 * number[joint] for joint in ("hip_left", "ankle_left") * 2]]),
        joint_angle=exact([[float(number[joint]) for joint in JOINTS]]),
        joint_velocity=exact([[10.0 * number[joint] for joint in JOINTS]]),
        joint_force=exact([[100.0 * number[joint] for joint in JOINTS]]),
        sole_force=force, sole_position=place,
        hip_k=exact([60.0]), ankle_k=exact([30.0]), load=exact([2.0]), joint_damping=exact([1.5]), friction=exact([0.9]),
        amplitude=exact([0.08]), tolerance=exact([0.02]),
    )  # fmt: skip
    expected = {
        "hip_k": 60.0, "ankle_k": 30.0, "load": 2.0, "joint_damping": 1.5, "friction": 0.9, "amplitude": 0.08,
        "tolerance": 0.02,
        "torso_z": 1.3, "torso_vx": 0.21, "torso_vy": 0.22, "torso_vz": 0.23, "torso_wx": 0.24, "torso_wy": 0.25,
        "torso_wz": 0.26, "torso_pitch": 0.0, "torso_yaw": 0.3, "torso_roll": 0.0, "torso_upright": 1.0,
        "foot_left_x": 0.31, "foot_left_y": 0.32, "foot_left_z": 0.33,
        "foot_right_x": 0.35, "foot_right_y": 0.36, "foot_right_z": 0.39, "feet_x_mean": 0.33, "feet_z_mean": 0.36,
        # The moment r x F of r = (a, 0, c) is (-c Fy, c Fx - a Fz, a Fy).
        "foot_left_fx": 11, "foot_left_fy": 22, "foot_left_fz": 33,
        "foot_left_mx": 1.1, "foot_left_my": -0.55 - 3.3, "foot_left_mz": 2.2,
        "foot_right_fx": 1100, "foot_right_fy": 2200, "foot_right_fz": 3300,
        "foot_right_mx": 110, "foot_right_my": -385, "foot_right_mz": 220,
        "heels_fz": 303, "toes_fz": 3030, "head_x": 0.5, "head_vx": 0.6,
        "target_x": 0.75, "target_vx": 0.8, "target_ax": 0.9, "target_x_minus_head_x": 0.25,
        "target_freq": 1.1, **{f"target_moved_in_{PAST_STEPS * i}_steps": 0.01 * i for i in range(1, PAST + 1)},
        "hip_angle_mean": (number["hip_left"] + number["hip_right"]) / 2,
        "ankle_angle_mean": (number["ankle_left"] + number["ankle_right"]) / 2,
        "hip_velocity_mean": 5.0 * (number["hip_left"] + number["hip_right"]),
        "ankle_velocity_mean": 5.0 * (number["ankle_left"] + number["ankle_right"]),
        "hip_passive_torque": -(60 + 15) * (number["hip_left"] + number["hip_right"]) / 2,
        "ankle_passive_torque": -(30 + 15) * (number["ankle_left"] + number["ankle_right"]) / 2,
        "hip_last_action": 0.01 * number["hip_left"], "ankle_last_action": 0.01 * number["ankle_left"],
    }  # fmt: skip
    for joint in JOINTS:
        kind = joint.split("_")[0]
        expected |= {f"{joint}_angle": number[joint], f"{joint}_velocity": 10 * number[joint]}
        expected |= {f"{joint}_torque_with_spring_and_damper": 100 * number[joint]}
        expected |= {f"{joint}_last_action": 0.01 * number[f"{kind}_left"]}
    named = set()
    for key, term in TERMS.items():
        for (name, _), value in zip(term.components, term.function(state)[0].tolist(), strict=True):
            assert value == pytest.approx(expected[name], abs=1e-9), (key, name)
            named.add(name)
    assert named == expected.keys()


def test_network_without_normalisation_and_with_other_observations(tmp_path):
    run = compose("env=authors_code", "agent.actor.obs_normalization=false")
    checkpoint = tmp_path / "model_1.pt"
    checkpoint.write_bytes(b"only its checksum is used")
    policy = network(run, "actor").eval()
    assert write_onnx(policy, run, checkpoint, tmp_path / "policy.onnx") <= 1e-5
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx", providers=["CPUExecutionProvider"])
    names = [entry["name"] for entry in json.loads(session.get_modelmeta().custom_metadata_map["observation"])]
    assert session.get_inputs()[0].shape[1] == len(names) == len(set(names)) == 47


def full_disk(*_):
    raise OSError(28, "No space left on device", "policy.onnx")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [("TOLERANCE", -1.0, "differ from the policy's"), ("replacing", full_disk, "No space left on device")],
)
def test_no_file_after_a_failure(monkeypatch, capsys, tmp_path, name, value, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(onnx_policy, name, value)
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "export", "what=[policy]", "out=out")
    lines = capsys.readouterr().err.strip().splitlines()
    assert stop.value.code == 1 and len(lines) == 1 and message in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_missing_packages(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)  # import fails as if it were not installed
    line = refused(monkeypatch, capsys, "export")
    assert "onnxruntime" in line and "pip install" in line and "what=[trajectories]" in line
    assert list(tmp_path.iterdir()) == []
    call(monkeypatch, "export", "what=[trajectories]", "out=out", "evaluation.freq=[0.5]", TRIAL[1])
    assert {path.suffix for path in Path("out").iterdir()} == {".sto", ".csv", ".yaml"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ckpt=nowhere"], "no such file or folder"),
        (["ckpt=pretrained/none"], "no such policy"),
        ([f"ckpt={run_dir.PRETRAINED}"], "policies; allowed is one, for example"),
        (["ckpt=''"], "must not be empty"),
        (["out=/proc/export"], "cannot write to the folder /proc/export"),
        (["out=/proc/export", "what=[policy]"], "cannot write to the folder /proc/export"),
        (["what=[]"], "must be at least 1"),
        (["what=[video]"], "'trajectories' or 'policy'"),
        (["evaluation.freq=[0.5,0.9,0.5]"], "0.5 Hz is listed twice"),
        (["evaluation.freq=[0]"], "greater than or equal to 0.001"),
        (["evaluation.duration=0.005"], "evaluation.duration = 0.005: shorter than a control step"),
        (["in_degrees=3"], "in_degrees"),
        (["env.hip=3"], "no such key"),
        (["device=abacus"], "allowed are cpu, cuda"),
    ],
)
def test_bad_input(monkeypatch, capsys, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(monkeypatch, capsys, "export", *arguments)
    assert list(tmp_path.iterdir()) == []
