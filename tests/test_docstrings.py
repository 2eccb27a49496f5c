"""Every public name says what it takes and gives: parameters, shapes, units, errors, sources."""

import ast
import importlib
import inspect
import re
import textwrap
from functools import cached_property

import pytest

from towline.solvers import methods

ROOMS = [
    "models",
    "solvers",
    "workspace",
    "calibration",
    "control",
    "simulation",
    "ocp",
    "figures",
    "studies",
    "viewer",
]
# Types that say all about a parameter, whatever its name.
TELLING = ("Robot", "Places", "TensionProblem", "Dynamics", "Condition", "PathLike", "Progress")
ARRAYS = re.compile(r"\b(ndarray|ArrayLike|Array|NDArray\[np.float64\])\b")


def public_functions():
    """Names, functions and the docstrings that may explain their parameters."""
    for room in ROOMS:
        module = importlib.import_module(f"towline.{room}")
        for name in getattr(module, "__all__", []):
            thing = getattr(module, name)
            if inspect.isclass(thing):
                for method, member in vars(thing).items():
                    function = inspect.unwrap(plain(member)) if not method.startswith("_") else None
                    if inspect.isfunction(function):
                        bases = [inspect.getdoc(getattr(base, method, None)) or "" for base in thing.__mro__[1:]]
                        yield f"{room}.{name}.{method}", function, [inspect.getdoc(thing) or "", *bases]
            elif callable(thing):
                yield f"{room}.{name}", inspect.unwrap(thing), []


def plain(member):
    """The function behind a property, a class method or a static one."""
    for kind, attribute in ((property, "fget"), (cached_property, "func"), ((classmethod, staticmethod), "__func__")):
        if isinstance(member, kind):
            return getattr(member, attribute)
    return member


FUNCTIONS = {
    name: (function, others)
    for name, function, others in public_functions()
    if inspect.isfunction(function) and function.__module__.startswith("towline")
}


@pytest.mark.parametrize("room", ROOMS)
def test_classes_and_exports_have_docstrings(room):
    module = importlib.import_module(f"towline.{room}")
    assert module.__doc__
    for name in getattr(module, "__all__", []):
        thing = getattr(module, name)
        if inspect.isclass(thing):
            assert thing.__dict__.get("__doc__"), name


def test_there_are_functions_to_look_at():
    assert len(FUNCTIONS) > 100


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_docstring_tells_what_a_caller_needs(name):
    function, others = FUNCTIONS[name]
    told = inspect.getdoc(function) or ""
    assert told, "no docstring"
    signature = inspect.signature(function)
    if not re.search("Arguments as in|Likewise", told):
        for parameter in signature.parameters.values():
            known = parameter.name in ("self", "cls") or any(kind in str(parameter.annotation) for kind in TELLING)
            assert known or any(re.search(rf"\b{parameter.name}\b", text) for text in (told, *others)), parameter.name
    returned = str(signature.return_annotation)
    if ARRAYS.search(returned) and "bool" not in told:
        everything = " ".join((told, *others))
        assert re.search(r"\([^()]*\)", everything), "an array whose shape is not told"
        assert re.search(r"\[[^\]]+\]|of bool|[Ii]ndex|[Ii]ndices|\b1 for\b|unit of the condition", everything), (
            "no unit"
        )
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raised = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise)]
    if any(isinstance(error, ast.Call) and getattr(error.func, "id", "") == "InputError" for error in raised):
        assert re.search(r"Raises:\n[\s\S]*InputError", told), "InputError is not told"


@pytest.mark.parametrize("name", methods())
def test_every_method_names_its_source(name):
    assert len(methods()[name].source) > 10
