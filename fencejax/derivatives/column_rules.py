"""Derivatives along several directions at once, and the arithmetic of them.

Factors of a derivative are collected as long as they are the same for all directions: a chain of
functions of one number costs one product with the directions at its end.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array


class Dot:
    """A number's derivatives along all directions: `scale` times `vector`, which has them in a
    first axis; `scale` is of the number's own shape, or `None` for 1."""

    __slots__ = ("_all", "scale", "vector")

    def __init__(self, scale, vector):
        self.scale, self.vector, self._all = scale, vector, None

    @property
    def factor(self):
        """The scale, written out where it is 1."""
        return self.ones if self.scale is None else self.scale

    @property
    def ones(self) -> np.ndarray:
        """The factor 1."""
        return np.ones(self.vector.shape[1:], self.vector.dtype)

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

    def times(self, factor) -> "Dot":
        """The derivatives times a number of the same shape for all directions."""
        if self.scale is None:
            return Dot(factor, self.vector)
        return Dot(_product(self.scale, factor), self.vector)


def _fixed(factor, dot: Dot):
    """A factor of `dot`, as an array of NumPy where it is a constant of the program."""
    return factor if isinstance(factor, jax.Array) else np.asarray(factor, dot.vector.dtype)


def _product(a, b):
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a * b
    for one, other in ((a, b), (b, a)):
        if isinstance(one, np.ndarray) and np.all(one == -1):
            return lax.neg(other)
    return lax.mul(a, b)


def total_of(a: Dot | None, b: Dot | None) -> Dot | None:
    """The sum of the derivatives of two numbers, `None` for zeros."""
    if a is None or b is None:
        return b if a is None else a
    if a.vector is b.vector:
        first, second = a.factor, b.factor
        both = isinstance(first, np.ndarray) and isinstance(second, np.ndarray)
        return Dot(first + second if both else lax.add(first, second), a.vector)
    return Dot(None, lax.add(a.all(), b.all()))


def full(dot: Dot | None, shape: tuple[int, ...], dtype: Any) -> Array:
    """The derivatives themselves, written out where they are zeros."""
    return jnp.zeros(shape, dtype) if dot is None else dot.all()


def _minus(dot: Dot | None) -> Dot | None:
    return None if dot is None else dot.times(-dot.ones)


def of_shape(aval, ins, rates):
    """Operands and their derivatives, broadcast to the shape of the result."""
    if all(np.shape(x) == aval.shape for x in ins):
        return ins, rates
    ins = [jnp.broadcast_to(x, aval.shape) for x in ins]
    found = []
    for dot in rates:
        if dot is not None and dot.vector.shape[1:] != aval.shape:
            shape = (dot.vector.shape[0], *aval.shape)
            axes = range(dot.vector.ndim)
            dot = Dot(None, lax.broadcast_in_dim(dot.all(), shape, axes))
        found.append(dot)
    return ins, found


# --- Operations that are linear, or nearly so ------------------------------------------------


def _add(params, ins, rates, out):
    return total_of(*rates)


def _subtract(params, ins, rates, out):
    a, b = rates
    if a is None or b is None or a.vector is b.vector:
        return total_of(a, _minus(b))
    return Dot(None, lax.sub(a.all(), b.all()))


def _negate(params, ins, rates, out):
    return _minus(rates[0])


def _multiply(params, ins, rates, out):
    (x, y), (a, b) = ins, rates
    return total_of(
        *(None if dot is None else dot.times(_fixed(by, dot)) for dot, by in ((a, y), (b, x)))
    )


def _divide(params, ins, rates, out):
    (_, y), (a, b) = ins, rates
    of_above = None
    if a is not None:
        above, below = a.factor, _fixed(y, a)
        fixed = isinstance(above, np.ndarray) and isinstance(below, np.ndarray)
        of_above = Dot(above / below if fixed else lax.div(above, below), a.vector)
    return total_of(of_above, None if b is None else b.times(lax.neg(lax.div(out, y))))


def _extreme(params, ins, rates, out):
    """Where two numbers are equal, the result has half the derivative of each."""
    equal = [lax.eq(x, out) for x in ins]
    none, half, one = (lax.full(out.shape, share, out.dtype) for share in (0.0, 0.5, 1.0))

    def of_one(dot, own, other):
        if dot is None:
            return None
        return dot.times(lax.select(own, lax.select(other, half, one), none))

    return total_of(*map(of_one, rates, equal, reversed(equal)))


def _select(params, ins, rates, out):
    which, cases = ins[0], rates[1:]
    present = [dot for dot in cases if dot is not None]
    first = present[0]
    if len(present) == len(cases) and all(dot.vector is first.vector for dot in present):
        if all(dot.scale is None for dot in present):
            return first
        scales = (jnp.asarray(dot.factor) for dot in present)
        return Dot(lax.select_n(which, *scales), first.vector)
    shape, dtype = first.vector.shape, first.vector.dtype
    every = [full(dot, shape, dtype) for dot in cases]
    if np.ndim(which):
        which = lax.broadcast_in_dim(which, shape, range(1, len(shape)))
    return Dot(None, lax.select_n(which, *every))


def _moved_on(along: Callable[[Array, Any, Any], Array]):
    """The rule of an operation that moves the numbers of one operand."""

    def rule(params, ins, rates, out):
        return Dot(None, along(rates[0].all(), params, ins))

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
        full(dot, (size, *jnp.shape(x)), out.dtype)
        for x, dot in zip(ins, rates, strict=True)
    ]
    return Dot(None, lax.concatenate(every, params["dimension"] + 1))


ARITHMETIC = {"add", "add_any", "sub", "neg", "mul", "div", "max", "min"}
"""The elementwise operations among the rules."""

RULES: dict[str, Callable[..., Dot | None]] = {
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
"""The derivatives of an operation's results, from its settings, its operands, their derivatives and
its results."""
