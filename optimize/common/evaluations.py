"""The evaluations that a design job keeps, from which it goes on where it was interrupted."""

import dataclasses
from collections.abc import Callable
from typing import Any

import fencejax as fj
from fencejax.design import Journal
from fencejax.sorter import Machine


def key(config: Any) -> str:
    """What decides the numbers of an evaluation at a design: every field of a configuration but
    those that its class names in `not_in_key`, what its sorter file says, and the fidelities."""
    fields = (f.name for f in dataclasses.fields(config) if f.name not in config.not_in_key)
    ladder = getattr(fj.Fidelity, config.fidelity)().ladder()
    machine = getattr(config, "machine", None)
    said = machine.signature if isinstance(machine, Machine) else ""
    rungs = [vars(rung) for rung in ladder]
    return repr({name: getattr(config, name) for name in fields}) + repr(rungs) + said


def journal(
    config: Any, say: Callable[..., None], name: str = "evaluations", more: str = ""
) -> Journal:
    """`evaluations.jsonl` in the folder of a job, with a line on what it holds already; of a job
    that has several problems, one by `name`, with `more` that decides its numbers.

    Raises `ValueError` where it holds those of another problem.
    """
    kept = Journal(config.out / f"{name}.jsonl", key(config) + more)
    if len(kept) or kept.torn:
        say(str(kept))
    return kept
