"""The exact one-step map of a damped oscillator against the exponential of its matrix.

The reference is computed in 70 decimal digits, so that only the round-off of what is tested
remains, in the values and in the derivatives.
"""

import decimal

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from fencejax.model import propagator

EPS = np.finfo(float).eps
DIGITS = decimal.Context(prec=70)
H = 2.5e-4

# (w h, c h): every branch of the closed form, both sides of its switches, and the extremes.
CASES = {
    "tiny": (1e-6, 0.0),
    "tiny, damped": (1e-6, 1e-7),
    "series": (0.05, 0.004),
    "series, last": (0.4999, 0.3),
    "closed, first": (0.5001, 0.3),
    "undamped": (1.7, 0.0),
    "undamped, many turns": (50.0, 0.0),
    "underdamped": (1.7, 0.4),
    "zeta 0.7": (2.0, 2.8),
    "near critical, below": (1.3, 2.6 * (1 - 1e-3)),
    "near critical, by 1e-9": (1.3, 2.6 * (1 - 1e-9)),
    "critical": (1.3, 2.6),
    "near critical, above": (1.3, 2.6 * (1 + 1e-3)),
    "switch below, inside": (1.0, 2 * (1 - 0.00995) ** 0.5),
    "switch below, outside": (1.0, 2 * (1 - 0.01005) ** 0.5),
    "switch above, inside": (1.0, 2 * (1 + 0.00995) ** 0.5),
    "switch above, outside": (1.0, 2 * (1 + 0.01005) ** 0.5),
    "zeta 1.5": (1.2, 3.6),
    "zeta 2": (5.0, 20.0),
    "zeta 2, slow": (0.3, 1.2),
    "stiff, zeta 5": (1e3, 1e4),
    "stiff, zeta 186": (27.0, 1e4),
}


def numbers(case):
    frequency, damping = CASES[case]
    return (frequency / H) ** 2, damping / H, H


# --- The reference ------------------------------------------------------------------------------


def augmented(stiffness, damping):
    """d/dt of (q, v, f, f') for q'' + c q' + w^2 q = f, f'' = 0."""
    return [[0, 1, 0, 0], [-stiffness, -damping, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]]


def to_map(e, step):
    """The eight numbers of a `Propagator` from the exponential: f' = (f1 - f0) / h."""
    q_end, v_end = e[0][3] / step, e[1][3] / step
    return [e[0][0], e[0][1], e[1][0], e[1][1], e[0][2] - q_end, q_end, e[1][2] - v_end, v_end]


def exact_map(stiffness, damping, step):
    """The map in 70 digits: scaling and squaring of the Taylor series of the exponential."""
    with decimal.localcontext(DIGITS):
        stiffness, damping, step = (decimal.Decimal(x) for x in (stiffness, damping, step))
        size = max(1, step, stiffness * step, damping * step)
        halvings = int(size).bit_length() + 4
        a = np.array(augmented(stiffness, damping), dtype=object) * (step / 2**halvings)
        result = term = np.array(np.eye(4, dtype=int), dtype=object) * decimal.Decimal(1)
        for k in range(1, 45):
            term = (term @ a) / k
            result = result + term
        for _ in range(halvings):
            result = result @ result
        return to_map(result, step)


def exact_derivatives(stiffness, damping, step):
    """(8, 3): derivatives in the three numbers, by central differences in 70 digits."""
    columns = []
    for k in range(3):
        with decimal.localcontext(DIGITS):
            high = [decimal.Decimal(x) for x in (stiffness, damping, step)]
            low = list(high)
            change = decimal.Decimal("1e-20") * (high[k] or 1)
            high[k], low[k] = high[k] + change, low[k] - change
            pairs = zip(exact_map(*high), exact_map(*low), strict=True)
            columns.append([float((a - b) / (2 * change)) for a, b in pairs])
    return np.array(columns).T


def test_reference_is_scipys_exponential():
    # expm_frechet gives the exponential and its exact derivative; both are good to some ten eps for
    # a matrix of norm 2, with entries of order 0.1 and above.
    stiffness, damping, step = 3.0, 0.8, 0.7
    a = np.array(augmented(stiffness, damping)) * step
    for k, direction in enumerate((augmented(1.0, 0.0), augmented(0.0, 1.0))):
        change = (np.array(direction) - np.array(augmented(0.0, 0.0))) * step
        value, derivative = scipy.linalg.expm_frechet(a, change)
        exact = np.array(exact_map(stiffness, damping, step), dtype=float)
        np.testing.assert_allclose(to_map(value, step), exact, rtol=1e2 * EPS)
        np.testing.assert_allclose(
            to_map(derivative, step),
            exact_derivatives(stiffness, damping, step)[:, k],
            rtol=1e3 * EPS,
        )


# --- The map ------------------------------------------------------------------------------------

compiled = jax.jit(propagator)
derivatives = jax.jit(jax.jacfwd(propagator, argnums=(0, 1, 2)))


def round_off(case):
    """What round-off may do to each entry, from the formulas. With s = w h, d = c h:

    g' and g carry 8 eps max(1, s), the phase of the oscillation; G1 = (1 - g' - c g) / w^2 and
    G2 = (h - g - c G1) / w^2 divide differences of numbers of order 1 by s^2, unless both s and d
    are below 0.5, where the series cancels nothing.
    """
    s, d = CASES[case]
    first, second = (1.0, 1.0) if max(s, d) < 0.5 else (s**-2, s**-2 + d * s**-4)
    entries = np.array([
        s**2 * first, H, s**2 / H, 1.0,
        H**2 * (first + second), H**2 * second, H * (1 + first), H * first,
    ])
    return 8 * EPS * max(1.0, s) * entries


@pytest.fixture(scope="module")
def together():
    """All cases in one array: the map is elementwise."""
    stiffness, damping, _ = np.array([numbers(case) for case in CASES]).T
    return np.array(compiled(jnp.asarray(stiffness), jnp.asarray(damping), H)).T


@pytest.mark.parametrize("case", CASES)
def test_map_is_the_exponential(case, together):
    exact = np.array([float(x) for x in exact_map(*numbers(case))])
    ours = together[list(CASES).index(case)]
    relative = 8 * EPS * max(1.0, CASES[case][0])
    error = np.abs(ours - exact)
    assert np.all(error <= round_off(case) + relative * np.abs(exact)), error
    alone = np.array(compiled(*map(jnp.asarray, numbers(case))))
    np.testing.assert_allclose(alone, ours, rtol=relative, atol=np.max(round_off(case)))


def derivative_round_off(case):
    """(8, 3): what round-off may do to the derivatives, and the relative part of it.

    A derivative in w^2 brings another division by w^2 (h^2 in the series), one in c another h, one
    in h the fastest rate. Near critical damping sinh(x) / x is divided by x^2 down to 1e-2 once
    more, and its series is cut there at 5 x^8 / 10! = 1e-14.
    """
    s, d = CASES[case]
    square = abs(s**2 - d**2 / 4)
    near = 1 / max(square, 1e-2) if square < 1 else 1.0
    more = np.array([H**2 * (1.0 if max(s, d) < 0.5 else s**-2), H, max(1.0, s, d) / H])
    return 4 * near * round_off(case)[:, None] * more, 8 * EPS * max(1.0, s) * near


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_the_exponentials(case):
    ours = np.array([[float(x) for x in row] for row in derivatives(*numbers(case))])
    exact = exact_derivatives(*numbers(case))
    assert np.all(np.isfinite(ours))
    allowed, relative = derivative_round_off(case)
    error = np.abs(ours - exact)
    assert np.all(error <= allowed + relative * np.abs(exact)), error / np.abs(exact)


WEIGHTS = np.array([1.0, 1 / H, H, 1.0, H**-2, H**-2, 1 / H, 1 / H])
transposed = jax.jit(
    jax.grad(
        lambda *numbers: sum(w * x for w, x in zip(WEIGHTS, propagator(*numbers), strict=True)),
        argnums=(0, 1, 2),
    )
)


@pytest.mark.parametrize("case", CASES)
def test_reverse_mode(case):
    # One weighted sum of the eight entries, against the reference's derivatives.
    exact = exact_derivatives(*numbers(case))
    allowed, relative = derivative_round_off(case)
    error = np.abs(np.array(transposed(*numbers(case))) - WEIGHTS @ exact)
    assert np.all(error <= WEIGHTS @ (allowed + relative * np.abs(exact))), error


def test_two_half_steps_make_one():
    # Exact maps compose: the force in the middle is the mean. Round-off of the products.
    for case in CASES:
        stiffness, damping, step = numbers(case)
        whole, half = (
            np.array(compiled(*map(jnp.asarray, (stiffness, damping, h)))) for h in (step, step / 2)
        )
        advance = half[:4].reshape(2, 2)
        start, end = half[[4, 6]], half[[5, 7]]
        result = np.array([
            *(advance @ advance).ravel(),
            *np.stack([
                advance @ (start + end / 2) + start / 2,
                advance @ end / 2 + start / 2 + end,
            ], 1).ravel(),
        ])
        allowed = 4 * round_off(case) + 8 * EPS * max(1.0, CASES[case][0]) * np.abs(whole)
        assert np.all(np.abs(result - whole) <= allowed), case


def test_undamped_map_keeps_the_energy():
    # det = exp(-c h) (Liouville), 1 without damping: the map is symplectic. Round-off of phases.
    for case in CASES:
        s, d = CASES[case]
        m = compiled(*map(jnp.asarray, numbers(case)))
        determinant = float(m.qq * m.vv - m.qv * m.vq)
        np.testing.assert_allclose(determinant, np.exp(-d), rtol=0, atol=8 * EPS * max(1.0, s))


def test_constant_force_settles_at_the_static_deflection():
    # A stiff overdamped oscillator: q -> f / w^2 within one step, v -> 0.
    stiffness, damping, step = numbers("zeta 2")
    m = compiled(stiffness, damping, step)
    # e^(-slow h) with slow h = 5 (2 - sqrt 3) = 1.34: what is left of the initial deflection.
    left = float(m.qq)
    np.testing.assert_allclose(float(m.q_start + m.q_end), (1 - left) / stiffness, rtol=8 * EPS)
