"""An account as files: report, errata, claims and figures."""

import json
from pathlib import Path

from ...base.writing import whole_file
from ...figures import style
from .account import Account
from .errata import errata
from .page import page


def write(account: Account, folder: Path, form: str = "png") -> list[Path]:
    """Write report (HTML), errata (Markdown), claims (JSON) and figures into `folder`; return their paths.

    Each file is written atomically. Raises `InputError` if the folder cannot be written to.
    """
    name = account.paper.name
    texts = {
        f"{name}.html": page(account),
        f"{name}-errata.md": errata(account),
        f"{name}.json": json.dumps(account.to_dict(), indent=2, allow_nan=False) + "\n",
    }
    files = [folder / file for file in texts]
    for file, content in zip(files, texts.values(), strict=True):
        with whole_file(file) as temporary:
            temporary.write_text(content, encoding="utf-8")
    for chapter in account.chapters.values():
        for figure, drawing in chapter.drawings.items():
            files.append(style.save(drawing.figure, folder / "figures" / f"{figure}.{form}"))
    return files
