"""The paper as one HTML file that needs no other: `make paper`, and in the documentation site.

python docs/paper.py build/paper.html
"""

import subprocess
import sys
from pathlib import Path

import pypandoc

ROOT = Path(__file__).resolve().parents[1]
OPTIONS = [
    "--citeproc",
    "--standalone",
    "--embed-resources",
    "--fail-if-warnings",
    "--metadata=lang:en-GB",
    "--lua-filter=docs/paper.lua",
]


def main(out: str, source: str = "paper.md") -> int:
    """Write the paper `source` with its references as HTML into `out`; the exit code, not 0 if pandoc warns of anything."""
    page = Path(out).resolve()
    page.parent.mkdir(parents=True, exist_ok=True)
    return subprocess.run([pypandoc.get_pandoc_path(), *OPTIONS, f"--output={page}", source], cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
