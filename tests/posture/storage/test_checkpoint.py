"""A checkpoint is refused unless it is complete, from this project, and holds only numbers."""

import hashlib
import io
import os
import pickle
import warnings
import zipfile

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from posture.config.errors import ConfigError
from posture.storage import checkpoint
from posture.storage.run_dir import PRETRAINED

CONTENT = {"actor_state_dict": {"weight": torch.arange(6.0).reshape(2, 3)}, "iter": 3}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "model_3.pt"
    checkpoint.save(CONTENT, path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged") / "model_3.pt"


def refusal(path):
    with warnings.catch_warnings(record=True) as warned, pytest.raises(ConfigError) as refused:
        warnings.simplefilter("always")
        checkpoint.load(path, "cpu")
    # A warning would be a second line; those of files that earlier tests left open come whenever memory is freed.
    assert not [str(one.message) for one in warned if not issubclass(one.category, ResourceWarning)]
    line = str(refused.value)
    assert line.startswith(f"{path}: ") and "\n" not in line
    return line


def test_a_checkpoint_is_a_zip_archive_that_ends_in_its_digest(whole):
    """Checked with the standard library; torch reads the file without our code."""
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        comment = archive.comment
        assert archive.testzip() is None
    assert whole.endswith(comment)
    assert comment.decode() == "sha256:" + hashlib.sha256(whole.removesuffix(comment)).hexdigest()
    stock = torch.load(io.BytesIO(whole), weights_only=True)
    assert stock["iter"] == 3 and torch.equal(stock["actor_state_dict"]["weight"], CONTENT["actor_state_dict"]["weight"])


def test_every_flipped_bit_and_every_truncation_is_detected(whole, place, monkeypatch):
    """Every one of them, in a small file."""
    for byte in range(len(whole)):
        flipped = [whole[:byte] + bytes([whole[byte] ^ 1 << bit]) + whole[byte + 1 :] for bit in range(8)]
        for harmed in (*flipped, whole[:byte]):
            monkeypatch.setattr(checkpoint, "_read", lambda path, harmed=harmed: harmed)
            refusal(place)
    monkeypatch.setattr(checkpoint, "_read", lambda path: whole)
    assert checkpoint.load(place, "cpu")["iter"] == 3


@settings(deadline=None, max_examples=200)
@given(data=st.data())
def test_random_damage_to_a_shipped_policy_is_detected(place, data):
    """Bytes overwritten, removed or inserted somewhere in a file of realistic size."""
    good = next(PRETRAINED.glob("default/model_*.pt")).read_bytes()
    start = data.draw(st.integers(0, len(good)))
    end = data.draw(st.integers(start, len(good)))
    bad = good[:start] + data.draw(st.binary(max_size=100)) + good[end:]
    place.write_bytes(bad)
    if bad == good:
        assert checkpoint.load(place, "cpu")["iter"] == 900
    else:
        refusal(place)


@settings(deadline=None, max_examples=200)
@given(noise=st.binary(max_size=300), head=st.sampled_from([b"", b"PK\x03\x04", b"\x80\x02", b"\x89PNG\r\n\x1a\n"]))
def test_noise_is_refused_in_one_line_even_with_a_correct_digest(place, noise, head):
    place.write_bytes(head + noise)
    refusal(place)
    place.write_bytes(checkpoint.sealed(head + noise + b"\0\0"))
    refusal(place)


def test_a_path_that_is_not_a_file_is_refused(tmp_path):
    assert "no such checkpoint" in refusal(tmp_path / "model_1.pt")
    assert "not a file" in refusal(tmp_path)
    os.mkfifo(tmp_path / "model_2.pt")  # reading it would block
    assert "not a file" in refusal(tmp_path / "model_2.pt")
    (tmp_path / "model_3.pt").symlink_to("/dev/zero")
    assert "not a file" in refusal(tmp_path / "model_3.pt")
    (tmp_path / "model_4.pt").symlink_to(tmp_path / "model_4.pt")
    assert "cannot be read" in refusal(tmp_path / "model_4.pt")
    assert "cannot be read" in refusal(tmp_path / ("m" * 300))


class Payload:
    """Pickled, a call that unpickling would make."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


def archive_of(thing):
    file = io.BytesIO()
    torch.save(thing, file)
    return file.getvalue()


@pytest.mark.parametrize("function", ["system", "exec", "eval", "open", "getenv"])
def test_code_in_a_checkpoint_is_not_executed(tmp_path, monkeypatch, capfd, function):
    """Each file has a correct digest; torch without `weights_only` executes the code."""
    canary, secret = tmp_path / "canary", "the-secret-of-the-environment"
    monkeypatch.setenv("CANARY", secret)
    payload = {
        "system": Payload(os.system, f"touch {canary}"),
        "exec": Payload(exec, f"open({str(canary)!r}, 'w').close()"),
        "eval": Payload(eval, f"open({str(canary)!r}, 'w').close()"),
        "open": Payload(open, str(canary), "w"),
        "getenv": Payload(os.getenv, "CANARY"),
    }[function]
    path = tmp_path / "model_1.pt"
    path.write_bytes(checkpoint.sealed(archive_of({"actor_state_dict": payload, "iter": 1})))
    assert "holds more than tensors and plain values" in refusal(path)
    assert not canary.exists()
    assert secret not in refusal(path) + capfd.readouterr().out
    content = torch.load(path, weights_only=False)
    assert canary.exists() or content["actor_state_dict"] == secret  # the payload works without the protection


@pytest.mark.filterwarnings("ignore:.torch.jit:DeprecationWarning")
@pytest.mark.parametrize("form", ["legacy torch", "bare pickle", "TorchScript"])
def test_code_in_other_forms_that_torch_loads_is_not_executed(tmp_path, form):
    canary, path = tmp_path / "canary", tmp_path / "model_1.pt"
    payload = Payload(os.system, f"touch {canary}")
    file = io.BytesIO()
    if form == "legacy torch":
        torch.save({"actor_state_dict": payload}, file, _use_new_zipfile_serialization=False)
    elif form == "bare pickle":
        pickle.dump({"actor_state_dict": payload}, file)
    else:
        torch.jit.save(torch.jit.trace(torch.nn.Linear(2, 2), torch.zeros(1, 2)), file)
    path.write_bytes(file.getvalue())
    refusal(path)
    path.write_bytes(checkpoint.sealed(file.getvalue() + (b"" if form == "TorchScript" else b"\0\0")))
    refusal(path)
    assert not canary.exists()


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch, whole):
    """And nothing beside it."""
    path = tmp_path / "model_3.pt"
    path.write_bytes(whole)

    def disk_full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", disk_full)
    with pytest.raises(OSError, match="No space left"):
        checkpoint.save({"iter": 4}, path)
    assert path.read_bytes() == whole and list(tmp_path.iterdir()) == [path]
