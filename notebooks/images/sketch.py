"""The README's sketch of a scene: axes, lengths and angles by their names.

    python notebooks/images/sketch.py     # writes sketch.png beside this file
"""

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Arc, Polygon, Rectangle

from fencejax.plot import style as colors

FENCE, PARCEL, TEXT = colors.RED, colors.BLUE, colors.NOTE
SWING, RIGID, REACH, PLACE = 0.30, 0.45, 1.20, 0.95


def along(length):
    """The point of the straight fence at an arc coordinate [m]."""
    return length * np.cos(SWING), length * np.sin(SWING)


def measured(axes, start, end, text, shift, **style):
    """A dimension between two points, set off by `shift`."""
    start, end, shift = map(np.asarray, (start, end, shift))
    arrow = {"arrowstyle": "<->", "color": TEXT, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", start + shift, end + shift, arrowprops=arrow)
    middle = 0.5 * (start + end) + shift
    axes.text(*middle, text, ha="center", va="center", color=TEXT, fontsize=9,
              bbox={"fc": style.get("ground", colors.PALE), "ec": "none", "pad": 1.0})  # fmt: skip


def main():
    figure, axes = plt.subplots(figsize=(8.4, 4.6), layout="constrained")
    axes.add_patch(Rectangle((-0.55, 0), 2.1, 0.7, color=colors.PALE, lw=0, zorder=0))
    axes.axhline(0, color="black", lw=2, zorder=1)
    axes.axhline(0.7, color=colors.GRAY, lw=0.8, ls=":", zorder=1)
    axes.text(1.5, 0.715, "belt's edge, to the chute", ha="right", va="bottom", fontsize=9)
    axes.text(-0.5, -0.03, "border, y = 0", va="top", fontsize=9)
    axes.annotate("belt, v", (-0.18, 0.62), (-0.5, 0.62), va="center", fontsize=9,
                  arrowprops={"arrowstyle": "->", "color": TEXT})  # fmt: skip

    # The fence: rigid link, then the flexible link, bent back by the parcel.
    joint = along(RIGID)
    axes.plot([0, joint[0]], [0, joint[1]], color=FENCE, lw=5, solid_capstyle="butt", zorder=3)
    s = np.linspace(RIGID, REACH, 60)
    x, y = along(s)
    sag = 0.05 * ((s - RIGID) / (REACH - RIGID)) ** 2
    x, y = x + sag * np.sin(SWING), y - sag * np.cos(SWING)
    normal = np.array([-np.sin(SWING), np.cos(SWING)])
    half = 0.018 * np.sqrt((REACH - s) / (REACH - RIGID))
    edge = np.concatenate(
        [np.stack([x, y], 1) + half[:, None] * normal,
         (np.stack([x, y], 1) - half[:, None] * normal)[::-1]]
    )  # fmt: skip
    axes.add_patch(Polygon(edge, color=FENCE, lw=0, zorder=3))
    axes.plot(*np.stack([along(0), along(REACH)], 1), color=FENCE, lw=0.8, ls="--", zorder=2)
    axes.plot(0, 0, "o", color=FENCE, ms=8, zorder=5)
    axes.annotate("hinge O, drive", (0, 0), (-0.28, 0.14), fontsize=9,
                  arrowprops={"arrowstyle": "-", "color": TEXT, "lw": 0.6})  # fmt: skip
    axes.annotate("tip deflection", (x[-1], y[-1]), (1.24, 0.19), fontsize=9,
                  arrowprops={"arrowstyle": "->", "color": TEXT, "lw": 0.8})  # fmt: skip
    axes.add_patch(Arc((0, 0), 0.64, 0.64, theta2=np.degrees(SWING), color=TEXT, lw=0.8))
    axes.text(0.34, 0.04, r"$\alpha_w$", fontsize=11)

    # The parcel that strikes at R with its leading lower corner.
    touch = np.array([np.interp(PLACE, s, x), np.interp(PLACE, s, y)])
    tilt = -0.30
    turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    corners = np.array([(0.2, -0.15), (-0.2, -0.15), (-0.2, 0.15), (0.2, 0.15)])
    centre = touch - turn @ corners[0] + 0.012 * normal
    axes.add_patch(Polygon(corners @ turn.T + centre, fc=PARCEL + "22", ec=PARCEL, zorder=4))
    axes.plot(*centre, "+", color=PARCEL, zorder=6)
    axes.text(*(centre + (0.02, 0.02)), "$C_s$", color=PARCEL, fontsize=10)
    axes.plot([centre[0], centre[0] + 0.2], [centre[1]] * 2, color=TEXT, lw=0.6, ls=":", zorder=6)
    turned = {"theta1": np.degrees(tilt), "theta2": 0}
    axes.add_patch(Arc(centre, 0.3, 0.3, color=TEXT, lw=0.8, zorder=6, **turned))
    axes.plot(*np.stack([centre, centre + 0.2 * turn[:, 0]], 1), color=TEXT, lw=0.6, ls=":")
    axes.text(*(centre + (0.16, -0.05)), r"$\varphi$", fontsize=11, zorder=6)
    arrow = {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", touch + 0.13 * normal, touch, arrowprops=arrow, zorder=7)
    axes.text(*(touch + 0.13 * normal + (-0.05, -0.01)), "N", fontsize=10, zorder=7)

    # A parcel that comes later, at a distance from the border.
    axes.add_patch(Rectangle((-0.52, 0.24), 0.4, 0.3, fc=PARCEL + "11", ec=PARCEL, ls="--"))
    measured(axes, (-0.44, 0), (-0.44, 0.24), r"$\Delta s$", (0, 0))

    below = -np.array(normal)
    measured(axes, (0, 0), joint, r"$l_s$", 0.09 * below, ground="white")
    measured(axes, joint, along(REACH), r"$l_p$", 0.13 * below)
    measured(axes, (0, 0), along(PLACE), "R", 0.22 * below, ground="white")
    axes.set(xlim=(-0.55, 1.55), ylim=(-0.3, 1.0), aspect="equal",
             xlabel="x along the belt [m]", ylabel="y across the belt [m]")  # fmt: skip
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    main()
