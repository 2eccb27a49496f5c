"""The page of the library's robots, each with a picture."""

from towline import load
from towline.models.library import contents
from towline.viewer import read
from towline.viewer.page import live_page

from .markup import escaped, table

HEAD = """# The robots of the library

These robots ship with towline. Commands accept their names, as in `towline robots cogiro`, which diagnoses a robot, and
so does Python, as in `load("cogiro")`. `towline robots cogiro --figure cogiro.png` draws the picture shown here. Cables
are coloured by their tensions at rest at home, or grey if the robot cannot rest there. The green area outlines the
sampled positions at which the robot can rest, seen from above. *Drag it* opens a page that computes the tensions while
you move the platform.

"""


def robots() -> str:
    """Return the page of the library's robots."""
    rows, sections = [], []
    for entry in contents():
        name = entry["name"]
        robot = load(name)
        carriers = ", ".join(f"{count} {kind}" for kind, count in entry["carriers"].items())
        held = f"{carriers} carrier{'s' * (len(robot.carriers) > 1)}"
        dof = ", ".join(robot.platform.dof)
        rows.append([f"[{name}](#{name})", str(robot.m), str(len(robot.platform.dof)), carriers, f"{entry['mass']:g}"])
        facts = f"{robot.m} cables, {held}, {len(robot.platform.dof)} degrees of freedom ({dof})."
        sections.append(
            f"## {name} {{ #{name} }}\n\n![{name}: carriers, cables and platform](pictures/robots/{name}.png)"
            f"{{ width=400 }}\n\n[Drag it](../live/{name}.html)\n\n{facts}\n\n{escaped(robot.source)}\n"
        )
    listed = table(["robot", "cables", "degrees of freedom", "carriers", "mass [kg]"], rows)
    return HEAD + listed + "\n" + "\n".join(sections)


def live_pages() -> dict[str, str | bytes]:
    """Return the pages on which the robots can be dragged, by their paths."""
    return {f"live/{entry['name']}.html": live_page(read(entry["name"])) for entry in contents()}
