"""Robots, plans and workspaces in a browser: live with sliders, or as one HTML page that plays without a server.

    subject = read("circle.nc")               # a robot, a plan or a workspace
    save_page(subject, "circle.html")
    with serve(subject) as url: ...

What is shown is computed without a browser (`instant`, `replay`, `cloud`, `sliders`, `colours`, `words`); viser, which
draws it, is imported by `server` alone (extra `viewer`).
"""

from .server import save_page, serve
from .subject import Subject, read

__all__ = ["Subject", "read", "save_page", "serve"]
