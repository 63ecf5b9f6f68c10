"""Equal operations of a traced program are merged into one, and unread ones left out.

XLA would do so too, but late: until then each of its passes, and JAX's lowering, handles all of
them. A program of derivatives has many, as each rule computes its factors by itself.
"""

from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

from .dependence import CALLS

# Operations that return their operand unchanged.
_SAME = {"copy", "copy_p"}
# The settings of an operation that are programs, by its name.
_PROGRAMS = {
    "while": ("cond_jaxpr", "body_jaxpr"),
    "cond": ("branches",),
    "scan": ("jaxpr",),
    **dict.fromkeys(CALLS, ("jaxpr",)),
}


def shared(program: ClosedJaxpr) -> ClosedJaxpr:
    """The same program with equal operations on equal operands merged, and without operations whose
    results nothing reads, in inner programs too. Its results and derivatives are the same."""
    return _shared(program, {})


def _shared(program: ClosedJaxpr, done: dict[int, ClosedJaxpr]) -> ClosedJaxpr:
    # Programs that several operations share stay shared.
    found = done.get(id(program))
    if found is not None:
        return found
    same: dict[Any, Any] = {}
    known: dict[Any, Any] = {}

    def now(v):
        return v if isinstance(v, Literal) else same.get(v, v)

    equations = []
    for equation in program.jaxpr.eqns:
        operands = [now(v) for v in equation.invars]
        name = equation.primitive.name
        if name in _SAME and equation.outvars[0].aval == operands[0].aval:
            same[equation.outvars[0]] = operands[0]
            continue
        key = _key(equation, operands)
        first = None if key is None else known.get(key)
        if first is not None and _alike(first, equation.outvars):
            same.update(zip(equation.outvars, first, strict=True))
            continue
        if key is not None:
            known[key] = equation.outvars
        settings = equation.params
        for setting in _PROGRAMS.get(name, ()):
            inner = settings.get(setting)
            if isinstance(inner, tuple):
                settings = {**settings, setting: tuple(_shared(one, done) for one in inner)}
            elif isinstance(inner, ClosedJaxpr):
                settings = {**settings, setting: _shared(inner, done)}
        equations.append(equation.replace(invars=operands, params=settings))
    results = [now(v) for v in program.jaxpr.outvars]
    jaxpr = program.jaxpr.replace(eqns=_read(equations, results), outvars=results)
    done[id(program)] = found = ClosedJaxpr(jaxpr, program.consts)
    return found


def _read(equations, results):
    """The operations that the results depend on, or that have effects."""
    read, found = {v for v in results if not isinstance(v, Literal)}, []
    for equation in reversed(equations):
        if equation.effects or not read.isdisjoint(equation.outvars):
            read.update(v for v in equation.invars if not isinstance(v, Literal))
            found.append(equation)
    return found[::-1]


def _alike(first, second) -> bool:
    return all(a.aval == b.aval for a, b in zip(first, second, strict=True))


def _key(equation, operands):
    """The identity of an operation; `None` for one that is not to be merged."""
    if equation.effects or equation.primitive.name in _PROGRAMS:
        return None
    read = tuple(_literal(v) if isinstance(v, Literal) else v for v in operands)
    key = equation.primitive, read, tuple(sorted(equation.params.items(), key=lambda p: p[0]))
    try:
        hash(key)
    except TypeError:
        return None
    return key


def _literal(v):
    return v.aval, np.asarray(v.val).tobytes()
