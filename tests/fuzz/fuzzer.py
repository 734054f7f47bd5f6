"""`make fuzz`: damaged files for every reader, hostile arguments for every call that takes arrays.

Each may answer, or refuse in one line; nothing else.

    python tests/fuzz/fuzzer.py --inputs 1000000 --seed 1

Each input is a function of seed and number. It is written to a file before it is read, in a process of its own with a
limit of memory: where that dies or hangs, the file is what did it. Findings are kept in the folder of --keep.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bgars
from hostile import CALLS, hostile_call
from mutate import mutated
from readers import READERS, make_corpus

SLOW_S = 10
"""Processor time: on a busy machine the clock on the wall says little."""
WAITS_S = 120
"""Time on the wall: what uses no processor waits for something that never comes."""
MEMORY_BYTES = 6 << 30
BATCH = 5000


class Slow(BaseException):
    """An input took too long."""


def _too_slow(_signal: int, _frame: object) -> None:
    raise Slow


@contextmanager
def limited() -> Iterator[None]:
    """Raise Slow in what takes too long."""
    signal.signal(signal.SIGPROF, _too_slow)
    signal.signal(signal.SIGALRM, _too_slow)
    signal.setitimer(signal.ITIMER_PROF, SLOW_S)
    signal.alarm(WAITS_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)


def verdict_of(name: str, path: Path) -> str:
    """Read a file; return "" where that went as it must, else what was wrong."""
    read, _ = READERS[name]
    try:
        with limited(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
    except bgars.BgarsError as error:
        text = str(error)
        if "\n" in text.strip() or len(text) > 5000:
            return f"not one line: {type(error).__name__}"
    except MemoryError:
        return "raw MemoryError"
    except Slow:
        return f"slow: more than {SLOW_S} s"
    except Exception as error:
        return f"raw {type(error).__name__}: {' '.join(str(error).split())[:120]}"
    return ""


def verdict_of_call(name: str, chance: random.Random) -> str:
    """Call with hostile arguments; as :func:`verdict_of`."""
    try:
        with limited(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return hostile_call(name, chance)
    except Slow:
        return f"slow: more than {SLOW_S} s"


def run_calls(name: str, seed: int, start: int, inputs: int, keep: Path) -> Counter[str]:
    """Call so many times; return how many there were of each verdict."""
    found: Counter[str] = Counter()
    current = keep / f"current-{multiprocessing.current_process().pid}"
    for number in range(start, start + inputs):
        current.write_text(f"{name}\t{seed}\t{number}", encoding="utf-8")
        verdict = verdict_of_call(name, random.Random(f"{seed}/{name}/{number}"))
        found[verdict] += 1
        if verdict and found[verdict] <= 3:
            sys.stderr.write(f"{name} {seed}/{number}: {verdict}\n")
    current.unlink()
    return found


def one_input(corpus: Path, name: str, seed: int, number: int) -> tuple[str, bytes]:
    """File name and bytes of an input."""
    chance = random.Random(f"{seed}/{name}/{number}")
    _, patterns = READERS[name]
    files = sorted(path for pattern in patterns for path in corpus.glob(pattern))
    if not files:
        msg = f"{name}: the corpus has no file {patterns}"
        raise FileNotFoundError(msg)
    source = chance.choice(files)
    return source.name, mutated(source.read_bytes(), chance.choice(files).read_bytes(), chance)


def run_batch(corpus: Path, name: str, seed: int, start: int, inputs: int, keep: Path) -> Counter[str]:
    """Read so many inputs, or make so many calls; return how many there were of each verdict."""
    if name in CALLS:
        return run_calls(name, seed, start, inputs, keep)
    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder) / "in"
        shutil.copytree(corpus, work)
        for number in range(start, start + inputs):
            file, content = one_input(corpus, name, seed, number)
            path = work / file
            path.write_bytes(content)
            current = keep / f"current-{multiprocessing.current_process().pid}"
            current.write_text(f"{name}\t{seed}\t{number}\t{file}", encoding="utf-8")
            verdict = verdict_of(name, path)
            found[verdict] += 1
            if verdict and found[verdict] <= 3:
                (keep / f"{name.replace(' ', '-')}-{seed}-{number}-{file}").write_bytes(content)
                sys.stderr.write(f"{name} {seed}/{number} {file}: {verdict}\n")
            path.write_bytes((corpus / file).read_bytes())
        current.unlink()
    return found


def _limited(arguments: tuple[Path, str, int, int, int, Path], results: multiprocessing.Queue) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    results.put(run_batch(*arguments))


def run(inputs: int, seed: int, keep: Path, only: str | None = None) -> Counter[str]:
    """Read so many inputs in all, reader by reader; return how many were not as they must be, by verdict."""
    keep.mkdir(parents=True, exist_ok=True)
    wrong: Counter[str] = Counter()
    tried = 0
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder) / "corpus"
        make_corpus(corpus)
        names = [only] if only else [*READERS, *CALLS]
        each = -(-inputs // len(names))
        context = multiprocessing.get_context("spawn")  # threads of the parent would not be there after a fork
        for start in range(0, each, BATCH):
            for name in names:
                count = min(BATCH, each - start)
                results = context.Queue()
                child = context.Process(target=_limited, args=((corpus, name, seed, start, count, keep), results))
                child.start()
                try:
                    found = results.get(timeout=3600)
                except Exception:
                    found = Counter({"process died or hung": 1})
                    child.kill()
                child.join()
                tried += sum(found.values())
                wrong.update({f"{name}: {verdict}": times for verdict, times in found.items() if verdict})
            sys.stderr.write(f"{tried} inputs, {sum(wrong.values())} not as they must be\n")
    return wrong


def main() -> int:
    """Run and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--only", choices=sorted([*READERS, *CALLS]))
    given = parser.parse_args()
    wrong = run(given.inputs, given.seed, given.keep, given.only)
    for verdict, times in wrong.most_common():
        sys.stdout.write(f"{times:8d}  {verdict}\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
