"""Commands whose output cannot be written: their work goes on to its end."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from posture.cli import output
from tests.commands import TINY

PRINTS = """
import contextlib, os, sys
from pathlib import Path
from posture.cli import output
output.install()
file = os.open("results", os.O_CREAT | os.O_WRONLY)
for _ in range(3):
    print("x" * 100_000, "r\\xe9sultat \\N{BALLOT X} \\udcff")
    print("progress", file=sys.stderr, flush=True)
with contextlib.suppress(OSError):
    os.write(2, b"of a library in C")
os.write(file, b"complete")
print("the end")
"""


def shell(command, cwd, **variables):
    """`command` in a shell, with $PYTHON for this Python and $PRINTS for a program that prints."""
    env = os.environ | {"PYTHON": sys.executable, "PRINTS": PRINTS} | variables
    return subprocess.run(["bash", "-c", command], cwd=cwd, env=env, capture_output=True, timeout=100)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="POSIX only")
@pytest.mark.parametrize(
    "redirection",
    ["| head -c 1; exit ${PIPESTATUS[0]}", "2>&1 | true; exit ${PIPESTATUS[0]}", ">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"]
    + [">/dev/full 2>&1"],
)
def test_work_goes_on_without_its_output(tmp_path, redirection):
    done = shell(f'"$PYTHON" -c "$PRINTS" {redirection}', tmp_path)
    assert done.returncode == 0 and b"Traceback" not in done.stderr
    assert (tmp_path / "results").read_bytes() == b"complete"  # and nothing of what was printed


@pytest.mark.parametrize(("unbuffered", "encoding"), [("", "ascii"), ("1", "cp1252"), ("", "utf-8")])
def test_characters_that_an_encoding_lacks(tmp_path, unbuffered, encoding):
    done = shell('"$PYTHON" -c "$PRINTS"', tmp_path, PYTHONIOENCODING=encoding, PYTHONUNBUFFERED=unbuffered)
    lines = done.stdout.decode(encoding).splitlines()
    expected = "r\xe9sultat \N{BALLOT X}".encode(encoding, "backslashreplace").decode(encoding) + r" \udcff"
    assert done.returncode == 0 and [line.lstrip("x") for line in lines] == 3 * [f" {expected}"] + ["the end"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
def test_a_full_pipe_that_does_not_block_loses_nothing(tmp_path):
    read, write = os.pipe()
    os.set_blocking(write, False)
    with subprocess.Popen([sys.executable, "-c", PRINTS], cwd=tmp_path, stdout=write, stderr=subprocess.DEVNULL) as process:
        os.close(write)
        with open(read, "rb") as pipe:
            assert pipe.read().count(b"x") == 300_000
    assert process.returncode == 0


def test_outputs_of_a_notebook_or_a_test_are_kept(capsys):
    before = sys.stdout, sys.stderr
    output.install()
    assert (sys.stdout, sys.stderr) == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="POSIX only")
def test_a_log_on_a_full_disk():
    with output.log_file(Path("/dev/full")) as log:
        print("line", file=log, flush=True)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
def test_a_training_without_a_reader_is_completed(tmp_path):
    """All its output, also that of Hydra, rsl-rl and rich, goes to a pipe that is closed."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "posture.train", *TINY, "evaluate=false", "hydra.run.dir=run"]
    done = subprocess.run(command, cwd=tmp_path, stdout=write, stderr=write, timeout=100)
    os.close(write)
    assert done.returncode == 0 and (tmp_path / "run" / "model_2.pt").is_file()


def test_what_a_signal_interrupts_after_it_was_written_is_written_once():
    class Interrupted(io.RawIOBase):
        written = b""

        def write(self, data):
            self.written += bytes(data)
            raise KeyboardInterrupt

    raw = Interrupted()
    stream = output._text(raw, "utf-8", True)
    with pytest.raises(KeyboardInterrupt):
        print("the address", file=stream, flush=True)
    raw.write = lambda data: raw.__setattr__("written", raw.written + bytes(data)) or len(data)
    print("the end", file=stream, flush=True)
    assert raw.written == b"the address\nthe end\n"
