"""python -m posture.play as users meet it: one clear line for bad input, a taken port, Ctrl-C, and the recording."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from posture.config.play import PlayConfig
from posture.play.__main__ import play
from tests import commands
from tests.commands import call, refused

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(commands.ENTRIES, "play", (PlayConfig, play))


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
        ("hip_k=300", ["hip_k = 300: allowed is 0..250"]),
        ("amplitude=0.3", ["amplitude = 0.3: allowed is 0.05..0.12"]),
        ("tolerance=nan", ["tolerance", "finite"]),
        ("sliders.freq=[1,0.5,0.1]", ["sliders.freq: goes from low to high"]),
        ("sliders.tolerance=[0.01,0.06,0.01]", ["to stand still is good enough", "0.05 m"]),
        ("visitors=0", ["visitors = 0"]),
        ("slow_motion=2", ["slow_motion = 2"]),
        ("push.force=500", ["push.force = 500", "push.limit = 150"]),
        ("speed=2", ["speed"]),
        ("record=out.txt", ["record = out.txt: the name must end in .html"]),
        ("recording.freq=[0.5,3]", ["recording.freq: a ramp goes up within 0.05..1.5 Hz"]),
        ("record=/proc/x/out.html", ["cannot write to the folder /proc/x"]),
    ],
)
def test_bad_input(monkeypatch, capsys, argument, expected):
    line = refused(monkeypatch, capsys, "play", argument)
    for part in expected:
        assert part in line


def test_a_damaged_checkpoint_is_told_of_before_the_page_opens(monkeypatch, capsys, tmp_path):
    shipped = next((ROOT / "posture/pretrained/default").glob("config.yaml"))
    (tmp_path / "config.yaml").write_text(shipped.read_text())
    (tmp_path / "model_3.pt").write_bytes(b"damaged")
    assert "not a checkpoint" in refused(monkeypatch, capsys, "play", f"ckpt={tmp_path / 'model_3.pt'}", "port=0")


def test_a_port_in_use_is_one_clear_line(monkeypatch, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        line = refused(monkeypatch, capsys, "play", f"port={port}")
    assert line == f"error: port = {port}: is in use on this machine; choose another, as port={port + 1}, or port=0 for any"


def started(folder, *arguments):
    # A process group of its own, as a terminal's Ctrl-C goes to all of it.
    return subprocess.Popen(
        [sys.executable, "-m", "posture.play", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "GIT_PYTHON_REFRESH": "quiet"},
        start_new_session=True,
    )


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_by_a_signal(tmp_path, number, code):
    process = started(tmp_path, "port=0")
    line = process.stdout.readline()
    assert line.startswith("posture: http://127.0.0.1:"), line + process.stderr.read()
    port = int(line.split(":")[3].split()[0])
    with socket.create_connection(("127.0.0.1", port), timeout=5):
        pass
    os.killpg(process.pid, number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == code
    assert out == "" and "Traceback" not in err and "error" not in err
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port), timeout=1)


def test_stopped_while_it_starts(tmp_path):
    process = started(tmp_path, "port=0")
    time.sleep(1.5)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and out == "" and "Traceback" not in err


def test_only_this_machine_can_reach_it(tmp_path):
    process = started(tmp_path, "port=0")
    try:
        port = int(process.stdout.readline().split(":")[3].split()[0])
        listening = [
            line.split()[1] for line in Path("/proc/net/tcp").read_text().splitlines()[1:] if line.split()[3] == "0A"
        ]
        assert f"0100007F:{port:04X}" in listening, "127.0.0.1"
        assert f"00000000:{port:04X}" not in listening
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.communicate(timeout=30)


def test_a_recording_is_one_small_file(monkeypatch, capsys, tmp_path):
    short = ["recording.freq=[0.7,0.75]", "recording.hold=0.5", "ramp_rate=0.1", "frames_per_s=10"]
    call(monkeypatch, "play", "record=made/out.html", *short)
    page = (tmp_path / "made/out.html").read_text()
    assert "out.html: " in capsys.readouterr().out
    assert len(page) < 5e6 and "__VISER_EMBED_DATA__" in page
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == ["out.html"]


def test_a_stander_that_falls_is_not_recorded(monkeypatch, capsys, tmp_path):
    # Trained with hips of 200 Nm/rad, in a body with hips of none and the heaviest load.
    with pytest.raises(SystemExit) as stop:
        call(
            monkeypatch, "play", "record=out.html", "ckpt=pretrained/hip_k-200", "hip_k=0", "ankle_k=0", "load=8",
            "recording.freq=[1.4,1.5]", "recording.hold=20", "frames_per_s=5",
        )  # fmt: skip
    told = capsys.readouterr().err
    assert stop.value.code == 1 and "error: the stander fell" in told and "Traceback" not in told
    assert not (tmp_path / "out.html").exists()
