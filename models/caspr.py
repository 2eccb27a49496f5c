"""Convert a CASPR robot folder to a towline robot, and note what cannot be expressed.

CASPR (D. Lau et al.) describes a robot by two XML files: NAME_bodies.xml has the links, NAME_cables.xml has one or more
sets of cables. One link that moves freely, in space or in a plane, is a platform; link 0 is the ground. With the joint
frame {J} as platform frame, c = com_location, and the joint's base at p in {G}:

    r_JB = location             if attachment_reference is "joint"
    r_JB = location + c         if it is "com"
    I_com = I_J - m (c.c E - c c^T)           if the inertia's ref is "joint"
    x = p + q_xyz,  R = Rx(q_4) Ry(q_5) Rz(q_6)   for SPATIAL_EULER_XYZ, whereas towline has Rz Ry Rx

A content that would make a different robot is an error; one that is left out is a note. Files may come from anywhere:
entities and any DTD of their own are refused, and the DTD that CASPR names beside them is not read.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser, ParseError
from scipy.spatial.transform import Rotation

from ..base.display import Displayed
from ..base.inputs import InputError, shown
from ..base.reading import read_bytes
from . import points
from .cable import Cable
from .parsing import validate
from .part import COORDINATES, LARGEST, Coordinate, inertia_matrix
from .platform import Platform
from .robot import Robot

# What each joint's q moves, in the order of q; both spatial ones turn freely; each writes the angles in its own form.
JOINTS: dict[str, tuple[Coordinate, ...]] = {
    "SPATIAL_EULER_XYZ": COORDINATES,
    "SPATIAL_QUATERNION": COORDINATES,
    "T_XYZ": ("x", "y", "z"),
    "P_X": ("x",),
    "P_XY": ("x", "y"),
    "P_XZ": ("x", "z"),
    "PLANAR_XY": ("x", "y", "yaw"),
    "PLANAR_XZ": ("x", "z", "pitch"),
    "PLANAR_YZ": ("y", "z", "roll"),
}
# Their stiffness depends on the tension; their geometry and limits are those of ideal cables.
VARIABLE_STIFFNESS = ("cable_vsd_torsion_spring", "cable_vsd_flexure_linear", "cable_vsd_polynomial")
CABLES = ("cable_ideal", "cable_linear_spring", *VARIABLE_STIFFNESS)
NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


@dataclass(frozen=True)
class CasprImport(Displayed):
    """A robot, and what else the folder contains."""

    robot: Robot  # the robot; its source names the folder and repeats the notes
    cable_set: str  # id of the set of cables that was read
    cable_sets: tuple[str, ...]  # ids of all sets in the file
    notes: list[str]  # sentences on what was left out or assumed


def read_caspr(folder: str | os.PathLike[str], cable_set: str | None = None) -> CasprImport:
    """Read a folder with one *_bodies.xml and one *_cables.xml as CASPR has them.

    - `folder`: the folder of one robot.
    - `cable_set`: id of the set of cables; default: the file's default_cable_set.

    Raises `InputError` if a file is missing or wrong, or towline cannot express the robot: one line that names the file
    and the element.
    """
    place = Path(folder)
    notes = Counter[str]()
    bodies = _read(_file(place, "_bodies.xml"), "bodies_system", notes)
    cables = _read(_file(place, "_cables.xml"), "cables", notes)
    name = place.resolve().name
    links = bodies.child("links").children()
    for each in links:
        if each.element.tag != "link_rigid":
            raise each.wrong("be a link_rigid", shown(each.element.tag))
    if len(links) != 1:
        raise bodies.wrong("have one link, because towline's robots have one platform", str(len(links)))
    link = links[0]
    platform, com = _platform(link, notes)
    chosen, ids = _choose(cables, cable_set)
    wires = [_cable(node, com, notes) for node in chosen.children()]
    if not wires:
        raise chosen.wrong("have at least one cable", "none")
    default = cables.element.get("default_cable_set")
    remarks = [text if count == 1 else f"{text} ({count} times)" for text, count in notes.items()]
    source = (
        f"Imported from the CASPR folder {shown(name)}, link {shown(link.element.get('name', ''))}, cable set "
        f"{shown(chosen.attribute('id'))}: geometry, mass, inertia and tension limits. Home is q_initial."
    )
    data = {
        "name": _name(name if chosen.attribute("id") == default else f"{name}-{chosen.attribute('id')}"),
        "source": " ".join([source, *(f"Note: {note}." for note in remarks)]),
        "platform": platform,
        "carriers": [{"name": "frame", "kind": "ground"}],
        "cables": wires,
    }
    return CasprImport(validate(data, Robot, chosen.where), chosen.attribute("id"), tuple(ids), remarks)


class _Parser(DefusedXMLParser):
    """A parser that refuses entities and every DOCTYPE, except one that only names a DTD beside the file."""

    def __init__(self):
        # The tree builder written in C: Python's own walks a deep tree by recursion.
        super().__init__(target=TreeBuilder(), forbid_dtd=True, forbid_entities=True, forbid_external=True)

    def defused_start_doctype_decl(
        self, name: str, sysid: str | None, pubid: str | None, has_internal_subset: bool
    ) -> None:
        if has_internal_subset or "://" in (sysid or ""):
            super().defused_start_doctype_decl(name, sysid, pubid, has_internal_subset)


@dataclass(frozen=True)
class _Node:
    """An XML element, and where it stands: the file and the elements that lead to it."""

    element: Element
    where: str

    def wrong(self, accepted: str, got: str, part: str = "") -> InputError:
        return InputError(f"{self.where}{part and f': {part}'} must {accepted}, got {got}")

    def children(self, tag: str | None = None) -> list[_Node]:
        return [_Node(child, f"{self.where}{_label(child)}") for child in self.element if tag in (None, child.tag)]

    def find(self, tag: str) -> _Node | None:
        """Return the only child `tag`, or None if there is none."""
        children = self.children(tag)
        if len(children) > 1:
            raise self.wrong(f"have one element {tag}", str(len(children)))
        return children[0] if children else None

    def child(self, tag: str) -> _Node:
        child = self.find(tag)
        if child is None:
            raise self.wrong(f"have an element {tag}", "none")
        return child

    def attribute(self, name: str) -> str:
        value = self.element.get(name)
        if value is None:
            raise self.wrong(f"have the attribute {name}", "none")
        return value

    def about_com(self, name: str) -> bool:
        """Return whether the attribute is "com", not "joint"."""
        value = self.attribute(name)
        if value not in ("com", "joint"):
            raise self.wrong("be com or joint", shown(value), name)
        return value == "com"

    def number(self, tag: str) -> float:
        return self.child(tag).numbers(1)[0]

    def numbers(self, count: int, attribute: str | None = None) -> list[float]:
        """Return the element's text, or one of its attributes, as `count` finite numbers."""
        text = self.attribute(attribute) if attribute else self.element.text or ""
        words = text.split()
        values = [float(word) if NUMBER.fullmatch(word) else math.nan for word in words]
        if len(values) != count or not all(map(math.isfinite, values)):
            accepted = "be one finite number" if count == 1 else f"be {count} finite numbers"
            raise self.wrong(accepted, shown(text.strip()), attribute or "")
        return values


def _label(element: Element) -> str:
    """Return the element's tag, and its name, id or number if it has one."""
    called = next((element.get(key) for key in ("name", "id", "num") if element.get(key)), None)
    return f": {shown(element.tag)[1:-1]}" + (f" {shown(called)}" if called else "")


def _file(folder: Path, ending: str) -> Path:
    if not folder.is_dir():
        raise InputError(f"{folder} must be a folder with one *_bodies.xml and one *_cables.xml, got no folder")
    files = sorted(folder.glob(f"*{ending}"))
    if len(files) != 1:
        names = ", ".join(path.name for path in files) or "none"
        raise InputError(f"{folder} must be a CASPR robot folder with one file *{ending}, got {names}")
    return files[0]


def _read(file: Path, root: str, notes: Counter[str]) -> _Node:
    content = read_bytes(file, "an XML file")
    parser = _Parser()
    try:
        parser.feed(content)
        element: Any = parser.close()
    except DefusedXmlException:
        raise InputError(
            f"{file} must be plain XML, with at most a DOCTYPE that names a file, got a DTD or entities of its own"
        ) from None
    except ParseError as error:
        reason = shown(str(error))[1:-1]
        raise InputError(f"{file} must be a CASPR {root} file, got text that is not XML ({reason})") from None
    except (LookupError, ValueError):  # encodings that Python or expat do not know
        raise InputError(f"{file} must be XML in UTF-8, got an unknown encoding") from None
    if element.tag != root:
        raise InputError(f"{file} must have the root element {root}, got {shown(element.tag)}")
    for holder in element.iter():
        text = [holder.text or ""] if len(holder) else []
        if any(part.strip() for part in (*text, *(child.tail or "" for child in holder))):
            notes[f"{file.name}: text beside the elements of {shown(holder.tag)[1:-1]} is left out"] += 1
    return _Node(element, str(file))


def _platform(link: _Node, notes: Counter[str]) -> tuple[Platform, np.ndarray]:
    """Return the link as a platform in its joint's frame, and its centre of mass there [m]."""
    joint, physical = link.child("joint"), link.child("physical")
    kind = joint.attribute("type")
    if kind not in JOINTS:
        raise joint.wrong(f"be one of {', '.join(JOINTS)}", shown(kind), "type")
    if joint.element.get("actuated") == "true":
        raise joint.wrong("be a joint that only the cables move", "one with a motor")
    mass = physical.number("mass")
    com = np.array(physical.child("com_location").numbers(3))
    if joint.element.get("q_min") or joint.element.get("q_max"):
        notes["the joint's range, q_min to q_max, is left out"] += 1
    end = physical.find("end_location")
    if end is not None and any(end.numbers(3)):
        notes["the position of the tool, end_location, is left out"] += 1
    data: dict[str, Any] = {"mass": mass, "com": com.tolist(), "dof": JOINTS[kind], "home": _home(link, joint, kind)}
    inertia = _inertia(physical.child("inertia"), mass, com)
    if set(JOINTS[kind]) & {"roll", "pitch", "yaw"} or min(np.linalg.eigvalsh(inertia_matrix(inertia))) > 0:
        data["inertia"] = inertia
    else:
        notes["the inertia is left out, it is not positive definite and the platform cannot turn"] += 1
    return validate(data, Platform, link.where), com


def _inertia(node: _Node, mass: float, com: np.ndarray) -> tuple[float, float, float, float, float, float]:
    """Return (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the centre of mass [kg m^2]."""
    xx, yy, zz, xy, xz, yz = (node.number(name) for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"))
    matrix = inertia_matrix((xx, yy, zz, xy, xz, yz))
    if not node.about_com("ref"):
        matrix = matrix - mass * (com @ com * np.eye(3) - np.outer(com, com))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrix.tolist()
    return xx, yy, zz, xy, xz, yz


def _home(link: _Node, joint: _Node, kind: str) -> list[float]:
    """Return q_initial as a pose in {G} [m, rad]."""
    parent = link.child("parent")
    if parent.child("num").numbers(1) != [0.0]:
        raise parent.child("num").wrong("be 0, the ground", shown(parent.child("num").element.text or ""))
    pose = np.zeros(6)
    pose[:3] = parent.child("location").numbers(3)
    dof = JOINTS[kind]
    q = np.array(joint.numbers(7 if kind == "SPATIAL_QUATERNION" else len(dof), "q_initial"))
    if len(dof) == len(COORDINATES):
        pose[:3] += q[:3]
        if kind == "SPATIAL_QUATERNION":  # (e0, e1, e2, e3) with the real part e0
            if not 0.999 < (norm := np.linalg.norm(q[3:])) < 1.001:
                raise joint.wrong("have a quaternion of norm 1", f"a norm of {norm:g}", "q_initial")
            turned = Rotation.from_quat(q[3:], scalar_first=True)
        else:
            turned = Rotation.from_euler("XYZ", q[3:])
        pose[3:] = points.angles(turned.as_matrix()) + 0.0  # -0 would only puzzle a reader
    else:
        pose[[COORDINATES.index(name) for name in dof]] += q
    return pose.tolist()


def _choose(cables: _Node, requested: str | None) -> tuple[_Node, list[str]]:
    """Return the set of cables to import, and the ids of all sets."""
    sets = cables.children("cable_set")
    ids = [node.attribute("id") for node in sets]
    known = ", ".join(shown(name)[1:-1] for name in ids) or "no set, because the file has none"
    chosen = requested or cables.element.get("default_cable_set") or (ids[0] if len(ids) == 1 else "")
    if not chosen:
        raise cables.wrong(f"be one of {known}", "none", "default_cable_set")
    if ids.count(chosen) != 1:
        got = f"{shown(chosen)}, which is there twice" if chosen in ids else shown(chosen)
        raise cables.wrong(f"be one of {known}", got, "cable set")
    return sets[ids.index(chosen)], ids


def _cable(node: _Node, com: np.ndarray, notes: Counter[str]) -> Cable:
    kind = node.element.tag
    if kind not in CABLES:
        raise node.wrong(f"be one of {', '.join(CABLES)}", shown(kind))
    origin = com if node.about_com("attachment_reference") else np.zeros(3)
    properties = node.child("properties")
    lower = properties.find("force_min")
    if lower is None:
        notes["force_min is missing, replaced by 0 N"] += 1
    upper = properties.number("force_max")
    if upper > LARGEST:
        notes[f"force_max {upper:g} N, which stands for no limit, is replaced by {LARGEST:g} N"] += 1
    data: dict[str, Any] = {
        "carrier": "frame",
        "t_min": 0.0 if lower is None else lower.numbers(1)[0],
        "t_max": min(upper, LARGEST),
    }
    used = {"force_min", "force_max"}
    if kind == "cable_linear_spring":
        data["stiffness"] = properties.number("K")  # CASPR divides it by the length: it is E A
        used |= {"K"}
    if kind in VARIABLE_STIFFNESS:
        notes[f"the variable stiffness of {kind} is left out"] += 1
    for extra in properties.children():
        if extra.element.tag not in used:
            notes[f"the property {shown(extra.element.tag)[1:-1]} of {kind} is left out"] += 1
    return validate(data | _ends(node, origin, notes), Cable, node.where)


def _ends(node: _Node, origin: np.ndarray, notes: Counter[str]) -> dict[str, Any]:
    """Return anchor, attachment and pulley of a cable; its locations on the link are relative to `origin`."""
    points = node.child("attachments").children()
    if points and points[-1].element.tag == "attachment" and _link(points[-1]) == 0:
        points.reverse()
    links = [_link(point) for point in points]
    if len(points) < 2 or links != [0] * (len(points) - 1) + [1]:
        numbers = ", ".join(str(number) for number in links[:9]) or "none"
        raise node.wrong("run from the ground, link 0, straight to link 1", f"the links {numbers}")
    anchor, attachment = points[-2], points[-1]
    if len(points) > 2:
        if node.element.tag != "cable_ideal":
            raise node.wrong("run from one anchor to link 1 if it is elastic", "several points on the ground")
        notes["points on the ground before the last one are left out, they add a constant length"] += 1
    ends: dict[str, Any] = {"attachment": (np.array(attachment.child("location").numbers(3)) + origin).tolist()}
    if anchor.element.tag == "attachment":
        return ends | {"anchor": anchor.child("location").numbers(3)}
    pulley = {"radius": anchor.number("pulley_radius"), "axis": anchor.child("cable_entry_vector").numbers(3)}
    return ends | {"anchor": anchor.child("fixed_location").numbers(3), "pulley": pulley}


def _link(point: _Node) -> int:
    """Return the number of the link that a point sits on, 0 for the ground."""
    if point.element.tag == "base_rotating_pulley":
        return 0
    if point.element.tag != "attachment":
        raise point.wrong("be an attachment or a base_rotating_pulley", shown(point.element.tag))
    number = point.number("link")
    if not number.is_integer():
        raise point.child("link").wrong("be 0 or 1", f"{number:g}")
    return int(number)


def _name(text: str) -> str:
    """Return the text as a robot's name: lower case, words joined by hyphens."""
    words = re.findall(r"[a-z0-9.]+", text.lower())
    return "-".join(words).lstrip(".")[:64].rstrip("-.") or "caspr-robot"
