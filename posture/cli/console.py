"""The program `posture`, also `python -m posture`: runs the command that its first argument names."""

import importlib
import importlib.metadata
import sys

from posture.cli import output, signals

COMMANDS = {
    "train": "train a policy, then evaluate it",
    "import_checkpoint": "a run folder from a checkpoint of rsl-rl's own runner",
    "eval": "evaluate a policy: indices, tables, figures",
    "analyse": "recordings of people: the same indices, with intervals, and theory",
    "map": "one policy on many bodies, beside the theory of each",
    "dynamics": "hysteresis, fluctuations and recovery of a policy, beside those of people",
    "theory": "the torque-optimal stander beside the paper's experiments",
    "reproduce": "train and evaluate every experiment of the paper, and report",
    "play": "a live page in the browser: sliders, a push, the postural mode",
    "film": "films of a policy, MP4 and GIF",
    "export": "a policy's trajectories for OpenSim and CSV, and itself as ONNX",
}
IN_ONE_FILE = ("train", "import_checkpoint", "eval", "analyse")
"""Commands that are modules; the others are packages with a __main__."""
USAGE = "usage: posture COMMAND [KEY=VALUE ...]     settings of a command: posture COMMAND --help"


def main() -> None:
    """Run `posture COMMAND ...` as `python -m posture.COMMAND ...`; without a command list them all."""
    output.install()
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in ("--help", "-h"):
        print(USAGE, *(f"  {command:<18} {about}" for command, about in COMMANDS.items()), sep="\n")
    elif name == "--version":
        print(importlib.metadata.version("posture"))
    elif name not in COMMANDS:
        print(f"error: {name}: no such command; allowed are {', '.join(COMMANDS)}", file=sys.stderr)
        sys.exit(2)
    else:
        del sys.argv[1]
        sys.argv[0] = f"posture {name}"
        with signals.handled():  # Ctrl-C must work during the import, too
            importlib.import_module(f"posture.{name}" if name in IN_ONE_FILE else f"posture.{name}.__main__").main()
