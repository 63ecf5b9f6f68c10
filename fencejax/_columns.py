"""Forward mode for several directions at once, made from a traced program operation by operation.

`jax.vmap` of `jax.jvp` does the same, but traces each loop's body for every pass of each of the two
until it knows which numbers of the carry move. Here that is read off the program, and one pass is
enough. What a derivative is multiplied by is gathered, as long as it is one number for all
directions: a chain of functions of one number costs one product with the directions at its end.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core import Jaxpr, Literal, jaxpr_as_fun
from jaxtyping import Array

# Operations on numbers whose derivative is zero everywhere.
_CONSTANT = {"stop_gradient", "floor", "ceil", "round", "sign"}
# Operations number by number, whose derivative in each operand is a factor.
_BY_NUMBER = {
    "abs", "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh",
    "erf", "erf_inv", "erfc", "exp", "exp2", "expm1", "integer_pow", "log", "log1p", "logistic",
    "pow", "rsqrt", "sin", "sinh", "sqrt", "square", "tan", "tanh",
}  # fmt: skip
_ARITHMETIC = {"add", "add_any", "sub", "neg", "mul", "div", "max", "min"}
_CALLS = {"jit", "pjit", "closed_call", "core_call"}


class _Dot:
    """A number's derivatives along all directions: `scale` times `vector`, which has them in a
    first axis; `scale` is of the number's own shape, or `None` for 1."""

    __slots__ = ("_all", "scale", "vector")

    def __init__(self, scale, vector):
        self.scale, self.vector, self._all = scale, vector, None

    def all(self) -> Array:
        """The derivatives themselves."""
        if self.scale is None:
            return self.vector
        if self._all is None:
            minus = isinstance(self.scale, np.ndarray) and np.all(self.scale == -1)
            self._all = -self.vector if minus else lax.mul(self._spread(self.scale), self.vector)
        return self._all

    def _spread(self, scale):
        shape = self.vector.shape
        return lax.broadcast_in_dim(scale, shape, range(1, len(shape)))

    def times(self, factor) -> "_Dot":
        """The derivatives times a number of the same shape for all directions."""
        if self.scale is None:
            return _Dot(factor, self.vector)
        return _Dot(_product(self.scale, factor), self.vector)


def _ones(dot: _Dot) -> np.ndarray:
    return np.ones(dot.vector.shape[1:], dot.vector.dtype)


def _fixed(factor, dot: _Dot):
    """A factor of `dot`, as NumPy has it where it is written in the program."""
    return factor if isinstance(factor, jax.Array) else np.asarray(factor, dot.vector.dtype)


def _product(a, b):
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a * b
    for one, other in ((a, b), (b, a)):
        if isinstance(one, np.ndarray) and np.all(one == -1):
            return lax.neg(other)
    return lax.mul(a, b)


def _sum(a: _Dot | None, b: _Dot | None) -> _Dot | None:
    if a is None or b is None:
        return b if a is None else a
    if a.vector is b.vector:
        first, second = (_ones(dot) if dot.scale is None else dot.scale for dot in (a, b))
        both = isinstance(first, np.ndarray) and isinstance(second, np.ndarray)
        return _Dot(first + second if both else lax.add(first, second), a.vector)
    return _Dot(None, lax.add(a.all(), b.all()))


def _minus(dot: _Dot | None) -> _Dot | None:
    return None if dot is None else dot.times(-_ones(dot))


def pushed(
    program: Jaxpr, consts: Sequence[Any], values: Sequence[Any], dots: Sequence[Array | None]
) -> tuple[list[Any], list[Array | None]]:
    """The results of a traced program, and their derivatives along all directions.

    `dots` are those of the `values`, the directions in a first axis; `None` stands for zeros, in
    the results as well.
    """
    given = [None if dot is None else _Dot(None, dot) for dot in dots]
    outs, found = _evaluate(program, consts, values, given)
    return outs, [None if dot is None else dot.all() for dot in found]


def _evaluate(program: Jaxpr, consts, values, dots):
    known, moving = {}, {}

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
        outs, found = _apply(equation, ins, rates)
        known.update(zip(equation.outvars, outs, strict=True))
        for v, dot in zip(equation.outvars, found, strict=True):
            if dot is not None:
                moving[v] = dot
    return [read(v) for v in program.outvars], [read_dot(v) for v in program.outvars]


def _apply(equation, ins, rates):
    """The results of one operation and their derivatives."""
    name = equation.primitive.name
    none = [None] * len(equation.outvars)
    if name in _CALLS:
        inner = equation.params.get("jaxpr", equation.params.get("call_jaxpr"))
        return _evaluate(inner.jaxpr, inner.consts, ins, rates)
    moves = any(dot is not None for dot in rates)
    smooth = name not in _CONSTANT and any(_is_number(v.aval) for v in equation.outvars)
    if not moves or not smooth:
        return _plain(equation, ins), none
    if name in _LOOPS:
        return _LOOPS[name](equation.params, ins, rates)
    if name in _BY_NUMBER or name in _ARITHMETIC:
        ins, rates = _of_shape(equation.outvars[0].aval, ins, rates)
    if name in _KNOWN:
        out = _plain(equation, ins)
        return out, [_KNOWN[name](equation.params, ins, rates, out[0])]
    if name in _BY_NUMBER:
        return _by_number(equation, ins, rates)
    return _any(equation, ins, rates)


def _is_number(aval) -> bool:
    return hasattr(aval, "dtype") and jnp.issubdtype(aval.dtype, jnp.floating)


def _plain(equation, ins):
    params = equation.primitive.get_bind_params(equation.params)
    # With the functions among them apart in JAX before 0.10.
    subprograms, params = params if isinstance(params, tuple) else ((), params)
    outs = equation.primitive.bind(*subprograms, *ins, **params)
    return outs if equation.primitive.multiple_results else [outs]


def _of_shape(aval, ins, rates):
    """Operands and their derivatives, repeated along the axes that others alone have."""
    if all(np.shape(x) == aval.shape for x in ins):
        return ins, rates
    ins = [jnp.broadcast_to(x, aval.shape) for x in ins]
    found = []
    for dot in rates:
        if dot is not None and dot.vector.shape[1:] != aval.shape:
            shape = (dot.vector.shape[0], *aval.shape)
            axes = range(dot.vector.ndim)
            dot = _Dot(None, lax.broadcast_in_dim(dot.all(), shape, axes))
        found.append(dot)
    return ins, found


def _function(equation) -> Callable[..., list[Any]]:
    """An operation as a function of all its operands, differentiated by its own rule."""

    def run(*ins):
        return _plain(equation, ins)

    return run


def _by_number(equation, ins, rates):
    """An operation on each number by itself: the factor of each operand is worked out once."""
    run, total, out = _function(equation), None, None
    for i, dot in enumerate(rates):
        if dot is None:
            continue
        at = jnp.asarray(ins[i])
        scale = _ones(dot) if dot.scale is None else dot.scale

        def of_one(value, i=i):
            return run(*ins[:i], value, *ins[i + 1 :])[0]

        out, factor = jax.jvp(of_one, (at,), (scale,))
        total = _sum(total, _Dot(factor, dot.vector))
    return [out], [total]


def _any(equation, ins, rates):
    """Any other operation, by JAX's own rules for it."""
    run, places = _function(equation), [i for i, dot in enumerate(rates) if dot is not None]
    smooth = [_is_number(v.aval) for v in equation.outvars]

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
    return outs, [_Dot(None, next(found)) if s else None for s in smooth]


# --- Operations that are linear, or nearly so ------------------------------------------------


def _add(params, ins, rates, out):
    return _sum(*rates)


def _subtract(params, ins, rates, out):
    a, b = rates
    if a is None or b is None or a.vector is b.vector:
        return _sum(a, _minus(b))
    return _Dot(None, lax.sub(a.all(), b.all()))


def _negate(params, ins, rates, out):
    return _minus(rates[0])


def _multiply(params, ins, rates, out):
    (x, y), (a, b) = ins, rates
    return _sum(
        *(None if dot is None else dot.times(_fixed(by, dot)) for dot, by in ((a, y), (b, x)))
    )


def _divide(params, ins, rates, out):
    (_, y), (a, b) = ins, rates
    of_above = None
    if a is not None:
        above, below = _ones(a) if a.scale is None else a.scale, _fixed(y, a)
        fixed = isinstance(above, np.ndarray) and isinstance(below, np.ndarray)
        of_above = _Dot(above / below if fixed else lax.div(above, below), a.vector)
    return _sum(of_above, None if b is None else b.times(lax.neg(lax.div(out, y))))


def _extreme(params, ins, rates, out):
    """Of two equal numbers each moves the larger or smaller one by half."""
    equal = [jnp.where(lax.eq(x, out), 1.0, 0.0).astype(out.dtype) for x in ins]
    shares = [equal[0] / (1 + equal[1]), equal[1] / (1 + equal[0])]
    return _sum(
        *(None if dot is None else dot.times(by) for dot, by in zip(rates, shares, strict=True))
    )


def _select(params, ins, rates, out):
    which, cases = ins[0], rates[1:]
    present = [dot for dot in cases if dot is not None]
    first = present[0]
    if len(present) == len(cases) and all(dot.vector is first.vector for dot in present):
        if all(dot.scale is None for dot in present):
            return first
        scales = [_ones(dot) if dot.scale is None else dot.scale for dot in present]
        return _Dot(lax.select_n(which, *map(jnp.asarray, scales)), first.vector)
    every = [_full(dot, first.vector) for dot in cases]
    if np.ndim(which):
        shape = every[0].shape
        which = lax.broadcast_in_dim(which, shape, range(1, len(shape)))
    return _Dot(None, lax.select_n(which, *every))


def _full(dot, like):
    """The derivatives, of the shape of `like` where there are none."""
    return jnp.zeros(like.shape, like.dtype) if dot is None else dot.all()


def _moved_on(along: Callable[[Array, Any, Any], Array]):
    """An operation on one operand that puts its numbers elsewhere."""

    def rule(params, ins, rates, out):
        return _Dot(None, along(rates[0].all(), params, ins))

    return rule


def _broadcast(dot, params, ins):
    places = [d + 1 for d in params["broadcast_dimensions"]]
    return lax.broadcast_in_dim(dot, (dot.shape[0], *params["shape"]), (0, *places))


def _sliced(dot, params, ins):
    strides = params["strides"]
    return lax.slice(
        dot,
        (0, *params["start_indices"]),
        (dot.shape[0], *params["limit_indices"]),
        None if strides is None else (1, *strides),
    )


def _concatenate(params, ins, rates, out):
    size = next(dot for dot in rates if dot is not None).vector.shape[0]
    every = [
        jnp.zeros((size, *jnp.shape(x)), out.dtype) if dot is None else dot.all()
        for x, dot in zip(ins, rates, strict=True)
    ]
    return _Dot(None, lax.concatenate(every, params["dimension"] + 1))


_KNOWN: dict[str, Callable[..., _Dot | None]] = {
    "add": _add,
    "add_any": _add,
    "sub": _subtract,
    "neg": _negate,
    "mul": _multiply,
    "div": _divide,
    "max": _extreme,
    "min": _extreme,
    "select_n": _select,
    "concatenate": _concatenate,
    "broadcast_in_dim": _moved_on(_broadcast),
    "slice": _moved_on(_sliced),
    "reshape": _moved_on(
        lambda dot, params, _: lax.reshape(dot, (dot.shape[0], *params["new_sizes"]))
    ),
    "squeeze": _moved_on(
        lambda dot, params, _: lax.squeeze(dot, [d + 1 for d in params["dimensions"]])
    ),
    "dynamic_slice": _moved_on(
        lambda dot, params, ins: lax.dynamic_slice(
            dot, (jnp.zeros_like(ins[1]), *ins[1:]), (dot.shape[0], *params["slice_sizes"])
        )
    ),
    "reduce_sum": _moved_on(
        lambda dot, params, _: jnp.sum(dot, tuple(a + 1 for a in params["axes"]))
    ),
}


# --- Loops and branches ----------------------------------------------------------------------


def repeated(body: Jaxpr, others: list[bool], carry: list[bool]) -> list[bool]:
    """Which numbers of a carry depend on the marked ones after any number of trips; the `others`
    come before it among the body's inputs."""
    while True:
        reached = _reached(body, [*others, *carry])
        found = [a or b for a, b in zip(carry, reached, strict=True)]
        if found == carry:
            return carry
        carry = found


def _reached(program: Jaxpr, marks: list[bool]) -> list[bool]:
    """Which results of a program depend, smoothly, on its marked inputs."""
    moving = {v for v, mark in zip(program.invars, marks, strict=True) if mark}

    def moves(v) -> bool:
        return not isinstance(v, Literal) and v in moving

    for equation in program.eqns:
        ins = [moves(v) for v in equation.invars]
        if any(ins) and equation.primitive.name not in _CONSTANT:
            outs = _results(equation, ins)
            moving.update(
                v
                for v, out in zip(equation.outvars, outs, strict=True)
                if out and _is_number(v.aval)
            )
    return [moves(v) for v in program.outvars]


def _results(equation, ins: list[bool]) -> list[bool]:
    """Which results of an operation depend on its marked operands; all, where it is a rule of its
    own."""
    name, params = equation.primitive.name, equation.params
    if name in _CALLS:
        inner = params.get("jaxpr", params.get("call_jaxpr"))
        return _reached(inner.jaxpr, ins)
    if name == "while":
        first, second = params["cond_nconsts"], params["body_nconsts"]
        others, carry = ins[first : first + second], ins[first + second :]
        return repeated(params["body_jaxpr"].jaxpr, others, carry)
    if name == "cond":
        each = [_reached(branch.jaxpr, ins[1:]) for branch in params["branches"]]
        return [any(outs) for outs in zip(*each, strict=True)]
    return [True] * len(equation.outvars)


def _while(params, ins, rates):
    first, second = params["cond_nconsts"], params["body_nconsts"]
    test, body = params["cond_jaxpr"], params["body_jaxpr"]
    of_test, consts, begin = ins[:first], ins[first : first + second], ins[first + second :]
    const_rates, begin_rates = rates[first : first + second], rates[first + second :]
    marks = [dot is not None for dot in begin_rates]
    # Worked out before the loop, and once.
    const_rates = [None if dot is None else _Dot(None, dot.all()) for dot in const_rates]
    moves = repeated(body.jaxpr, [dot is not None for dot in const_rates], marks)
    begin_dots = _begun(begin, begin_rates, const_rates, moves)

    def go_on(carry):
        return jaxpr_as_fun(test)(*of_test, *carry[0])[0]

    def trip(carry):
        values, dots = carry
        some = iter(dots)
        now = [_Dot(None, next(some)) if move else None for move in moves]
        outs, found = _evaluate(body.jaxpr, body.consts, [*consts, *values], [*const_rates, *now])
        return outs, _kept(found, moves, dots)

    outs, dots = lax.while_loop(go_on, trip, (list(map(jnp.asarray, begin)), begin_dots))
    some = iter(dots)
    return outs, [_Dot(None, next(some)) if move else None for move in moves]


def _begun(begin, begin_rates, const_rates, moves) -> list[Array]:
    """The derivatives that a loop begins with. Zeros come from one that is not, so that they too
    are one a lane in a batch from the start."""
    known = next(dot for dot in (*begin_rates, *const_rates) if dot is not None).vector
    size, zero = known.shape[0], 0 * jnp.ravel(known)[0]
    found = []
    for value, dot, move in zip(begin, begin_rates, moves, strict=True):
        if move and dot is not None:
            found.append(dot.all())
        elif move:
            shape, dtype = jnp.shape(value), jnp.result_type(value)
            found.append(jnp.broadcast_to(zero.astype(dtype), (size, *shape)))
    return found


def _kept(found, moves, like) -> list[Array]:
    """The derivatives of the numbers that move."""
    moved = [dot for dot, move in zip(found, moves, strict=True) if move]
    return [
        jnp.zeros(old.shape, old.dtype) if dot is None else dot.all()
        for dot, old in zip(moved, like, strict=True)
    ]


def _branches(params, ins, rates):
    branches, (index, *ins), rates = params["branches"], ins, rates[1:]
    marks = [dot is not None for dot in rates]
    each = [_reached(branch.jaxpr, marks) for branch in branches]
    moves = [any(outs) for outs in zip(*each, strict=True)]
    size = next(dot for dot in rates if dot is not None).vector.shape[0]

    def through(branch):
        def run(values, dots):
            some = iter(dots)
            now = [None if dot is None else _Dot(None, next(some)) for dot in rates]
            outs, found = _evaluate(branch.jaxpr, branch.consts, values, now)
            like = [
                jax.ShapeDtypeStruct((size, *jnp.shape(out)), jnp.result_type(out))
                for out, move in zip(outs, moves, strict=True)
                if move
            ]
            return outs, _kept(found, moves, like)

        return run

    dots = [dot.all() for dot in rates if dot is not None]
    if len(branches) == 2:
        no, yes = map(through, branches)
        outs, found = lax.cond(index.astype(bool), yes, no, ins, dots)
    else:
        outs, found = lax.switch(index, [through(branch) for branch in branches], ins, dots)
    some = iter(found)
    return outs, [_Dot(None, next(some)) if move else None for move in moves]


_LOOPS = {"while": _while, "cond": _branches}
