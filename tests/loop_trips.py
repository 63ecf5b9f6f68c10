"""How often the loops of a program run: what it costs, where its size tells what a trip costs."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, jaxpr_as_fun
from jaxtyping import Array

_DEPTH = 3


def loop_trips(function: Callable[..., Any], *arguments: Any) -> list[int]:
    """The trips of the loops of a program, summed over those of one depth: of the outermost ones,
    of those within these, and so on, as far as there are any. The program is run with the counters
    of the trips beside the numbers of its loops.

    >>> def powers(x):
    ...     inner = lambda y: jax.lax.while_loop(lambda z: z < 100, lambda z: 10 * z, y + 1)
    ...     return jax.lax.while_loop(lambda y: y < 1e6, lambda y: inner(y) + 1e5, x)
    >>> loop_trips(powers, 1.0)
    [10, 2]
    """
    program = jax.make_jaxpr(function)(*arguments)
    leaves = jax.tree.leaves(arguments)
    trips = jax.jit(lambda *given: _run(program.jaxpr, program.consts, given, 0)[1])(*leaves)
    counts = [int(count) for count in jax.device_get(trips)]
    while counts and not counts[-1]:
        counts.pop()
    return counts


def _run(
    program: Jaxpr, consts: Sequence[Any], arguments: Sequence[Any], depth: int
) -> tuple[list[Any], Array]:
    """The results of a program inside so many loops, and the trips by depth."""
    known = dict(zip([*program.constvars, *program.invars], [*consts, *arguments], strict=True))
    trips = jnp.zeros(_DEPTH, int)

    def value(variable):
        return variable.val if isinstance(variable, Literal) else known[variable]

    for equation in program.eqns:
        given, name = [value(v) for v in equation.invars], equation.primitive.name
        if name in _LOOPS:
            found, more = _LOOPS[name](equation.params, given, depth)
        elif name == "cond":
            found, more = jax.lax.switch(
                given[0],
                [lambda *x, b=b: _run(b.jaxpr, b.consts, x, depth)
                 for b in equation.params["branches"]],
                *given[1:],
            )  # fmt: skip
        elif (inner := _inner(equation)) is not None:
            found, more = _run(inner.jaxpr, inner.consts, given, depth)
        else:
            made = equation.primitive.bind(*given, **equation.params)
            found, more = made if equation.primitive.multiple_results else [made], 0
        trips = trips + more
        known.update(zip(equation.outvars, found, strict=True))
    return [value(v) for v in program.outvars], trips


def _while(parameters: dict[str, Any], given: list[Any], depth: int) -> tuple[list[Any], Array]:
    """A loop that goes on until its condition fails, with its trips."""
    cond, body = parameters["cond_jaxpr"], parameters["body_jaxpr"]
    first, second = parameters["cond_nconsts"], parameters["body_nconsts"]
    of_cond, of_body, start = given[:first], given[first : first + second], given[first + second :]

    def go_on(carry):
        return jaxpr_as_fun(cond)(*of_cond, *carry[0])[0]

    def trip(carry):
        found, more = _run(body.jaxpr, body.consts, [*of_body, *carry[0]], depth + 1)
        return found, (carry[1] + more).at[depth].add(1)

    return jax.lax.while_loop(go_on, trip, (start, jnp.zeros(_DEPTH, int)))


def _scan(parameters: dict[str, Any], given: list[Any], depth: int) -> tuple[list[Any], Array]:
    """A loop of so many trips, with them."""
    body, first, second = (parameters[name] for name in ("jaxpr", "num_consts", "num_carry"))
    consts, start, rows = given[:first], given[first : first + second], given[first + second :]

    def trip(carry, row):
        found, more = _run(body.jaxpr, body.consts, [*consts, *carry[0], *row], depth + 1)
        return (found[:second], (carry[1] + more).at[depth].add(1)), found[second:]

    (end, trips), columns = jax.lax.scan(
        trip, (start, jnp.zeros(_DEPTH, int)), rows, length=parameters["length"],
        reverse=parameters["reverse"],
    )  # fmt: skip
    return [*end, *columns], trips


_LOOPS = {"while": _while, "scan": _scan}


def _inner(equation: Any) -> ClosedJaxpr | None:
    """The program that an operation calls once, such as that of a `jit`."""
    programs = [v for v in equation.params.values() if isinstance(v, ClosedJaxpr)]
    return programs[0] if len(programs) == 1 else None
