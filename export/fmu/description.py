"""The description of a unit, modelDescription.xml, and of its sources, buildDescription.xml."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from ...base.version import __version__
from .variables import Variable

# Exponents of kg, m and s; an angle has none, but rad.
UNITS = {
    "s": {"s": 1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m/s3": {"m": 1, "s": -3},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "rad/s3": {"rad": 1, "s": -3},
    "1/s3": {"s": -3},
    "kg": {"kg": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
}


def model_description(
    name: str, identifier: str, token: str, about: str, step: float, variables: Sequence[Variable]
) -> bytes:
    """Return modelDescription.xml, with the variables in the order of their value references, and a step [s]."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=token,
        description=about,
        generationTool=f"towline {__version__}",
        copyright="Copyright (c) 2026, The towline developers",
        license="BSD-3-Clause",
        variableNamingConvention="structured",
    )
    can = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUState", "canSerializeFMUState")
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **dict.fromkeys(can, "true")})
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(variable.unit for variable in variables if variable.unit):
        exponents = {base: str(power) for base, power in UNITS[unit].items()}
        ET.SubElement(ET.SubElement(units, "Unit", name=unit), "BaseUnit", exponents)
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", name="logStatusError", description="refused calls")
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(step))
    listed, structure = ET.SubElement(root, "ModelVariables"), ET.SubElement(root, "ModelStructure")
    for reference, variable in enumerate(variables):
        keys = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
        keys |= {"description": variable.about} | ({"unit": variable.unit} if variable.unit else {})
        if variable.causality == "output":
            keys["initial"] = "calculated"
        elif variable.causality != "independent":
            keys["start"] = repr(variable.start)
        if variable.causality == "parameter":
            keys |= {"variability": "tunable", "min": repr(variable.least)}
        ET.SubElement(listed, "Float64", keys)
    for element in ("Output", "InitialUnknown"):
        for reference, variable in enumerate(variables):
            if variable.causality == "output":
                ET.SubElement(structure, element, valueReference=str(reference))
    return _text(root)


def build_description(identifier: str, sources: Sequence[str], definitions: dict[str, str]) -> bytes:
    """Return buildDescription.xml, from the C files and preprocessor definitions of a unit."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for source in sources:
        ET.SubElement(files, "SourceFile", name=source)
    for name, value in definitions.items():
        ET.SubElement(files, "PreprocessorDefinition", name=name, value=value)
    ET.SubElement(files, "IncludeDirectory", name=".")
    return _text(root)


def _text(root: ET.Element) -> bytes:
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
