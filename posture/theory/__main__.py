"""The torque-optimal stander beside the paper's experiments: tables, and the map of its postural modes. Nothing is learned.

python -m posture.theory
python -m posture.theory env.hip_k=75 env.load=2
python -m posture.theory -m env.hip_k=75,125 env.load=0,4
"""

from dataclasses import fields
from pathlib import Path

from posture.cli import entry
from posture.config.errors import ConfigError
from posture.config.theory import TheoryConfig
from posture.storage import run_dir


def theory(config: TheoryConfig, folder: Path) -> None:
    """Print and write the tables, and draw the map, of one stander."""
    # Imported here because they are slow.
    from envs.body.segments import read_segments
    from posture.analysis.results import write_rows
    from posture.theory.figures import draw_map
    from posture.theory.program import InfeasibleError
    from posture.theory.tables import TheoryTables, all_tables

    run_dir.writable(folder, "theory_map.png", *(f"{field.name}.csv" for field in fields(TheoryTables)))
    body = read_segments(config.env)
    try:
        found = all_tables(body, config)
    except InfeasibleError as error:
        raise ConfigError(str(error)) from None
    paths = [folder / "theory_map.png"]
    for name, table in found.items():
        path = folder / f"{name}.csv"
        if not table.rows:  # of `around` without values
            path.unlink(missing_ok=True)  # of an earlier start
            continue
        print(f"{table.title}\n{table.text()}\n")
        paths.append(path)
        write_rows(table.csv_rows(), path)
    draw_map(body, config, found, paths[0])
    print(*sorted(paths), sep="\n")


def main() -> None:
    """The command `python -m posture.theory`."""
    entry.run("theory", TheoryConfig, theory)


if __name__ == "__main__":
    main()
