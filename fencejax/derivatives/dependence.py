"""The dependence of a traced program's numbers on each other, read off its operations."""

from collections.abc import Sequence

import jax.numpy as jnp
from jax.extend.core import Jaxpr, Literal, Var

# Operations on numbers whose derivative is zero everywhere.
CONSTANT = {"stop_gradient", "floor", "ceil", "round", "sign"}
# Operations that call another program.
CALLS = {"jit", "pjit", "closed_call", "core_call"}


def called(equation):
    """The program that one of `CALLS` runs."""
    return equation.params.get("jaxpr", equation.params.get("call_jaxpr"))


def repeated(body: Jaxpr, carry: list[bool], others: list[bool], lead: int = 0) -> list[bool]:
    """Which numbers of a carry depend on the marked ones after any number of trips. The body's
    inputs are the first `lead` of the `others`, the carry, and the rest of the others; its first
    results are the carry."""
    while True:
        after = reached(body, [*others[:lead], *carry, *others[lead:]])
        found = [a or b for a, b in zip(carry, after[: len(carry)], strict=True)]
        if found == carry:
            return carry
        carry = found


def reached(program: Jaxpr, marks: list[bool]) -> list[bool]:
    """Which results of a program depend, smoothly, on its marked inputs."""
    moving = {v for v, mark in zip(program.invars, marks, strict=True) if mark}

    def moves(v) -> bool:
        return not isinstance(v, Literal) and v in moving

    for equation in program.eqns:
        ins = [moves(v) for v in equation.invars]
        if any(ins) and equation.primitive.name not in CONSTANT:
            outs = _results(equation, ins)
            moving.update(
                v
                for v, out in zip(equation.outvars, outs, strict=True)
                if out and is_number(v.aval)
            )
    return [moves(v) for v in program.outvars]


def _results(equation, ins: list[bool]) -> list[bool]:
    """Which results of an operation depend on its marked operands; all results for an operation
    without inner programs."""
    name, params = equation.primitive.name, equation.params
    if name in CALLS:
        return reached(called(equation).jaxpr, ins)
    if name == "while":
        first, second = params["cond_nconsts"], params["body_nconsts"]
        others, carry = ins[first : first + second], ins[first + second :]
        return repeated(params["body_jaxpr"].jaxpr, carry, others, second)
    if name == "scan":
        body, first, carried = params["jaxpr"].jaxpr, params["num_consts"], params["num_carry"]
        end = first + carried
        carry = repeated(body, ins[first:end], [*ins[:first], *ins[end:]], first)
        return [*carry, *reached(body, [*ins[:first], *carry, *ins[end:]])[carried:]]
    if name == "cond":
        each = [reached(branch.jaxpr, ins[1:]) for branch in params["branches"]]
        return [any(outs) for outs in zip(*each, strict=True)]
    return [True] * len(equation.outvars)


def matters(program: Jaxpr, wanted: list[bool]) -> set[Var]:
    """The numbers of a program whose derivatives those of its `wanted` results depend on."""
    found = {
        v
        for v, want in zip(program.outvars, wanted, strict=True)
        if want and not isinstance(v, Literal) and is_number(v.aval)
    }
    for equation in reversed(program.eqns):
        outs = [v in found for v in equation.outvars]
        if any(outs) and equation.primitive.name not in CONSTANT:
            found.update(
                v
                for v, needed in zip(equation.invars, _operands(equation, outs), strict=True)
                if needed and not isinstance(v, Literal) and is_number(v.aval)
            )
    return found


def kept(
    body: Jaxpr, wanted: list[bool], lead: int, further: Sequence[bool] = ()
) -> tuple[list[bool], list[bool]]:
    """Which inputs of a loop's body, besides the carry, and which numbers of the carry affect the
    `wanted` numbers of the carry, and of the body's `further` results, after any number of trips.
    `lead` inputs are before the carry."""
    while True:
        found = matters(body, [*wanted, *further])
        needed = [v in found for v in body.invars]
        end = lead + len(wanted)
        carry = [a or b for a, b in zip(wanted, needed[lead:end], strict=True)]
        if carry == wanted:
            return [*needed[:lead], *needed[end:]], carry
        wanted = carry


def _operands(equation, outs: list[bool]) -> list[bool]:
    """Which operands of an operation affect its marked results."""
    name, params = equation.primitive.name, equation.params
    if name in CALLS:
        inner = called(equation).jaxpr
        found = matters(inner, outs)
        return [v in found for v in inner.invars]
    if name == "while":
        others, carry = kept(params["body_jaxpr"].jaxpr, outs, params["body_nconsts"])
        return [*[False] * params["cond_nconsts"], *others, *carry]
    if name == "scan":
        first, carried = params["num_consts"], params["num_carry"]
        others, carry = kept(params["jaxpr"].jaxpr, outs[:carried], first, outs[carried:])
        return [*others[:first], *carry, *others[first:]]
    if name == "cond":
        every = [matters(branch.jaxpr, outs) for branch in params["branches"]]
        places = zip(*(branch.jaxpr.invars for branch in params["branches"]), strict=True)
        found = [any(v in each for v, each in zip(vs, every, strict=True)) for vs in places]
        return [False, *found]
    return [True] * len(equation.invars)


def is_number(aval) -> bool:
    """Whether a traced value has floating-point numbers."""
    return hasattr(aval, "dtype") and jnp.issubdtype(aval.dtype, jnp.floating)
