"""The torque-optimal stander beside the paper's experiments: tables, and the map of its postural modes. Nothing is learned.

python -m posture.theory
python -m posture.theory env.hip_k=75 env.load=2
python -m posture.theory -m env.hip_k=75,125 env.load=0,4
"""

from pathlib import Path

from posture import cli, run_dir
from posture.config import ConfigError
from posture.coordination import write_csv
from posture.theory_config import TheoryConfig


def theory(config: TheoryConfig, folder: Path) -> None:
    """Print and write the tables, and draw the map, of one stander."""
    out = run_dir.writable(folder / "theory" if config.out is None else Path(config.out))
    # Only now, so that bad input is answered before physics takes seconds to import.
    from posture import theory_tables
    from posture.program import InfeasibleError
    from posture.stander import segments
    from posture.theory_figures import draw_map

    body = segments(config.env)
    try:
        tables = theory_tables.all_tables(body, config)
    except InfeasibleError as error:
        raise ConfigError(str(error)) from None
    for table in tables:
        print(f"{table.title}\n{table.text()}\n")
        write_csv(table.rows, out / f"{table.name}.csv")
    draw_map(body, config, {table.name: table.rows for table in tables}, out / "theory_map.png")
    for path in sorted(out.iterdir()):
        print(path)


if __name__ == "__main__":
    cli.run("theory", TheoryConfig, theory)
