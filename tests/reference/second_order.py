"""What the model leaves out of an oblique impact, put into the independent version of it.

From the folder `tests`:

    python -m reference.second_order            # a minute
    python -m reference.second_order --record   # the table of VERIFICATION.md anew

The friction of a parcel that slides along the fence pulls it: at the surface, half the thickness
off the neutral axis, which bends it, and along it, which stiffens it. So does the normal force's
part along the rigid link's line where the fence is bent. And the link yields in shear. The model
(as the paper) has none of them. Here each is switched on by itself, and all together, at several
places: what it changes of the peak force and of the tip's deflection.
"""

import argparse
import dataclasses
from functools import cached_property
from math import sin

import numpy as np

from .beam import hermite
from .impact import Fence, Impact, contact, initial_state, on_parcel, smoothed_friction, solve

POISSON, SHEAR_SHAPE = 0.4, 5 / 6
"""Of a plastic; and of a rectangular cross-section [1]."""
# The lag of the shear behind its static value [s]: short beside a contact of 20 ms.
_LAG = 1e-4
LOADS = ("friction's moment", "friction's pull", "normal force along", "shear")


@dataclasses.dataclass(frozen=True)
class More:
    """Loads besides those of the model, by name. The state has one more number, the shear [m]
    at the corner, before the impulse."""

    loads: frozenset
    impact: Impact

    @cached_property
    def _slopes(self):
        """Integral of phi_i' phi_j' over each element, (elements, modes, modes)."""
        link, size = self.impact.link, self.impact.l_p / self.impact.elements
        points, weights = np.polynomial.legendre.leggauss(4)
        d = 0.5 * size * (1 + points)
        step = 1e-6 * size
        rate = (hermite(d + step, size)[0] - hermite(d - step, size)[0]) / (2 * step)
        ends = np.stack(
            [
                link.displacement[:-1], link.slope[:-1], link.displacement[1:], link.slope[1:]
            ],
            axis=1,
        )  # fmt: skip
        slope = np.einsum("gk,ekm->egm", rate, ends)
        return np.einsum("g,egi,egj->eij", 0.5 * size * weights, slope, slope)

    def _stiffening(self, element, local):
        """Integral of phi_i' phi_j' from the root to the corner, (modes, modes) [1/(kg m)]."""
        size = self.impact.l_p / self.impact.elements
        return self._slopes[:element].sum(axis=0) + local / size * self._slopes[element]

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
        """The state at the first touch."""
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
        force = rate * (touch.gap_rate + shear / _LAG) + impact.stiffness * gap**4
        return touch._replace(force=max(0.0, force / (1 + rate * give / _LAG)))

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
            drag = touch.force * touch.sliding
            drag *= smoothed_friction(impact.mu_fence, abs(touch.sliding), impact)
            pull = drag if "friction's pull" in self.loads else 0.0
            if "normal force along" in self.loads:
                pull += touch.force * sin(touch.slope - fence.angle)
            if pull:
                load = load - pull * (self._stiffening(touch.element, touch.local) @ eta)
            if "friction's moment" in self.loads:
                size = impact.l_p / impact.elements
                step = 1e-6 * size
                rate = (
                    hermite(touch.local + step, size)[0] - hermite(touch.local - step, size)[0]
                ) / (2 * step)
                e = touch.element
                slope = (
                    rate[0] * link.displacement[e] + rate[1] * link.slope[e]
                    + rate[2] * link.displacement[e + 1] + rate[3] * link.slope[e + 1]
                )  # fmt: skip
                share = (touch.arc - impact.l_s) / impact.l_p
                half = 0.5 * impact.thickness * np.sqrt(max(1 - share, 0.0))
                load = load - half * drag * slope
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
        out[-2] = (self._yielding(touch) * touch.force - state[-2]) / _LAG
        out[-1] = touch.force
        return out


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
        most = max(float(np.abs(rows[:, 0]).max()) for rows in found.values())
        known["left out, at most"] = {
            "command": known["left out"]["command"],
            "figures": {"peak": {"value": float(f"{100 * most:.2g}"), "unit": "%"}},
        }
        figures.write(known)


if __name__ == "__main__":
    main()
