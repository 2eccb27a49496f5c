"""An account as files: reports, errata, claims and figures."""

import json
from pathlib import Path

from ...base.writing import whole_file
from ...figures import style
from . import page, text
from .account import Account


def write(account: Account, folder: Path, form: str = "png") -> list[Path]:
    """Write report (Markdown and HTML), errata, claims (JSON) and figures into `folder`; return their paths.

    Each file is written atomically. Raises `InputError` if the folder cannot be written to.
    """
    name = account.paper.name
    texts = {
        f"{name}.md": text.report(account, form),
        f"{name}.html": page.page(account),
        f"{name}-errata.md": text.errata(account),
        f"{name}.json": json.dumps(account.to_dict(), indent=2, allow_nan=False) + "\n",
    }
    files = [folder / file for file in texts]
    for file, content in zip(files, texts.values(), strict=True):
        with whole_file(file) as temporary:
            temporary.write_text(content, encoding="utf-8")
    for chapter in account.chapters.values():
        for figure, drawing in chapter.drawings.items():
            files.append(style.save(drawing.figure, folder / text.FIGURES / f"{figure}.{form}"))
    return files
