"""Trainings that differ in code or versions, and results that were left out, are named."""

from dataclasses import replace

import pytest

from posture.reproduce.page.provenance import how_it_was_made, training_table, warnings
from posture.reproduce.reproduction import Training


def start(code: str = "aaaa", newton: str = "1.8.0") -> dict[str, object]:
    about = {"platform": "Linux", "python": "3.11.7", "git_commit": "c0de", "started": "2026-11-25T10:00:00"}
    return {**about, "training_code": code, "versions": {"newton": newton, "torch": "2.13.0"}}


TRAININGS = [Training("frequency", f"seed-{seed}", seed, True, 1800.0, [start()]) for seed in range(1, 6)]


def with_starts(place: int, *starts: dict[str, object]) -> list[Training]:
    changed = list(TRAININGS)
    changed[place] = replace(changed[place], starts=list(starts))
    return changed


@pytest.mark.parametrize(
    ("trainings", "text"),
    [
        (with_starts(1, start("bbbb")), "the learner: `aaaa` in 4 trainings, `bbbb` in 1 training (seed-2). "),
        (with_starts(4, start(newton="1.9.0")), "in newton: `1.8.0` in 4 trainings, `1.9.0` in 1 training (seed-5). "),
        # Resumed by other code.
        (with_starts(0, start(), start("bbbb")), "`aaaa` in 5 trainings, `bbbb` in 1 training (seed-1). "),
    ],
)
def test_trainings_that_differ_are_named(trainings: list[Training], text: str) -> None:
    (warning,) = warnings(trainings, [])
    assert warning.startswith("**These results are mixed:**") and text in warning and "torch" not in warning


def test_no_warning_without_differences() -> None:
    assert warnings(TRAININGS, []) == []
    earlier = start() | {"training_code": None, "envs_version": "aaaa"}  # a training of an earlier version
    assert warnings(with_starts(0, earlier), []) == []
    unfinished = replace(TRAININGS[1], done=False, starts=[start("bbbb")])
    assert warnings([*TRAININGS, unfinished], []) == []


def test_results_left_out_are_named() -> None:
    (warning,) = warnings(TRAININGS, ["runs/frequency/seed-1_older"])
    assert "1 (`runs/frequency/seed-1_older`)" in warning


def test_trainings_and_their_origin() -> None:
    trainings = [*TRAININGS, Training("energy", "gamma-0", 1)]
    rows = [["frequency", "5 of 5", "1, 2, 3, 4, 5", "2.5"], ["energy", "0 of 1", "-", "0.0"]]
    assert training_table(trainings).rows == rows
    text = how_it_was_made(trainings, ["python -m posture.train"])
    assert "on Linux, Python 3.11.7, with newton 1.8.0, torch 2.13.0" in text
    assert "```sh\npython -m posture.train\n```" in text
