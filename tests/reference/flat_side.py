"""The parcel's flat side at the fence: the effect of its contact with the tip, and the error of
leaving it out.

From the folder `tests`:

    python -m reference.flat_side            # two minutes
    python -m reference.flat_side --record   # the figures of the limits anew

A side that lies on the fence does so with its two corners. Between them the fence, bent away from
the parcel, is convex towards it: by how much it stands above the line through the corners' feet,
while both are pressed, is what their depth lacks there. And the paper's stages hold one corner: of
random impacts, how many have a peak force or an impulse of another size with all corners and the
tip.
"""

import argparse
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from robustness.random_scenes import impacts

import fencejax as fj
from fencejax.model import FlexibleLink

_LANES = 96
# Fixed steps: samples lie at even distances.
_SETTINGS = fj.Fidelity.standard(step=2.5e-4, step_tolerance=None)


def bulge(scene):
    """The most [m] by which the fence stands above the line through the feet of corners 1 and 2,
    both pressed, towards the parcel; and the share [1] that it is of their larger depth then."""
    history = jax.device_get(fj.simulate(scene, fidelity=_SETTINGS).history)
    link = FlexibleLink(scene.fence, _SETTINGS.settled(scene.duration), scene.drive)
    ends = np.stack([contact.place for contact in history.fence])
    pressed = np.all([contact.normal > 0 for contact in history.fence], axis=0)
    pressed &= np.all((ends > 0) & (ends < float(link.reach)), axis=0)
    chosen = np.flatnonzero(pressed)[::10]
    depth = np.max([contact.gap for contact in history.fence], axis=0)[chosen]
    places = np.linspace(ends[1, chosen], ends[0, chosen], 21, axis=1)

    @jax.jit
    @jax.vmap
    def line(places, vibration):
        point = jax.vmap(lambda place: link.point(link.shape(place), vibration))(places)
        return jnp.stack([point.x, point.y], axis=-1)

    vibration = jax.tree.map(lambda q: q[chosen], history.vibration)
    points = np.asarray(line(places, vibration))
    chord = points[:, -1] - points[:, 0]
    normal = np.stack([-chord[:, 1], chord[:, 0]], 1) / np.linalg.norm(chord, axis=1)[:, None]
    above = np.max(np.einsum("ijk,ik->ij", points - points[:, :1], normal), axis=1)
    most = int(np.argmax(above))
    return float(above[most]), float(above[most] / depth[most])


def decided():
    """Peak force [N] and y of C_s at the end [m] of a sort that the tip meets first, with its
    contact and without."""
    found = []
    for tip_contact in (True, False):
        scene = fj.scenes.whole_sort(
            front=0.7, offset=0.4, belt=fj.Belt(speed=1.5), tip_contact=tip_contact
        )
        result = fj.simulate(scene, fidelity=_SETTINGS, only=("peak_force", "final"))
        found.append((float(result.peak_force), float(result.final.y)))
    return found


def left_out():
    """Shares [1] of random impacts under a good status whose peak force, and whose impulse over
    0.25 s, is off by more than 1 % for what the stage leaves out."""
    stages = impacts(3, _LANES, duration=0.25)
    whole = dataclasses.replace(stages, tip_contact=True, fence_corners=(1, 2, 3, 4))
    wanted = ("peak_force", "impulse")
    one, every = (
        jax.jit(jax.vmap(lambda s: fj.simulate(s, fidelity=_SETTINGS, only=wanted)))(scenes)
        for scenes in (stages, whole)
    )
    good = np.asarray(fj.holds(one) & fj.holds(every))
    return tuple(
        float(np.mean(np.abs(getattr(every, name) / getattr(one, name) - 1)[good] > 0.01))
        for name in wanted
    )


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    curved = fj.Fence(rest_shape=fj.RestShape(tip=-0.06, middle=-0.02))
    found = {}
    for name, scene in {
        "sort": fj.scenes.whole_sort(),
        "blow on the flush side": fj.scenes.along_fence(),
        "curved fence": fj.scenes.whole_sort(fence=curved),
    }.items():
        most, share = bulge(scene)
        found[f"bulge, {name}"] = (float(f"{1e3 * most:.2g}"), "mm")
        if name == "blow on the flush side":
            found["its share of the depth"] = (float(f"{100 * share:.2g}"), "%")
    for name, (peak, y) in zip(("met", "not met"), decided(), strict=True):
        found[f"peak, tip {name}"] = (float(f"{peak:.3g}"), "N")
        found[f"y, tip {name}"] = (float(f"{y:.3g}"), "m")
    for name, share in zip(("peak", "impulse"), left_out(), strict=True):
        found[f"{name} changed"] = (float(f"{100 * share:.2g}"), "%")
    for name, (value, unit) in found.items():
        print(f"{name:40} {value} {unit}")
    if given.record:
        import figures

        known = figures.record()
        command = "cd tests && python -m reference.flat_side --record"
        known["flat side"] = figures.group(command, found)
        figures.write(known)


if __name__ == "__main__":
    main()
