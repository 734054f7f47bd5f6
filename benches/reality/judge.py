"""Judge bgars on a folder of rendered parts; Markdown goes to the output, progress to the error stream.

python benches/reality/judge.py FOLDER [SCENE ...] [--workers N] [--keep FOLDER] [--no-normals] [--bar] [-v]
"""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import bgars
from figures import criteria, summarise
from judge_scene import judge_scene
from records import SceneRecord, from_json, to_json
from tables import page_lines, progress_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

SCENES = Path(__file__).parent / "scenes"


def scenes_in(folder: Path, names: Sequence[str] = ()) -> list[Path]:
    """Find the scenes of a folder, in the order of their numbers.

    Raises
    ------
    FileNotFoundError
        Where there is none, or a named one is missing.
    """
    found = [path.parent for path in folder.glob("[!.]*/scene.json")]
    found.sort(key=lambda path: (len(path.name), path.name))
    missing = sorted(set(names) - {path.name for path in found})
    if missing or not found:
        msg = f"{folder} holds no scene{f' named {missing[0]}' if missing else ''}: make reality-scenes renders some"
        raise FileNotFoundError(msg)
    return [path for path in found if not names or path.name in names]


def judge_set(
    scenes: Sequence[Path], *, workers: int = 1, keep: Path | None = None, normals: bool = True
) -> Iterator[SceneRecord]:
    """Judge scenes in turn, or in so many processes; a record in `keep` counts if code and scene are still the same."""
    judge = partial(_judge_or_read, keep=keep, normals=normals)
    if workers <= 1:
        yield from map(judge, scenes)
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(judge, scenes)


def _judge_or_read(scene: Path, *, keep: Path | None, normals: bool) -> SceneRecord:
    if keep is None:
        return judge_scene(scene, normals=normals)
    path, state = keep / f"{scene.name}.json", state_of(scene, normals=normals)
    kept = from_json(path.read_text(encoding="utf-8"), state) if path.exists() else None
    if kept:
        return kept
    record = judge_scene(scene, normals=normals)
    keep.mkdir(parents=True, exist_ok=True)
    partly = path.with_suffix(".part")
    partly.write_text(to_json(record, state), encoding="utf-8")
    partly.replace(path)
    return record


def state_of(scene: Path, *, normals: bool) -> str:
    """Digest of bgars' own files, of the files of a scene, and of what is judged."""
    digest = hashlib.sha256(f"{_digest_of_bgars()} {normals}".encode())
    for path in sorted(scene.iterdir()):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def _digest_of_bgars() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(bgars.__file__).parent.rglob("*")):
        if path.suffix in {".py", ".so", ".pyd", ".toml"}:
            digest.update(path.read_bytes())
    return digest.hexdigest()


def judge_aloud(
    scenes: Sequence[Path], *, workers: int, keep: Path | None, normals: bool = True, reasons: bool = False
) -> list[SceneRecord]:
    """Judge scenes, with a line each on the error stream."""
    records = []
    for record in judge_set(scenes, workers=workers, keep=keep, normals=normals):
        records.append(record)
        lines = [progress_line(record)]
        if reasons:
            lines += [f"    reason: {text}" for text in record.reasons] + [f"    warning: {w}" for w in record.warnings]
        sys.stderr.write("\n".join(lines) + "\n")
    return records


def main() -> None:
    """Judge, print the tables; with --bar, fail where something falls short."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=SCENES)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep a record of each scene, to go on from there")
    parser.add_argument("--no-normals", action="store_true", help="inspect only")
    parser.add_argument("--bar", action="store_true", help="exit with 1 where something falls short")
    parser.add_argument("-v", "--verbose", action="store_true", help="print reasons and warnings")
    options = parser.parse_args()
    try:
        scenes = scenes_in(options.folder, options.scenes)
    except FileNotFoundError as error:
        sys.exit(str(error))
    records = judge_aloud(
        scenes,
        workers=options.workers,
        keep=options.keep,
        normals=not options.no_normals,
        reasons=options.verbose,
    )
    print("\n".join(page_lines(records)))
    short = [row.name for row in criteria(summarise(records)) if not row.met]
    sys.stderr.write(f"falls short: {', '.join(short) or 'nothing'}\n")
    sys.exit(1 if options.bar and short else 0)


if __name__ == "__main__":
    main()
