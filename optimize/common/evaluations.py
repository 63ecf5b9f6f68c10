"""The journal of a design job, from which an interrupted job resumes."""

import dataclasses
from collections.abc import Callable
from typing import Any

import fencejax as fj
from fencejax.design import Journal
from fencejax.sorter import Machine


def key(config: Any) -> str:
    """Everything that an evaluation at a design depends on: every field of a configuration except
    those that its class names in `not_in_key`, the contents of its sorter file, and the
    fidelities."""
    fields = (f.name for f in dataclasses.fields(config) if f.name not in config.not_in_key)
    ladder = getattr(fj.Fidelity, config.fidelity)().ladder()
    machine = getattr(config, "machine", None)
    signature = machine.signature if isinstance(machine, Machine) else ""
    rungs = [vars(rung) for rung in ladder]
    return repr({name: getattr(config, name) for name in fields}) + repr(rungs) + signature


def journal(
    config: Any, say: Callable[..., None], name: str = "evaluations", more: str = ""
) -> Journal:
    """The journal `evaluations.jsonl` in the folder of a job; prints how much it has already. A job
    with several problems has one for each by `name`, with `more` that its numbers depend on.

    Raises `ValueError` where it belongs to another problem.
    """
    kept = Journal(config.out / f"{name}.jsonl", key(config) + more)
    if len(kept) or kept.torn or kept.foreign:
        say(str(kept))
    return kept
