"""The terms that the model leaves out of an oblique impact, in the independent version of it.

From the folder `tests`:

    python -m reference.second_order            # two minutes
    python -m reference.second_order --record   # the table of VERIFICATION.md anew, and
                                                # second_order.json: five minutes

The friction of a parcel that slides along the fence pulls it at its face, half the thickness off
the neutral axis, which bends it, and along the bent line, with a part across the rigid link's line
and a part along it, which stiffens the link. The face is straight, as the line that contacts meet
is, and the back takes the taper: so the moment at a section is the friction times half its own
thickness. The normal force is turned with the bent line.
And the link yields in shear. The model (as the paper) has none of them unless a fence asks for
them. Here each is switched on by itself, and all together, at several places: what it changes of
the peak force and of the tip's deflection.

A force at the point U of the chain of chords loads the modes by its virtual work, F . dU / d eta,
with the whole of U's motion.
"""

import argparse
import dataclasses
import json
from functools import cached_property
from math import cos, sin
from pathlib import Path

import numpy as np

from . import record as recorder
from .beam import hermite
from .impact import (
    Fence,
    Impact,
    contact,
    initial_state,
    on_parcel,
    shape,
    smoothed_friction,
    solve,
)

FILE = Path(__file__).with_suffix(".json")
POISSON, SHEAR_SHAPE = 0.4, 5 / 6
"""Of a plastic; and of a rectangular cross-section [1]."""
LOADS = ("friction's moment", "friction's force", "normal force's turn", "shear")


@dataclasses.dataclass(frozen=True)
class More:
    """Loads besides those of the model, by name. The state has one more number, the shear [m]
    at the corner, before the impulse."""

    loads: frozenset
    impact: Impact

    @cached_property
    def _lag(self):
        """Lag of the shear behind its static value [s]: that of the bending, of one material."""
        link = self.impact.link
        return float(link.damping[0] / link.frequency[0] ** 2)

    def moved(self, fence, touch):
        """How each mode moves the point U in fixed axes [kg^-1/2], (2, modes): the chords' angles
        (2.15), (2.16) turn by the modes' differences."""
        nodes = self.impact.link.displacement
        e, d = touch.element, touch.local
        steps = np.diff(nodes[: e + 1], axis=0)
        _, a1, a2, a3 = fence.cubic(fence.q3, fence.q5, e)
        chord = a1 + d * (a2 + a3 * d)
        rise = shape(self.impact, e, d) - nodes[e]
        return np.stack([
            -fence.chord_sin[:e] @ steps - sin(chord) * rise,
            fence.chord_cos[:e] @ steps + cos(chord) * rise,
        ])  # fmt: skip

    def load(self, fence, touch):
        """Modal loads by which those of the model differ [N kg^-1/2], (modes,)."""
        impact = self.impact
        drag = touch.force * touch.sliding
        drag *= smoothed_friction(impact.mu_fence, abs(touch.sliding), impact)
        x, y = self.moved(fence, touch)
        cosine, sine = cos(touch.slope), sin(touch.slope)
        found = np.zeros_like(x)
        if "friction's force" in self.loads:
            found += drag * (cosine * x + sine * y)
        if "normal force's turn" in self.loads:
            found += touch.force * (sine * x - cosine * y + touch.fence_load)
        if "friction's moment" in self.loads:
            found -= drag * self.eccentric(touch)
        return found

    def eccentric(self, touch):
        """Of each mode the integral of (h / 2) phi'' from the root to the corner [kg^-1/2],
        (modes,): by parts, with h straight along each chord."""
        impact, nodes = self.impact, self.impact.link.displacement
        e, d, size = touch.element, touch.local, self.impact.l_p / self.impact.elements
        x = np.append(size * np.arange(e + 1), size * e + d)
        half = 0.5 * impact.thickness * np.sqrt(np.maximum(1 - x / impact.l_p, 0.0))
        along = np.diff(np.vstack([nodes[: e + 1], shape(impact, e, d)]), axis=0)
        taper = np.diff(half) / np.maximum(np.diff(x), 1e-12)
        return half[-1] * slope(impact, e, d) - taper @ along

    def _yielding(self, touch):
        """Shear at the corner for each newton there [m/N]: the integral of 1 / (k G z h)."""
        impact = self.impact
        if "shear" not in self.loads or touch.element < 0:
            return 0.0
        share = (touch.arc - impact.l_s) / impact.l_p
        modulus = impact.E / (2 * (1 + POISSON))
        area = impact.width * impact.thickness
        return 2 * impact.l_p * (1 - np.sqrt(max(1 - share, 0.0))) / (SHEAR_SHAPE * modulus * area)

    def begin(self, impact):
        """The state at the first contact."""
        state = initial_state(impact)
        return np.concatenate([state[:-1], [0.0], state[-1:]])

    def contact(self, impact, time, state):
        """The contact, its force with the shear's yielding."""
        count = impact.link.frequency.size
        fence = Fence(impact, time, state)
        touch = contact(impact, fence, state[2 * count : 2 * count + 6].tolist())
        give, shear = self._yielding(touch), state[-2]
        gap = touch.gap - shear
        if not give or not gap > 0:
            return touch if not give else touch._replace(force=0.0)
        # N = A (D' - (c N - s) / T) + k D^4, linear in N.
        rate = impact.damping * impact.mass**0.4 * gap**2
        force = rate * (touch.gap_rate + shear / self._lag) + impact.stiffness * gap**4
        return touch._replace(force=max(0.0, force / (1 + rate * give / self._lag)))

    def derivative(self, impact, time, state):
        """Time derivative of the state."""
        link = impact.link
        count = link.frequency.size
        fence = Fence(impact, time, state)
        touch = self.contact(impact, time, state)
        parcel = state[2 * count : 2 * count + 6].tolist()
        force_x, force_y, torque = on_parcel(impact, touch, parcel)
        eta, eta_rate = state[:count], state[count : 2 * count]
        load = -touch.force * touch.fence_load
        if touch.force > 0 and 0 <= touch.element < impact.elements:
            load = load + self.load(fence, touch)
        out = np.empty_like(state)
        out[:count] = eta_rate
        out[count : 2 * count] = (
            load - link.damping * eta_rate - link.frequency**2 * eta
            - fence.acceleration * link.participation
        )  # fmt: skip
        out[2 * count : 2 * count + 3] = parcel[3:]
        out[2 * count + 3 : 2 * count + 6] = (
            force_x / impact.mass, force_y / impact.mass, torque / impact.moment_of_inertia
        )  # fmt: skip
        out[-2] = (self._yielding(touch) * touch.force - state[-2]) / self._lag
        out[-1] = touch.force
        return out


def slope(impact, element, local):
    """Modal slope at d in an element, by its cubic [1/(m kg^1/2)], shape (modes,)."""
    link, size = impact.link, impact.l_p / impact.elements
    step = 1e-6 * size
    ends = hermite(local + step, size)[0], hermite(local - step, size)[0]
    rate = (ends[0] - ends[1]) / (2 * step)
    return (
        rate[0] * link.displacement[element] + rate[1] * link.slope[element]
        + rate[2] * link.displacement[element + 1] + rate[3] * link.slope[element + 1]
    )  # fmt: skip


def changes(places, rtol=1e-7):
    """By load, "all" last: the relative changes of peak force and tip deflection at each of the
    places R [m], (places, 2)."""
    found = {}
    impacts = [
        Impact(distance=place, load="cubic", modes=12, horizon=0.12) for place in places
    ]
    plain = [solve(impact, rtol=rtol) for impact in impacts]
    for name in (*LOADS, "all"):
        loads = frozenset(LOADS if name == "all" else (name,))
        rows = []
        for impact, before in zip(impacts, plain, strict=True):
            after = solve(impact, rtol=rtol, more=More(loads, impact))
            rows.append(
                (after.peak_force / before.peak_force - 1,
                 after.tip_deflection / before.tip_deflection - 1)
            )  # fmt: skip
        found[name] = np.array(rows)
    return found


CHECKED = dict(load="cubic", modes=3, horizon=0.1)
"""What an `Impact` of the record has besides its place: few modes, so that all of them count."""


def _solved(impact, name, rtol=1e-9):
    """One of `LOADS`, or "all"."""
    loads = frozenset(LOADS if name == "all" else (name,))
    return solve(impact, rtol=rtol, more=More(loads, impact))


def checked():
    """By load: peak force [N] and tip deflection [m] at places R [m], and at the first of them the
    derivatives of the peak in h_1, l_s / l_p, E and R by central differences of 0.4 and 0.2 %, with
    one Richardson step, and how far that moves them."""
    found = {}
    for name in (*LOADS, "all"):
        values = {}
        for place in (1.0, 0.6, 0.8, 1.08):
            solution = _solved(Impact(distance=place, **CHECKED), name)
            values[f"{place:g}"] = [solution.peak_force, solution.tip_deflection]
        slopes, impact = {}, Impact(distance=1.0, **CHECKED)
        for variable in ("thickness", "ratio", "E", "distance"):
            at = recorder.variable(impact, variable)
            rates = []
            for step in (4e-3 * at, 2e-3 * at):
                low, high = (
                    _solved(recorder.changed(impact, variable, at + s), name).peak_force
                    for s in (-step, step)
                )
                rates.append((high - low) / (2 * step))
            best = (4 * rates[1] - rates[0]) / 3
            slopes[variable] = [best, abs(best - rates[1])]
        found[name] = {"values": values, "slopes": slopes}
        print(name, found[name], flush=True)
    return found


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    places = (0.6, 0.8, 1.0, 1.08)
    found = changes(places)
    for name, rows in found.items():
        print(f"{name:20}", "  ".join(f"{100 * a:+.2f} % / {100 * b:+.2f} %" for a, b in rows))
    if given.record:
        import figures

        FILE.write_text(json.dumps(checked(), indent=1) + "\n", encoding="utf-8")
        known = figures.record()
        known["left out"] = {
            "command": "cd tests && python -m reference.second_order --record",
            "columns": ["load", *(f"R = {place:g} m" for place in places)],
            "rows": {
                name: {
                    "unit": "",
                    "values": [f"{100 * a:+.2f} % / {100 * b:+.2f} %" for a, b in rows],
                }
                for name, rows in found.items()
            },
        }
        most = np.max([np.abs(rows).max(axis=0) for rows in found.values()], axis=0)
        known["left out, at most"] = {
            "command": known["left out"]["command"],
            "figures": {
                name: {"value": float(f"{100 * change:.2g}"), "unit": "%"}
                for name, change in zip(("peak", "tip"), most, strict=True)
            },
        }
        figures.write(known)


if __name__ == "__main__":
    main()
