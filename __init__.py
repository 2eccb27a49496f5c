"""Optimal control and tension distribution of cable robots.

The rooms, from the ground up: `towline.models` (robots and their mechanics), `towline.solvers` (tension distribution on
plain arrays), `towline.figures` (matplotlib), `towline.ocp` (planning), `towline.studies` (the papers), `towline.cli`.
Nothing is imported here, so that `import towline` costs nothing.
"""

__version__ = "0.1.0"
