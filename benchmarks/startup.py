"""How long a user waits for a command to start, as whole processes: `python -m towline.benchmarks.startup`.

Each command runs in turn with a Python process that only imports casadi, numpy and xarray; the figures are medians of
their times and of the ratios to that process, which vary less with the load of the machine.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

__all__ = ["TARGETS", "measure", "run"]

TASK = """\
name: circle
path: {kind: circle, centre: [0, 0, -1], radius: 0.5, rate: 0.6}
base: {kind: free, acceleration_max: 3, ends: periodic}
"""
IMPORTS = [sys.executable, "-c", "import casadi, numpy, xarray"]
COMMAND = [sys.executable, "-m", "towline.cli.entry"]
# Command line and the largest ratio to the imports that is accepted.
TARGETS = {
    "towline --help": (["--help"], 0.2),
    "towline robots": (["robots"], 0.4),
    "towline plan wang-flying circle.yaml": (["plan", "wang-flying", "circle.yaml"], 1.5),
}


def measure(command: list[str], folder: Path) -> float:
    """Return the time of one whole process [s]."""
    start = time.perf_counter()
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return time.perf_counter() - start


def run(runs: int = 5) -> dict[str, tuple[float, float]]:
    """Return median time [s] and median ratio to the imports of each command, after one run that is not counted."""
    results = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "circle.yaml").write_text(TASK, encoding="utf-8")
        for label, (arguments, _) in TARGETS.items():
            pairs = [(measure(COMMAND + arguments, folder), measure(IMPORTS, folder)) for _ in range(runs + 1)][1:]
            results[label] = (median(ours for ours, _ in pairs), median(ours / imports for ours, imports in pairs))
    return results


def main() -> None:
    """Print the table."""
    print("| command | median [s] | ratio to `import casadi, numpy, xarray` | target |\n|---|---|---|---|")
    for label, (seconds, ratio) in run().items():
        print(f"| `{label}` | {seconds:.2f} | {ratio:.2f} | {TARGETS[label][1]:g} |")


if __name__ == "__main__":
    main()
