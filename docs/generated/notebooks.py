"""The notebooks as pages, with the outputs that they have."""

import base64
import json
import re
from pathlib import Path

MAGIC = re.compile(r"^%.*\n+", re.MULTILINE)  # commands to the notebook itself
FOLDER = Path(__file__).parent.parent.parent / "notebooks"


def notebooks() -> dict[str, str | bytes]:
    """Return the pages and their pictures by their paths inside docs/."""
    files: dict[str, str | bytes] = {}
    for notebook in sorted(FOLDER.glob("*.ipynb")):
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        parts: list[str] = []
        for index, cell in enumerate(cells):
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                parts.append(source.replace("](../docs/", "](../"))
                continue
            parts.append(_fenced("python", MAGIC.sub("", source)))
            for number, output in enumerate(cell["outputs"]):
                picture = output.get("data", {}).get("image/png")
                if picture is None:
                    printed = output.get("text") or output.get("data", {}).get("text/plain", "")  # or the value's text
                    parts.append(_fenced("text", "".join(printed)))
                    continue
                name = f"{notebook.stem}-{index}-{number}.png"
                files[f"notebooks/{name}"] = base64.b64decode(picture)
                parts.append(f"![What the cell above draws]({name})")
        name = f"The notebook is `notebooks/{notebook.name}`. To run it, open it in JupyterLab or in an editor."
        files[f"notebooks/{notebook.stem}.md"] = "\n\n".join([*parts, name]) + "\n"
    return files


def _fenced(language: str, text: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"
