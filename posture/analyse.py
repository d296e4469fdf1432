"""Analyse recordings of people: the indices of `posture.eval` with intervals, figures, and the theory beside them.

python -m posture.analyse recording=trial.csv
python -m posture.analyse recording=trial.c3d 'columns.head=[LFHD.y,RFHD.y]' evaluation.transient=0
python -m posture.analyse 'recording=data/*.mot' 'subject=S\\d+' prediction=true
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from posture.cli import entry
from posture.config.analyse import AnalyseConfig
from posture.storage import provenance, run_dir, yaml_files

# Modules that import the physics, scipy or matplotlib are imported inside functions: bad input must not wait for them.

FILES = ("metrics.csv", "cycles.csv", "table.md", "analysis.yaml")
"""What every analysis writes, and what several recordings have beside it."""
GROUP_FILES = ("group.csv", "group.png")


def analyse_recordings(config: AnalyseConfig, folder: Path) -> None:
    """Analyse every recording that `config` names; print the tables, and write them and the figures to `folder`.

    All are analysed before the first file is written, so that a bad one leaves an earlier analysis as it was.
    """
    from posture.analysis.results import write_rows
    from posture.analysis.table import markdown_table, text_table
    from posture.recording.batch import analyse_all
    from posture.recording.files import find_recordings
    from posture.recording.group import group
    from posture.recording.tables import group_columns, notes, recording_columns
    from posture.storage.atomic import replacing

    paths = find_recordings(config.recording)
    pictures = figure_names(paths)
    run_dir.writable(folder, *FILES, *GROUP_FILES, *pictures)
    body = None
    if config.predicts:
        from envs.body.segments import read_segments

        body = read_segments(config.env)
    found = analyse_all(paths, config, body)
    trials = [trial for trial, _ in found]
    groups = group(trials, config.same_freq) if len(trials) > 1 else []

    def write(name: str, content: bytes) -> None:
        with replacing(folder / name) as temporary:
            temporary.write_bytes(content)
        written.append(name)

    def write_table(name: str, rows: list[dict[str, Any]]) -> None:
        if rows:
            write_rows(rows, folder / name)
            written.append(name)
        else:
            (folder / name).unlink(missing_ok=True)  # of an earlier analysis

    written: list[str] = []
    (folder / "analysis.yaml").unlink(missing_ok=True)  # it describes an earlier analysis
    write_table("metrics.csv", [trial.as_row(config.predicts) for trial in trials])
    write_table("cycles.csv", [row for trial in trials for row in trial.cycle_rows()])
    write_table("group.csv", [asdict(row) for row in groups])
    tables: list[Callable[[Callable[..., str]], str]] = [lambda form: form(trials, recording_columns(trials))]
    if groups:
        tables.append(lambda form: form(groups, group_columns(groups)))
    write("table.md", ("\n\n".join(table(markdown_table) for table in tables) + "\n").encode())
    if groups and config.evaluation.figures and config.ramp is None:
        write("group.png", _group_picture(trials, groups, config, body))
    else:
        (folder / "group.png").unlink(missing_ok=True)
    for name, (_, picture) in zip(pictures, found, strict=True):
        if picture:
            write(name, picture)
    yaml_files.write_yaml(folder / "analysis.yaml", _record(paths, config))
    print("\n\n".join(table(text_table) for table in tables))
    print(*notes(trials, config), *(folder / name for name in (*written, "analysis.yaml")), sep="\n")


def _group_picture(trials: Any, groups: Any, config: AnalyseConfig, body: Any) -> bytes:
    """The figure of the group as a PNG, with the theory's correlation if there is a body."""
    from posture.recording.figures import group_figure, png
    from posture.recording.trial import least_correlation

    return png(group_figure(trials, groups, None if body is None else least_correlation(body, config.env)))


def figure_names(paths: Sequence[Path]) -> list[str]:
    """A file name for the figure of each recording, also where two recordings have the same name."""
    names: list[str] = []
    taken = {Path(name).stem for name in (*FILES, *GROUP_FILES)}
    for path in paths:
        name, number = path.stem, 2
        while name.lower() in taken:
            name, number = f"{path.stem}_{number}", number + 1
        taken.add(name.lower())
        names.append(f"{name}.png")
    return names


def _record(paths: Sequence[Path], config: AnalyseConfig) -> dict[str, Any]:
    """What was analysed, how, and by which versions."""
    return {
        "recordings": [{"file": str(path), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()} for path in paths],
        "analysis": config.model_dump(mode="json", exclude={"recording"} if config.predicts else {"recording", "env"}),
        "versions": provenance.library_versions(),
    }


def check(configs: Sequence[AnalyseConfig], in_sweep: bool) -> None:
    """Raise ConfigError if a recording is not there, or a package is missing that one needs."""
    from posture.recording.files import find_recordings

    for config in configs:
        find_recordings(config.recording)
    if any(config.ramp is not None for config in configs):
        from posture.recording.ramp import check_installed

        check_installed()


def main() -> None:
    """The command `python -m posture.analyse`."""
    entry.run("analyse", AnalyseConfig, analyse_recordings, check)


if __name__ == "__main__":
    main()
