"""`towline reproduce`: recompute a paper, claim by claim."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..base.errors import InputError
from .options import FormatOption, JsonOption, parameters, print_json, print_written
from .watching import progress_bar

if TYPE_CHECKING:
    from ..studies.accounts.claim import Account


@parameters("""
    PAPER: flying: the flying cable robot; ctmrts: the towing robots.
    --out: Folder for report, errata and figures; default: towline-PAPER.
""")
def reproduce(paper: str, out: Path | None = None, form: FormatOption = "png", as_json: JsonOption = False) -> None:
    """Recompute the equations, tables and figures of a paper, and report for each claim whether it is reproduced."""
    from ..base.writing import check_writable
    from ..studies.accounts.files import write
    from ..studies.papers import PAPERS

    if paper not in PAPERS:
        raise InputError(f"PAPER must be one of {', '.join(PAPERS)}, got {paper!r}")
    folder = out if out is not None else Path(f"towline-{paper}")
    check_writable(folder / f"{paper}.html")
    with progress_bar("", quiet=as_json) as progress:
        account = PAPERS[paper](progress)
    files = write(account, folder, form)
    if as_json:
        print_json({**account.to_dict(), "files": files})
    else:
        _show(account)
        print_written(files)
    if not account.complete:
        raise typer.Exit(1)


def _show(account: Account) -> None:
    from ..studies.accounts.claim import Verdict
    from ..studies.accounts.files import numbers_text

    typer.echo(f"{account.paper.source}\n  {account.summary()}; {account.seconds:.1f} s")
    for title, chapter in account.chapters.items():
        typer.echo(f"  {title}")
        for claim in chapter.claims:
            typer.echo(f"    {claim.verdict.value:<15} {claim.id}")
            if claim.verdict is not Verdict.REPRODUCED:
                typer.echo(f"      {claim.place}: {claim.statement}")
                typer.echo(f"      {claim.why} {numbers_text(claim)}".rstrip())
    for title, why in account.broken.items():
        typer.echo(f"  {title}: not computed: {why}")
