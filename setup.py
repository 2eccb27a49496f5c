"""Build the C core as an extension, and the description that a package index shows.

core/packaging/compiler.py finds the compiler. The description is README.md, whose links
lead to files of the repository; an index has none of these, so there they lead to the repository as of this version.

An editable installation gets a folder that has the package under its name, because the repository's root is the package
whatever its folder is called: type checkers and editors then find it as Python does.
"""

import os
import re

CORE = "core"
# The same bits on every processor: no multiplication and addition in one. A root is one instruction if it need not set
# errno nor trap. With -O3 loops over three coordinates are unrolled: the plant takes 0.75 of its time with -O2. Hidden
# functions call each other directly, and can be inlined.
FLAGS = [
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fvisibility=hidden",
    "-Wno-psabi",
    "-g0",
]
EDITABLE = ".editable"

# Where a link or a picture of Markdown or HTML leads: a path, neither an address nor a place on the same page.
PATH = re.compile(r'(?P<before>\]\(|<img src=")(?P<path>(?!#|[a-z]+:)[^)"\s]+)')


def with_addresses(readme: str, repository: str, version: str) -> str:
    """Return a README whose links and pictures are addresses in the repository, at the tag of a version."""

    def address(match: re.Match[str]) -> str:
        kind = "raw" if match["path"].endswith((".png", ".gif")) else "blob"
        return f"{match['before']}{repository}/{kind}/v{version}/{match['path']}"

    return PATH.sub(address, readme)


def linked(folder: str, name: str) -> bool:
    """Make `folder`/`name` a link to the folder above, and return whether it is one.

    It is none where something else has that name, or where links are not permitted, as on most Windows machines.
    """
    link = os.path.join(folder, name)
    try:
        os.makedirs(folder, exist_ok=True)
        if os.path.islink(link) and os.readlink(link) != os.pardir:
            os.unlink(link)
        os.symlink(os.pardir, link, target_is_directory=True)
    except OSError:  # among them that there is one
        pass
    return os.path.islink(link) and os.readlink(link) == os.pardir


def main() -> None:
    """Run setuptools on pyproject.toml with the extension and the description."""
    import sys
    import sysconfig
    import tomllib
    from concurrent.futures import ThreadPoolExecutor
    from pathlib import Path
    from typing import Any

    from setuptools import Extension, setup
    from setuptools.command.build_ext import build_ext
    from setuptools.command.editable_wheel import editable_wheel

    sys.path.insert(0, str(Path(CORE, "packaging").resolve()))
    import compiler

    class Build(build_ext):
        """The build of the core by the machine's compiler or by the package ziglang."""

        def run(self) -> None:
            """Build; for an editable installation where other builds do, and not anew what is up to date there."""
            compiler.choose()
            if self.editable_mode:
                kind = f"lib.{sysconfig.get_platform()}-{sys.implementation.cache_tag}"
                self.build_lib = os.path.join("build", kind)
            super().run()

        def copy_extensions_to_source(self) -> None:
            """Copy also an older one: that in the sources may be of another machine."""
            self.force = True
            super().copy_extensions_to_source()

        def build_extensions(self) -> None:
            """Compile as many files at once as there are processors, after a first one, with which compilers set up."""
            compile_some = self.compiler.compile

            def compile_all(sources: list[str], **options: Any) -> list[str]:
                first = compile_some(sources[:1], **options)
                with ThreadPoolExecutor(os.cpu_count()) as pool:
                    made = pool.map(lambda source: compile_some([source], **options), sources[1:])
                    return [*first, *(name for names in made for name in names)]

            self.compiler.compile = compile_all
            super().build_extensions()

    class Editable(editable_wheel):
        """An editable installation by a path, or by setuptools' import hook where there can be no link."""

        def finalize_options(self) -> None:
            if linked(EDITABLE, "towline"):
                self.distribution.package_dir = {"": EDITABLE}
            super().finalize_options()

    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = Path("README.md").read_text(encoding="utf-8")
    core = Extension(
        "towline.core._core",
        sorted(str(path) for path in Path(CORE).glob("*/*.c")),
        depends=["setup.py", *sorted(str(path) for path in Path(CORE).rglob("*.h"))],
        include_dirs=[CORE, f"{CORE}/distribution"],
        define_macros=[("Py_LIMITED_API", "0x030B0000"), ("TOWLINE_CABLES", "32")],
        extra_compile_args=[] if sys.platform == "win32" else [*FLAGS, *os.environ.get("CFLAGS", "").split()],
        py_limited_api=True,
    )
    # Named as the script, this file is no module of the package, whichever program runs it.
    setup(
        script_name="setup.py",
        ext_modules=[core],
        cmdclass={"build_ext": Build, "editable_wheel": Editable},
        options={"bdist_wheel": {"py_limited_api": "cp311"}},
        long_description=with_addresses(readme, project["urls"]["Repository"], project["version"]),
        long_description_content_type="text/markdown",
    )


if __name__ == "__main__":  # the root of the repository is the package: this file can be imported
    main()
