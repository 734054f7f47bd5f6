"""Every command that README and docs show runs, on small captures; every option that they name exists."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bgars
import pytest
import typer
from bgars.cli import main
from bgars.cli.app import app
from bgars.records.part_identity import PartIdentity
from judged_parts import write_results, write_study
from line_captures import RECIPE, captures
from stored_parts import part as stored_part

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
NOT_RUN = {
    "bgars calibrate ": "photographs of targets; test_station_*.py simulates them",
    "bgars verify run1/": "three runs with a certificate; test_station_verify.py",
    "bgars watch INBOX": "runs until it is stopped; test_watch.py",
    "--scheduler": "a cluster; test_cluster.py",
    "bgars send ": "a broker; test_amqp.py, test_send.py",
    "grr study -o out --recipe": "a dozen captures; test_studies_command.py",
}
"""Part of a command that is not run: what it needs, and where it is tested. Its options are checked all the same."""
WHOLE_CODES = {0, 1}
"""1: the part, the study or the process does not pass."""


def documented(page: Path) -> Iterator[str]:
    """Commands of the fenced blocks of a page, and those between backquotes in its text."""
    text = page.read_text(encoding="utf-8")
    yield from fenced(text)
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    yield from (" ".join(span.split()) for span in re.findall(r"`(bgars [a-z][^`]*)`", prose))


def fenced(text: str) -> Iterator[str]:
    for kind, block in re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        if kind in {"", "sh"}:
            yield from (line.strip() for line in block.splitlines() if line.startswith("bgars "))


def part(folder: Path, *names: str) -> None:
    captures(folder, *names)
    (folder / "part.toml").write_text(RECIPE, encoding="utf-8")


def station(folder: Path) -> None:
    part(folder, "part")
    bgars.write_station(bgars.Station("line 3"), folder / "station.toml")


def studies(folder: Path) -> None:
    write_study(folder / "study", parts=2)
    write_results(folder / "results", 24)
    store = bgars.open_store(folder / "store", create=True)
    for number in range(12):
        store.append(replace(stored_part(number), identity=PartIdentity(lot="L7")))
    (folder / "references.csv").write_text(
        "part,ball,characteristic,reference\npart1,A1,top_um,500\npart2,A1,top_um,501\n", encoding="utf-8"
    )


SETUPS: dict[str, Callable[[Path], None]] = {
    "inspection.md": lambda folder: part(folder, "FOLDER"),
    "line.md": lambda folder: part(folder, "lots/L7/SN0041", "lots/L7/SN0042"),
    "result.md": lambda folder: part(folder, "part"),
    "shape.md": lambda folder: part(folder, "FOLDER"),
    "station.md": station,
    "studies.md": studies,
}
"""What a page takes for granted, in the folder where its commands run, in their order."""


def run(line: str) -> tuple[int, str]:
    """Run a command in this process; the patterns of its arguments, and what follows a >, are the shell's."""
    words = shlex.split(line, comments=True)[1:]
    if ">>" in words:
        words = words[: words.index(">>")]
    words = [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
    told = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        patch.setattr(sys, "argv", ["bgars", *words])
        with pytest.raises(SystemExit) as stop:
            main()
    return int(stop.value.code or 0), told.getvalue()


@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", [page for page in PAGES if any(fenced(page.read_text("utf-8")))], ids=lambda p: p.name)
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    SETUPS.get(page.name, lambda _: None)(tmp_path)
    monkeypatch.chdir(tmp_path)
    for line in fenced(page.read_text(encoding="utf-8")):
        if not any(words in line for words in NOT_RUN):
            code, told = run(line)
            assert code in WHOLE_CODES, f"{line}\n{told}"


def test_what_is_not_run_is_still_documented() -> None:
    lines = [line for page in PAGES for line in fenced(page.read_text(encoding="utf-8"))]
    assert [words for words in NOT_RUN if not any(words in line for line in lines)] == []


def options_of(command: Any) -> set[str]:  # noqa: ANN401 - a command of whichever click typer brings
    """Options of a command and of what is below it."""
    command = command.load() if hasattr(command, "load") else command
    below = (options_of(each) for each in getattr(command, "commands", {}).values())
    return {"--help"}.union(*((*param.opts, *param.secondary_opts) for param in command.params), *below)


def options(words: list[str]) -> tuple[list[str], set[str]]:
    """The subcommand that words name, and all its options."""
    command, named = typer.main.get_command(app), []
    for word in words:
        found = getattr(command, "commands", {}).get(word)
        if found is None:
            break
        command, named = found, [*named, word]
    return named, options_of(command)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_option_that_a_page_names_exists(page: Path) -> None:
    for line in documented(page):
        words = line.replace("'", " ").replace('"', " ").split("#")[0].split()[1:]
        named, known = options(words)
        assert named or words[0].startswith("-"), f"{line}: no such command"
        told = [word.split("=")[0] for word in words if re.fullmatch(r"--?[a-z][a-z-]*(=.*)?", word)]
        assert [word for word in told if word not in known] == [], f"{line}: has {sorted(known)}"
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r"`(--[a-z][a-z-]*)", text)) <= options_of(typer.main.get_command(app))
