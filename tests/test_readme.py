"""What the README says works."""

import re
import subprocess
import sys
from pathlib import Path

from towline.models import load
from towline.models.parsing import parse_yaml
from towline.ocp import Task, plan

README = (Path(__file__).parent.parent / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_python_examples_run(tmp_path):
    example = "\n".join(blocks("python"))
    done = subprocess.run([sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "optimal" in done.stdout
    assert "FEASIBLE" in done.stdout
    assert "INFEASIBLE" not in done.stdout
    assert (tmp_path / "circle.nc").exists()


def test_task_file_is_feasible():
    (text,) = blocks("yaml")
    assert plan(load("wang-ctmrts"), parse_yaml(text, Task, "README")).feasible
