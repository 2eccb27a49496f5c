"""Build the C core as an extension, and the description that a package index shows.

The extension is optional: without a compiler towline is installed without it. The description is README.md, whose links
lead to files of the repository; an index has none of these, so there they lead to the repository as of this version.
"""

import re

CORE = "solvers/core/"
SOURCES = (
    "certificate",
    "dual_active_set",
    "extension",
    "proof",
    "reduction",
    "slabs",
    "standard_form",
    "towline_core",
)
HEADERS = ("internal.h", "tolerances.h", "towline_core.h", "towline_types.h")


# Where a link or a picture of Markdown or HTML leads: a path, neither an address nor a place on the same page.
PATH = re.compile(r'(?P<before>\]\(|<img src=")(?P<path>(?!#|[a-z]+:)[^)"\s]+)')


def with_addresses(readme: str, repository: str, version: str) -> str:
    """Return a README whose links and pictures are addresses in the repository, at the tag of a version."""

    def address(match: re.Match[str]) -> str:
        kind = "raw" if match["path"].endswith(".png") else "blob"
        return f"{match['before']}{repository}/{kind}/v{version}/{match['path']}"

    return PATH.sub(address, readme)


def main() -> None:
    """Run setuptools on pyproject.toml with the extension and the description."""
    import sys
    import tomllib
    from pathlib import Path

    from setuptools import Extension, setup

    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = Path("README.md").read_text(encoding="utf-8")
    core = Extension(
        "towline.solvers.core._core",
        [f"{CORE}{name}.c" for name in SOURCES],
        depends=[CORE + name for name in HEADERS],
        include_dirs=[CORE],
        define_macros=[("Py_LIMITED_API", "0x030B0000"), ("TOWLINE_CABLES", "32")],
        # The same bits on every processor: no multiplication and addition in one.
        extra_compile_args=[] if sys.platform == "win32" else ["-O3", "-ffp-contract=off", "-g0"],
        py_limited_api=True,
        optional=True,
    )
    # Named as the script, this file is no module of the package, whichever program runs it.
    setup(
        script_name="setup.py",
        ext_modules=[core],
        options={"bdist_wheel": {"py_limited_api": "cp311"}},
        long_description=with_addresses(readme, project["urls"]["Repository"], project["version"]),
        long_description_content_type="text/markdown",
    )


if __name__ == "__main__":  # the root of the repository is the package: this file can be imported
    main()
