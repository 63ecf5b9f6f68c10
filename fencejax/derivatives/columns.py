"""Forward mode for several directions at once, made from a traced program operation by operation.

`jax.vmap` of `jax.jvp` does the same, but traces each loop's body several times for each of the
two, until it knows which numbers of the carry depend on the directions. Here that is read off the
program, and one pass is enough.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.extend.core import Jaxpr, Literal, jaxpr_as_fun
from jaxtyping import Array

from .column_rules import ARITHMETIC, RULES, Dot, full, of_shape, total_of
from .custom_columns import OPERATION
from .dependence import CALLS, CONSTANT, called, is_number, kept, matters, reached, repeated
from .loop_carry import one_a_lane

# Elementwise operations, whose derivative in each operand is a factor.
_BY_NUMBER = {
    "abs", "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh",
    "erf", "erf_inv", "erfc", "exp", "exp2", "expm1", "integer_pow", "log", "log1p", "logistic",
    "pow", "rsqrt", "sin", "sinh", "sqrt", "square", "tan", "tanh",
}  # fmt: skip


def pushed(
    program: Jaxpr, consts: Sequence[Any], values: Sequence[Any], dots: Sequence[Array | None]
) -> tuple[list[Any], list[Array | None]]:
    """The results of a traced program, and their derivatives along all directions.

    `dots` are those of the `values`, the directions in a first axis; `None` stands for zeros, in
    the results as well.
    """
    given = [None if dot is None else Dot(None, dot) for dot in dots]
    outs, found = _evaluate(program, consts, values, given, [True] * len(program.outvars))
    return outs, [None if dot is None else dot.all() for dot in found]


def _evaluate(program: Jaxpr, consts, values, dots, wanted):
    """The results of a program, and the derivatives of those that are `wanted`."""
    known, moving, needed = {}, {}, matters(program, wanted)

    def read(v):
        return v.val if isinstance(v, Literal) else known[v]

    def read_dot(v):
        return None if isinstance(v, Literal) else moving.get(v)

    known.update(zip(program.constvars, consts, strict=True))
    known.update(zip(program.invars, values, strict=True))
    moving.update((v, dot) for v, dot in zip(program.invars, dots, strict=True) if dot is not None)
    for equation in program.eqns:
        ins = [read(v) for v in equation.invars]
        rates = [read_dot(v) for v in equation.invars]
        outs, found = _apply(equation, ins, rates, [v in needed for v in equation.outvars])
        known.update(zip(equation.outvars, outs, strict=True))
        for v, dot in zip(equation.outvars, found, strict=True):
            if dot is not None:
                moving[v] = dot
    return [read(v) for v in program.outvars], [read_dot(v) for v in program.outvars]


def _apply(equation, ins, rates, wanted):
    """The results of one operation and the derivatives of those that are `wanted`."""
    name = equation.primitive.name
    none = [None] * len(equation.outvars)
    if name in CALLS:
        inner = called(equation)
        return _evaluate(inner.jaxpr, inner.consts, ins, rates, wanted)
    moves = any(dot is not None for dot in rates)
    if not moves or name in CONSTANT or not any(wanted):
        return _plain(equation, ins), none
    if name == "custom_vmap_call":
        inner = equation.params["call"]
        found = _evaluate(inner.jaxpr, inner.consts, ins, rates, wanted)[1]
        return _plain(equation, ins), found
    if name == OPERATION.name:
        outs = _plain(equation, ins)
        dots = [None if dot is None else dot.all() for dot in rates]
        found = equation.params["rule"](ins, outs, dots)
        return outs, [None if dot is None else Dot(None, dot) for dot in found]
    if name in _LOOPS:
        return _LOOPS[name](equation, ins, rates, wanted)
    if name in _BY_NUMBER or name in ARITHMETIC:
        ins, rates = of_shape(equation.outvars[0].aval, ins, rates)
    if name in RULES:
        out = _plain(equation, ins)
        return out, [RULES[name](equation.params, ins, rates, out[0])]
    if name in _BY_NUMBER:
        return _by_number(equation, ins, rates)
    return _any(equation, ins, rates)


def _plain(equation, ins):
    params = equation.primitive.get_bind_params(equation.params)
    # JAX before 0.10 returns the functions among them separately.
    subprograms, params = params if isinstance(params, tuple) else ((), params)
    outs = equation.primitive.bind(*subprograms, *ins, **params)
    return outs if equation.primitive.multiple_results else [outs]


def _function(equation) -> Callable[..., list[Any]]:
    """An operation as a function of all its operands, differentiated by its own rule."""

    def run(*ins):
        return _plain(equation, ins)

    return run


def _by_number(equation, ins, rates):
    """An elementwise operation: the factor of each operand is computed once."""
    run, total, out = _function(equation), None, None
    for i, dot in enumerate(rates):
        if dot is None:
            continue
        at = jnp.asarray(ins[i])

        def of_one(value, i=i):
            return run(*ins[:i], value, *ins[i + 1 :])[0]

        out, factor = jax.jvp(of_one, (at,), (dot.factor,))
        total = total_of(total, Dot(factor, dot.vector))
    return [out], [total]


def _any(equation, ins, rates):
    """Any other operation, by JAX's own rules for it."""
    run, places = _function(equation), [i for i, dot in enumerate(rates) if dot is not None]
    smooth = [is_number(v.aval) for v in equation.outvars]

    def of_moving(*parts):
        full = list(ins)
        for i, part in zip(places, parts, strict=True):
            full[i] = part
        outs = run(*full)
        return [out for out, s in zip(outs, smooth, strict=True) if s], outs

    def along(*directions):
        at = tuple(jnp.asarray(ins[i]) for i in places)
        _, change, outs = jax.jvp(of_moving, at, directions, has_aux=True)
        return outs, change

    outs, changes = jax.vmap(along, out_axes=(None, 0))(*(rates[i].all() for i in places))
    found = iter(changes)
    return outs, [Dot(None, next(found)) if s else None for s in smooth]


# --- Loops and branches ----------------------------------------------------------------------


def _while(equation, ins, rates, wanted):
    params = equation.params
    first, second = params["cond_nconsts"], params["body_nconsts"]
    test, body = params["cond_jaxpr"], params["body_jaxpr"]
    of_test, consts, begin = ins[:first], ins[first : first + second], ins[first + second :]
    needed, wanted = kept(body.jaxpr, wanted, second)
    const_rates, begin_rates = rates[first : first + second], rates[first + second :]
    const_rates = [dot if n else None for dot, n in zip(const_rates, needed, strict=True)]
    begin_rates = [dot if w else None for dot, w in zip(begin_rates, wanted, strict=True)]
    # Computed once, before the loop.
    const_rates = _written_out(const_rates)
    moved = repeated(body.jaxpr, _marks(begin_rates), _marks(const_rates), second)
    moves = [a and b for a, b in zip(moved, wanted, strict=True)]
    if not any(moves):
        return _plain(equation, ins), [None] * len(begin)
    begin_dots = _begun(begin, begin_rates, const_rates, moves)

    def go_on(carry):
        return jaxpr_as_fun(test)(*of_test, *carry[0])[0]

    def trip(carry):
        values, dots = carry
        given = [*consts, *values], [*const_rates, *_at(moves, dots)]
        outs, found = _evaluate(body.jaxpr, body.consts, *given, moves)
        return outs, _all(found, moves, dots)

    outs, dots = lax.while_loop(go_on, trip, (list(map(jnp.asarray, begin)), begin_dots))
    return outs, _at(moves, dots)


def _scan(equation, ins, rates, wanted):
    params = equation.params
    body, first, carried = params["jaxpr"], params["num_consts"], params["num_carry"]
    end = first + carried
    consts, begin, rows = ins[:first], ins[first:end], ins[end:]
    others, kept_carry = kept(body.jaxpr, wanted[:carried], first, wanted[carried:])
    needed = [*others[:first], *kept_carry, *others[first:]]
    rates = [dot if n else None for dot, n in zip(rates, needed, strict=True)]
    # Computed once, before the loop.
    const_rates, row_rates = _written_out(rates[:first]), _written_out(rates[end:])
    of_consts, of_rows = _marks(const_rates), _marks(row_rates)
    moved = repeated(body.jaxpr, _marks(rates[first:end]), [*of_consts, *of_rows], first)
    carries = [a and b for a, b in zip(moved, kept_carry, strict=True)]
    results = reached(body.jaxpr, [*of_consts, *carries, *of_rows])[carried:]
    moves = [*carries, *(a and b for a, b in zip(results, wanted[carried:], strict=True))]
    if not any(moves):
        return _plain(equation, ins), [None] * len(moves)
    begin_dots = _begun(begin, rates[first:end], [*const_rates, *row_rates], carries)
    # Along the rows first, as the rows themselves.
    along_rows = [jnp.moveaxis(dot.vector, 1, 0) for dot in row_rates if dot is not None]
    size = next(dot for dot in rates if dot is not None).vector.shape[0]

    def trip(carry, row):
        (values, dots), (parts, part_dots) = carry, row
        known = [*const_rates, *_at(carries, dots), *_at(of_rows, part_dots)]
        given = [*consts, *values, *parts], known
        outs, found = _evaluate(body.jaxpr, body.consts, *given, moves)
        after = _all(found, moves, _shapes(outs, moves, size))
        return (outs[:carried], after[: len(dots)]), (outs[carried:], after[len(dots) :])

    (values, dots), (rows, row_dots) = lax.scan(
        trip, (list(map(jnp.asarray, begin)), begin_dots), (rows, along_rows),
        length=params["length"], reverse=params["reverse"], unroll=params["unroll"],
    )  # fmt: skip
    dots = [*dots, *(jnp.moveaxis(dot, 0, 1) for dot in row_dots)]
    return [*values, *rows], _at(moves, dots)


def _marks(rates) -> list[bool]:
    """Which numbers have a derivative."""
    return [dot is not None for dot in rates]


def _at(marks, vectors) -> list[Dot | None]:
    """The derivatives of all numbers, from those of the marked ones."""
    some = iter(vectors)
    return [Dot(None, next(some)) if mark else None for mark in marks]


def _written_out(rates) -> list[Dot | None]:
    """The same derivatives, without factors that are still to be multiplied."""
    return [None if dot is None else Dot(None, dot.all()) for dot in rates]


def _shapes(outs, moves, size) -> list[jax.ShapeDtypeStruct]:
    """Shapes and types of the derivatives of those numbers that move."""
    return [
        jax.ShapeDtypeStruct((size, *jnp.shape(out)), jnp.result_type(out))
        for out, move in zip(outs, moves, strict=True)
        if move
    ]


def _begun(begin, begin_rates, const_rates, moves) -> list[Array]:
    """The derivatives at the start of a loop: in a batch one a lane from the start, as the numbers
    themselves, even where the directions are the same for all lanes."""
    known = next(dot for dot in (*begin_rates, *const_rates) if dot is not None).vector
    size, found = known.shape[0], []
    for value, dot, move in zip(begin, begin_rates, moves, strict=True):
        if move and dot is not None:
            found.append(dot.all())
        elif move:
            shape, dtype = jnp.shape(value), jnp.result_type(value)
            found.append(jnp.zeros((size, *shape), dtype))
    return one_a_lane(found, (begin, known))


def _all(found, moves, like) -> list[Array]:
    """The derivatives of the numbers that have one."""
    moved = [dot for dot, move in zip(found, moves, strict=True) if move]
    return [full(dot, old.shape, old.dtype) for dot, old in zip(moved, like, strict=True)]


def _branches(equation, ins, rates, wanted):
    branches, rates = equation.params["branches"], rates[1:]
    marks = _marks(rates)
    each = [reached(branch.jaxpr, marks) for branch in branches]
    moves = [any(outs) and w for *outs, w in zip(*each, wanted, strict=True)]
    if not any(moves):
        return _plain(equation, ins), [None] * len(moves)
    index, *ins = ins
    size = next(dot for dot in rates if dot is not None).vector.shape[0]

    def through(branch):
        def run(values, dots):
            now = _at(marks, dots)
            outs, found = _evaluate(branch.jaxpr, branch.consts, values, now, moves)
            return outs, _all(found, moves, _shapes(outs, moves, size))

        return run

    dots = [dot.all() for dot in rates if dot is not None]
    if len(branches) == 2:
        no, yes = map(through, branches)
        outs, found = lax.cond(index.astype(bool), yes, no, ins, dots)
    else:
        outs, found = lax.switch(index, [through(branch) for branch in branches], ins, dots)
    return outs, _at(moves, found)


_LOOPS = {"while": _while, "scan": _scan, "cond": _branches}
