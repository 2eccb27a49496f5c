"""Show robots, plans and workspaces in a browser: live with sliders, or as one HTML page that needs no server.

    subject = read("circle.nc")               # a robot, a plan or a workspace
    save_page(subject, "circle.html")
    with serve(subject) as url: ...

The modules `snapshot`, `replay`, `subject`, `charts`, `sliders` and `labels` compute what is shown, without a
browser. Only `server` imports viser, which draws it (extra `viewer`).
"""

from .server import save_page, serve
from .subject import Subject, read

__all__ = ["Subject", "read", "save_page", "serve"]
