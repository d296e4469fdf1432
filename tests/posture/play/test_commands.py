"""python -m posture.play: errors in one line, a port in use, signals, and the recording."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.commands import call, refused

pytestmark = pytest.mark.usefixtures("elsewhere")

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("port=99999", ["port = 99999", "less than or equal to 65535"]),
        ("port=-1", ["port = -1"]),
        ("port=http", ["port = 'http'", "integer"]),
        ("ckpt=pretrained/none", ["pretrained/none: no such policy", "default"]),
        ("ckpt=nowhere", ["nowhere: no such file or folder"]),
        ("freq=9", ["freq = 9: allowed is 0.05..1.5"]),
        ("freq=0", ["freq = 0"]),
        ("freq=fast", ["freq = 'fast'"]),
        ("hip_k=-5", ["hip_k = -5"]),
        ("hip_k=300", ["hip_k = 300: allowed is 25..200"]),
        ("body.mass=300", ["body.mass = 300", "less than or equal to 200"]),
        ("body.mass=30", ["body.mass = 30: allowed is 40..120"]),
        ("sliders.height=[1.9,1.5,0.1]", ["sliders.height: "]),
        ("amplitude=0.3", ["amplitude = 0.3: allowed is 0.05..0.12"]),
        ("tolerance=nan", ["tolerance", "finite"]),
        ("sliders.freq=[1,0.5,0.1]", ["sliders.freq: "]),
        ("sliders.tolerance=[0.01,0.06,0.01]", ["sliders.tolerance: ", "0.05 m"]),
        ("visitors=0", ["visitors = 0"]),
        ("slow_motion=2", ["slow_motion = 2"]),
        ("push.force=500", ["push.force = 500", "push.limit = 150"]),
        ("speed=2", ["speed"]),
        ("record=out.txt", ["record = out.txt: the name must end in .html"]),
        ("recording.freq=[0.5,3]", ["recording.freq: ", "0.05..1.5 Hz"]),
        ("record=/proc/x/out.html", ["cannot write to the folder /proc/x"]),
        (f"record={'x' * 251}.html", ["a path has", "255"]),
        ("record=folder.html", ["cannot write the file folder.html: Is a directory"]),
    ],
)
def test_bad_input(monkeypatch, capsys, argument, expected):
    Path("folder.html").mkdir()
    line = refused(monkeypatch, capsys, "play", argument)
    assert [part for part in expected if part not in line] == []


def test_damaged_checkpoint_is_refused_before_the_page_opens(monkeypatch, capsys, tmp_path):
    (tmp_path / "config.yaml").write_text((ROOT / "posture/pretrained/default/config.yaml").read_text())
    (tmp_path / "model_3.pt").write_bytes(b"damaged")
    assert "not a checkpoint" in refused(monkeypatch, capsys, "play", f"ckpt={tmp_path / 'model_3.pt'}", "port=0")


@pytest.mark.parametrize("how", ["port=0", "record=session.html"])
def test_body_whose_scaled_joints_are_not_allowed_is_refused(monkeypatch, capsys, how):
    arguments = ["ckpt=lqr", "lqr.env.ankle_k=200", "body.mass=120", "body.height=1.8", "body.sex=male", how]
    line = refused(monkeypatch, capsys, "play", *arguments)
    assert "joints scaled to this body: ankle_k = 685.3" in line and "less than or equal to 400" in line


def test_port_in_use(monkeypatch, capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        line = refused(monkeypatch, capsys, "play", f"port={port}")
    assert line == f"error: port = {port}: in use on this machine; choose another, or port=0 for any free one"


@contextmanager
def running(folder):
    """The command in a process group of its own, as in a terminal, where Ctrl-C reaches the whole group."""
    process = subprocess.Popen(
        [sys.executable, "-m", "posture.play", "port=0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "GIT_PYTHON_REFRESH": "quiet"},
        start_new_session=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def stop(process, number):
    """Send a signal; the exit code, and what was printed after it to stdout and stderr."""
    os.killpg(process.pid, number)
    out, err = process.communicate(timeout=30)
    return process.returncode, out, err


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_page_is_local_and_stops_on_a_signal(tmp_path, number, code):
    with running(tmp_path) as process:
        line = process.stdout.readline()
        assert line.startswith("posture: http://127.0.0.1:"), line + process.stderr.read()
        port = int(line.split(":")[3].split()[0])
        with socket.create_connection(("127.0.0.1", port), timeout=5):
            pass
        sockets = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        listening = [row[1] for row in sockets if row[3] == "0A"]
        assert f"0100007F:{port:04X}" in listening and f"00000000:{port:04X}" not in listening
        *stopped, errors = stop(process, number)
    assert stopped == [code, ""] and "Traceback" not in errors and "error" not in errors, errors
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port), timeout=1)


def test_interrupted_during_start_up(tmp_path):
    with running(tmp_path) as process:
        time.sleep(1.5)
        *stopped, errors = stop(process, signal.SIGINT)
    # torch, interrupted while it is imported, may log a line at exit.
    assert stopped == [130, ""] and "Traceback" not in errors, errors


def test_recording_is_one_small_file(monkeypatch, capsys, tmp_path):
    short = ["recording.freq=[0.7,0.75]", "recording.hold=0.5", "ramp_rate=0.1", "frames_per_s=10"]
    name = "out" + "x" * (255 - len("out.html")) + ".html"  # as long as file systems allow
    call(monkeypatch, "play", f"record=made/{name}", *short)
    page = (tmp_path / "made" / name).read_text()
    assert f"{name}: " in capsys.readouterr().out
    assert len(page) < 5e6 and "__VISER_EMBED_DATA__" in page
    assert [path.name for path in (tmp_path / "made").iterdir()] == [name]


def test_recording_of_a_fall_is_refused(monkeypatch, capsys, tmp_path):
    # Trained with hips of 200 Nm/rad, in a body without springs and with the heaviest load.
    with pytest.raises(SystemExit) as stop:
        call(
            monkeypatch, "play", "record=out.html", "ckpt=pretrained/hip_k-200", "sliders.hip_k=[0,250,5]", "hip_k=0",
            "ankle_k=0", "load=8", "recording.freq=[1.4,1.5]", "recording.hold=20", "frames_per_s=5",
        )  # fmt: skip
    message = capsys.readouterr().err
    assert stop.value.code == 1 and "error: the stander fell" in message and "Traceback" not in message
    assert not (tmp_path / "out.html").exists()
