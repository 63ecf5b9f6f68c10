"""The truths that tests of extreme and of random scenes compare with, kept in `truths.json`.

Most of what they take is compiling, and they change with the model alone. From the folder `tests`:

    python -m robustness.truth_record            # computed anew, beside the record; minutes
    python -m robustness.truth_record --record   # the record anew

The record knows of which numbers and of which settings it is: a test that has others fails.
"""

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

import fencejax as fj

RECORD = Path(__file__).with_name("truths.json")
# Digits kept of a truth, which is right to four, and of the numbers that it is of: processors
# differ in the last place of logarithms and powers.
_DIGITS = 9


class Truth(NamedTuple):
    """Status (lanes,), peak force [N] (lanes,), its time [s] (lanes,; NaN where it is not measured)
    and its derivatives by varied numbers, each times the number (lanes, varied) [N]."""

    status: np.ndarray
    peak: np.ndarray
    time: np.ndarray
    slopes: np.ndarray

    @classmethod
    def without_time(cls, status, peak, slopes) -> "Truth":
        """A truth whose derivatives are given number by number, (lanes,) each."""
        return cls(status, peak, np.full(len(status), np.nan), np.stack(slopes, axis=-1))

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> "Truth":
        """The truth that a row of the record holds."""
        return cls(*(np.array(row[field]) for field in cls._fields))


def _key(numbers: Mapping[str, Any], varied: tuple[str, ...], fidelity: fj.Fidelity) -> str:
    """What a truth is of."""
    shown = {name: [f"{x:.6g}" for x in np.ravel(value)] for name, value in numbers.items()}
    settings = {name: repr(value) for name, value in vars(fidelity).items()}
    text = json.dumps([shown, varied, settings])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def recorded(
    name: str, numbers: Mapping[str, Any], varied: tuple[str, ...], fidelity: fj.Fidelity
) -> Truth:
    """The truth on record of scenes with these numbers (lanes,), at the truth's settings.

    Raises `AssertionError` where the record is of others.
    """
    found = json.loads(RECORD.read_text()).get(name, {})
    assert found.get("of") == _key(numbers, varied, fidelity), (
        f"{RECORD.name} has no truth of these scenes: cd tests && python -m robustness.truth_record"
        " --record"
    )
    return Truth.of(found)


class Case(NamedTuple):
    """Scenes whose truth is on record: their numbers, what is varied, the settings, and what
    computes it."""

    numbers: Mapping[str, Any]
    varied: tuple[str, ...]
    fidelity: fj.Fidelity
    compute: Callable[[], Truth]


def _cases() -> dict[str, Case]:
    """Every truth on record."""
    from robustness import extreme_sorts, test_extremes, test_fuzz

    return {**extreme_sorts.truths(), **test_extremes.truths(), **test_fuzz.truths()}


def _rounded(values: np.ndarray) -> list[Any]:
    """As lists of `_DIGITS` digits."""
    if values.ndim > 1:
        return [_rounded(row) for row in values]
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _apart(one: Truth, other: Truth) -> dict[str, float]:
    """The largest differences of lanes with a good status, relative to the peak force."""
    good = np.maximum(one.status, other.status) <= fj.Status.LEFT_OVER_TIP
    good &= np.maximum(one.peak, other.peak) > 0
    size = np.maximum(one.peak, other.peak)[good]
    slopes = np.linalg.norm(one.slopes[good] - other.slopes[good], axis=1)
    return {
        "statuses": float(np.sum(one.status != other.status)),
        "peak": float(np.max(np.abs(one.peak - other.peak)[good] / size)),
        "slopes": float(np.max(slopes / size)),
    }


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    known = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    lines, begin = [], time.perf_counter()
    for name, case in _cases().items():
        truth = case.compute()
        print(f"{name}: {len(truth.status)} scenes ({time.perf_counter() - begin:.0f} s)")
        key = _key(case.numbers, case.varied, case.fidelity)
        if known.get(name, {}).get("of") == key:
            print("  apart from the record:", _apart(Truth.of(known[name]), truth))
        else:
            print("  not on record")
        fields = {field: _rounded(value) for field, value in truth._asdict().items()}
        lines.append(f"{json.dumps(name)}: {json.dumps({'of': key, **fields})}")
        jax.clear_caches()
    if given.record:
        RECORD.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    return 0


if __name__ == "__main__":
    fj.tune_compiler()
    sys.exit(main())
