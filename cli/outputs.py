"""The files that a command writes: none of them may be one that it reads, under whatever name or link."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ..base.errors import InputError
from .options import FPS, SPEED, print_result


class Outputs(NamedTuple):
    """The files that a command writes besides its result, and how it prints the result."""

    as_json: bool
    figures: Path | None = None  # folder
    form: str = "png"  # of figures
    report: Path | None = None
    animate: Path | None = None  # file of a film
    speed: float = SPEED
    fps: float = FPS

    def picture(self, name: str) -> Path | None:
        """Return the file of a figure, or None without figures."""
        return self.figures and self.figures / f"{name}.{self.form}"

    def write(self, result: Any, written: dict[str, Path]) -> list[Path]:
        """Write report, film and figures of a result; add the files to `written`, and return the figures."""
        if self.report is not None:
            written["report"] = result.save_report(self.report)
        if self.animate is not None:
            written["animation"] = result.animate(self.animate, self.speed, self.fps)
        return [] if self.figures is None else result.plot(self.figures, self.form)

    def show(self, result: Any, written: dict[str, Path], pictures: list[Path], **more: Any) -> None:
        """Print a result with all files that were written for it; JSON has `more` keys."""
        data = {**result.to_dict(), **more, **written, "figures": pictures}
        print_result(self.as_json, data, result.report, [*written.values(), *pictures])


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None] | None = None) -> None:
    """Check that the outputs of a command can be written, and are neither inputs nor the same file twice.

    Call it after reading robot and task, and before any long computation.

    - `outputs`: files by the names of their options; None for an option that is not used.
    - `inputs`: files by their meaning; files that have been read so far may be omitted.

    Raises `InputError` if one cannot be written, or is one of the other files.
    """
    from ..base.inputs import check_ending, printable
    from ..base.reading import files_read
    from ..base.writing import check_writable

    taken = [(what, file.resolve()) for what, file in (inputs or {}).items() if file is not None]
    taken += [(f"{printable(str(file))}, which is read", file.resolve()) for file in dict.fromkeys(files_read)]
    for what, file in outputs.items():
        if file is None:
            continue
        if what == "--report":
            check_ending(what, file, ".html", ".htm")
        target = check_writable(file)
        for other, place in taken:
            if target == place or (target.exists() and place.exists() and target.samefile(place)):
                raise InputError(f"{what} must be a file other than {other}, got {printable(str(file))}")
        taken.append((what, target))
