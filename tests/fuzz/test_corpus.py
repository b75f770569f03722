"""Cases that once failed, and the harness that finds them."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.commands import ENVIRONMENT, ROOT
from tests.fuzz.harness import Case, Fault, Target, alone, run, smaller

CORPUS = Path(__file__).parent / "corpus"
CASES = sorted(str(path.relative_to(CORPUS)) for path in CORPUS.glob("*/*"))


@pytest.fixture(scope="module")
def tried() -> dict[str, str]:
    """What is wrong with each case; from one process, as that is quicker."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "--corpus"],
        cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", CASES)
def test_corpus(name: str, tried: dict[str, str]) -> None:
    assert tried[name] == ""


# --- the harness ---------------------------------------------------------------------------------


def sixteen(rng: random.Random) -> Case:
    return Case(".txt", rng.randbytes(16))


def fails(case: Case, folder: Path) -> str:
    """In every way, by the first byte; for the others it is well."""
    first = case.data[0] if case.data else 255
    if first < 16:
        raise ZeroDivisionError
    if first < 32:
        os.abort()
    if first < 48:
        until = time.process_time() + 2.2
        while time.process_time() < until:
            pass
    if first < 64:
        bytearray(b"x") * (550 << 20)
    if first < 80:
        os.write(2, b"libtoy: oops\n")
    return "well"


TOY = Target("toy", 100, sixteen, fails)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("first", "kind"),
    [(1, "traceback"), (17, "crash"), (33, "slow"), (49, "large"), (65, "output"), (99, None)],
)
def test_every_fault_is_seen(first: int, kind: str | None) -> None:
    fault = alone(TOY, Case(".txt", bytes([first])))
    assert (fault and fault.kind) == kind


def test_a_fault_of_a_long_case_is_told_whole() -> None:
    """It is longer than what a pipe holds."""
    case = Case(".txt", bytes([1]) * 3_000_000)
    fault = alone(TOY, case)
    assert fault is not None and (fault.kind, fault.case) == ("traceback", case)


@pytest.mark.nightly
def test_a_run_goes_on_behind_a_fault() -> None:
    """Crashes included; each kind is told once and counted as often as there is one."""

    def attempt(case: Case, folder: Path) -> str:
        return fails(case, folder) if case.data[0] < 32 else "well"

    toy = Target("toy", 100, sixteen, attempt)
    firsts = [toy.make(random.Random(f"5 toy {index}")).data[0] for index in range(100)]
    crashes = sum(16 <= first < 32 for first in firsts)
    tracebacks = sum(first < 16 for first in firsts)
    assert crashes and tracebacks
    tally = run(toy, 100, 5, 60.0, 3)
    assert tally.cases == 100
    assert tally.counts == {"crash": crashes, "traceback": tracebacks}
    assert sorted(kind for kind, _ in tally.faults) == ["crash", "traceback"]


@pytest.mark.nightly
def test_cases_are_made_smaller() -> None:
    def attempt(case: Case, folder: Path) -> str:
        if b"7" in case.data:
            raise ValueError
        return ""

    toy = Target("toy", 1, sixteen, attempt)
    noise = Case(".txt", b"abc" * 20 + b"7" + b"xyz" * 20)
    tree = Case(".json", b'{"a": [1, 2, {"b": 7, "c": 3}], "d": {"e": 1}}')
    for case, least in ((noise, b"7"), (tree, b'{"a": [{"b": 7}]}')):
        fault = alone(toy, case)
        assert isinstance(fault, Fault)
        assert smaller(toy, fault).case.data == least
