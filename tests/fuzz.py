"""Spoil files of every reader by the thousand, and print what is neither read nor refused.

    python tests/fuzz.py [--seconds S] [--mutants N] [--first SEED] [--out FOLDER] [READER ...]

A child process reads one mutant after the other, under a limit of memory; it is replaced when it
crashes or hangs. Kinds of faults (by their last line and place in the code) are printed once, with
the seed that makes the first; what was spoilt is left in the folder. Exit code 1: a fault.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import io
import json
import os
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage

from kerfpath.cli.show import out
from readers import READERS
from spoilt import complaint, spoilt

HANG = 20.0
"""Time of the processor that no small file needs, s; a process is killed after three times that."""
MEMORY = 2 * 1024**3
"""Bytes of address space that a process may take beside what it has before it reads."""


def child(name: str) -> None:
    """Read mutants: a seed and a folder in per line, what is wrong with the answer out."""
    faulthandler.enable()
    answers = sys.stdout
    sys.stdout = sys.stderr
    out.quiet = True  # as with --json
    reader = READERS[name]
    folder = Path(tempfile.mkdtemp(prefix=f"fuzz-{name}-"))
    try:
        wholes = reader.wholes(folder)
        sound = {whole.spoilt: whole.spoilt.read_bytes() for whole in wholes}
        with contextlib.redirect_stdout(io.StringIO()):
            for whole in wholes:
                reader.read(whole.main)
        _limit()
        print("ready", file=answers, flush=True)
        for line in sys.stdin:
            seed, keep = json.loads(line)
            whole, content = spoilt(wholes, sound, seed)
            Path(keep).write_bytes(content)
            whole.spoilt.write_bytes(content)
            started = time.process_time()
            wrong = complaint(reader.read, whole)
            took = time.process_time() - started
            if took > HANG / 2:
                wrong += f"\ntook {took:.1f} s"
            peak = max(map(_peak, (RUSAGE_SELF, RUSAGE_CHILDREN)))
            print(json.dumps([whole.spoilt.name, wrong, took, peak]), file=answers, flush=True)
            whole.spoilt.write_bytes(sound[whole.spoilt])
    finally:
        shutil.rmtree(folder)


def _peak(who: int) -> float:
    """Return the most memory that a process, or one that it waited for, has had, MB."""
    return getrusage(who).ru_maxrss / 1024


def _limit() -> None:
    """Bound what may be allocated from here on, where the system can."""
    import resource

    status = Path("/proc/self/status").read_text()
    size = int(re.search(r"VmSize:\s+(\d+)", status)[1]) * 1024
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))


class Campaign:
    """Mutants of one reader, read by a child, and the kinds of faults that they brought out."""

    def __init__(self, name: str, out: Path) -> None:
        self.name, self.out = name, out
        self.faults: Counter[str] = Counter()
        self.mutants = 0
        self.slowest = self.most = 0.0
        self.child: subprocess.Popen[str] | None = None
        out.mkdir(parents=True, exist_ok=True)
        self.said = (out / "stderr.txt").open("w+")

    def run(self, first: int, mutants: int, seconds: float) -> None:
        self.start()
        until = time.monotonic() + seconds
        for seed in range(first, first + mutants):
            if time.monotonic() > until:
                break
            self.one(seed)
        if self.child is not None:
            self.child.stdin.close()
            self.child.wait()
        self.said.close()

    def start(self) -> None:
        self.child = subprocess.Popen(
            [sys.executable, __file__, "--child", self.name],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.said, text=True,
        )  # fmt: skip
        ready = self.child.stdout.readline()
        if ready.strip() != "ready":
            self.said.seek(0)
            raise SystemExit(f"{self.name}: sound files are not read:\n{self.said.read()[-3000:]}")
        self.said.seek(0, 2)

    def one(self, seed: int) -> None:
        if self.child is None:
            self.start()
        where, kept = self.said.tell(), self.out / f"{self.name}-{seed}"
        self.child.stdin.write(json.dumps([seed, str(kept)]) + "\n")
        self.child.stdin.flush()
        started = time.monotonic()
        file, wrong = "", "hangs"
        until = _used(self.child.pid) + 3 * HANG
        while not (answered := select.select([self.child.stdout], [], [], HANG)[0]):
            if _used(self.child.pid) > until or time.monotonic() - started > 60 * HANG:
                break
        if answered:
            answer = self.child.stdout.readline()
            if answer:
                file, wrong, took, peak = json.loads(answer)
                self.slowest, self.most = max(self.slowest, took), max(self.most, peak)
            else:
                wrong = f"crashes: {self.child.wait()}"
        else:
            self.child.kill()
            self.child.wait()
        self.said.seek(where)
        if more := self.said.read().strip():
            wrong = f"{wrong} says {more[-1500:]}"
        if self.child.poll() is not None:
            self.child = None
        self.mutants += 1
        if not wrong:
            kept.unlink()
            return
        kind = _kind(wrong)
        self.faults[kind] += 1
        if self.faults[kind] > 1:
            kept.unlink(missing_ok=True)
            return
        took = time.monotonic() - started
        print(f"--- {self.name} seed {seed} {file} ({took:.1f} s)\n{wrong.strip()}", flush=True)


def _used(pid: int) -> float:
    """Return the time of the processor that a process and those it has started have used, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    used = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    for started in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(FileNotFoundError):  # it has just ended
            used += sum(map(_used, map(int, started.read_text().split())))
    return used


def _kind(wrong: str) -> str:
    """Return what makes two faults the same: where in our code, and the kind of error."""
    places = re.findall(r"kerfpath/(?!errors)([\w/]+\.py)\", line (\d+)", wrong)
    last = wrong.strip().splitlines()[-1]
    if wrong.startswith("Traceback"):
        return f"{last.split(':')[0]} at {':'.join(places[-1]) if places else '?'}"
    return re.sub(r"[\d'\"]+", "", wrong)[:60]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("readers", nargs="*", choices=[*READERS, []], metavar="READER")
    parser.add_argument(
        "--seconds", type=float, default=1e9, help="per reader, once it has read sound files"
    )
    parser.add_argument("--mutants", type=int, default=1000, help="per reader")
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--out", type=Path, default=Path("fuzzed"))
    parser.add_argument("--child", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.child:
        child(asked.child)
        return 0
    bad = 0
    for name in asked.readers or READERS:
        campaign = Campaign(name, asked.out)
        started = time.monotonic()
        campaign.run(asked.first, asked.mutants, asked.seconds)
        faults = sum(campaign.faults.values())
        bad += faults
        print(
            f"{name}: {campaign.mutants} mutants, {faults} faults of {len(campaign.faults)} kinds, "
            f"slowest {campaign.slowest:.1f} s, most {campaign.most:.0f} MB, "
            f"{time.monotonic() - started:.0f} s in all"
        )
        for kind, count in campaign.faults.most_common():
            print(f"    {count:5} {kind}")
        sys.stdout.flush()
    return bad > 0


if __name__ == "__main__":
    sys.exit(main())
