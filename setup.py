"""Build the C core as an extension. It is optional: without a compiler towline is installed without it."""

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


def main() -> None:
    """Run setuptools on pyproject.toml with the extension."""
    import sys

    from setuptools import Extension, setup

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
    setup(script_name="setup.py", ext_modules=[core], options={"bdist_wheel": {"py_limited_api": "cp311"}})


if __name__ == "__main__":  # the root of the repository is the package: this file can be imported
    main()
