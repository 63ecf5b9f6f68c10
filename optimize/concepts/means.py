"""The means of softening, a row each; a concept is several of them, joined by `+`.

To add one, write its row in `MEANS` and name it in a concept: `--concepts two_link+pad`. All
numbers of a concept's means are free; those of other means have values without effect.
"""

import itertools
from collections.abc import Iterable, Mapping
from typing import NamedTuple


class Number(NamedTuple):
    """A number of a means: its path in a sorter file, its lower and upper bound and start value,
    and the value `without` an effect, `None` where there is none, all [SI]. Where the sorter frees
    the number, its bounds are used, and where the sorter has the number, its value as the start."""

    path: str
    lower: float
    upper: float
    start: float
    without: float | None = None


class Means(NamedTuple):
    """A means of softening a blow: in words, its numbers, whether the fence bends, and the law of
    the drive, `None` for the harmonic one."""

    meaning: str
    numbers: tuple[Number, ...] = ()
    bends: bool = False
    law: str | None = None


_THICKNESS = Number("fence.thickness", 0.01, 0.09, 0.045)
_RATIO = Number("fence.length_ratio", 0.0, 2.0, 0.6, without=0.0)
# At 1e9 N m/rad the tip of a fence of 1 m gives way by a micrometre under 1 kN; at 1e6 N m no
# clutch of these fences slips.
_STIFFNESS = Number("fence.shaft.stiffness", 1e4, 1e7, 1e5, without=1e9)
_SLIP = Number("fence.shaft.slip_torque", 50.0, 2e3, 500.0, without=1e6)

MEANS: Mapping[str, Means] = {
    "rigid": Means("a fence that does not bend, of the sorter's own shape"),
    "one_link": Means("a fence that bends all along", (_THICKNESS,), bends=True),
    "two_link": Means("a rigid link, then one that bends", (_THICKNESS, _RATIO), bends=True),
    "curved": Means("a flexible link that is curved at rest", (
        Number("fence.rest_shape.tip", -0.1, 0.1, 0.02, without=0.0),
        Number("fence.rest_shape.middle", -0.05, 0.05, 0.0, without=0.0),
    )),
    "pad": Means("an elastic cover on the fence", (
        Number("fence.pad.thickness", 0.0, 0.02, 0.01, without=0.0),
        Number("fence.pad.modulus", 5e4, 5e6, 1.9e5, without=1.9e5),
    )),
    "shaft": Means("a shaft that gives way between motor and hinge", (_STIFFNESS,)),
    "clutch": Means("a clutch on that shaft, which slips", (_STIFFNESS, _SLIP)),
    "motion": Means("a motion of any form, by a spline", law="spline"),
    # The spring returns the fence; without one there is no home position.
    "torque": Means("a torque in place of a motion, at the same times for every parcel", (
        Number("drive.inertia", 0.5, 20.0, 2.0),
        Number("drive.damping", 0.0, 300.0, 100.0),
        Number("drive.stiffness", 20.0, 2e3, 400.0),
    ), law="torque"),
}  # fmt: skip
"""The means by name."""
LINKS = tuple(name for name in MEANS if name in ("rigid", "one_link", "two_link"))


class Concept(NamedTuple):
    """Some means together."""

    name: str

    @classmethod
    def read(cls, text: str) -> "Concept":
        """A concept from names joined by `+`, one of them of the fence: `"two_link+pad"`.

        Raises `ValueError` where one is not known, or the fence is not named once.
        """
        names = text.split("+")
        unknown = [name for name in names if name not in MEANS]
        fences = [name for name in names if name in LINKS]
        if unknown or len(fences) != 1 or len(set(names)) < len(names):
            raise ValueError(
                f"Argument `concepts` must join {' or '.join(LINKS)} with any of "
                f"{', '.join(name for name in MEANS if name not in LINKS)} by +, each once, but "
                f"holds {text!r}. Write, for example, two_link+pad."
            )
        return cls("+".join(name for name in MEANS if name in names))

    @property
    def title(self) -> str:
        """`"two-link, pad"`."""
        return ", ".join(name.replace("_", "-") for name in self.name.split("+"))

    @property
    def means(self) -> tuple[Means, ...]:
        """The means of the concept."""
        return tuple(MEANS[name] for name in self.name.split("+"))

    @property
    def numbers(self) -> tuple[Number, ...]:
        """Its numbers, each once."""
        every = itertools.chain.from_iterable(one.numbers for one in self.means)
        return tuple(dict.fromkeys(every))

    @property
    def bends(self) -> bool:
        """Whether its fence bends."""
        return any(one.bends for one in self.means)

    @property
    def law(self) -> str:
        """The law of its drive."""
        return next((one.law for one in self.means if one.law is not None), "harmonic")

    def holds(self, other: "Concept") -> bool:
        """Whether another concept is (nearly) a special case of it: both flexible or both rigid,
        and with fewer numbers, or with the harmonic drive instead of a free one."""
        fewer = set(other.numbers) < set(self.numbers)
        same = set(other.numbers) == set(self.numbers)
        freer = self.law != other.law and other.law == "harmonic"
        return self.bends == other.bends and (
            (fewer and (self.law == other.law or freer)) or (same and freer)
        )

    def stiffens_to(self, other: "Concept") -> bool:
        """Whether another concept has a rigid fence with some means, all of which this flexible one
        has, too: this one approaches it as it becomes thick."""
        softer = bool(other.numbers) or other.law != "harmonic"
        return (
            self.bends and not other.bends and softer and other.law in ("harmonic", self.law)
            and set(other.numbers) <= set(self.numbers)
        )


def ordered(concepts: Iterable[Concept]) -> list[Concept]:
    """The concepts in order, special cases before general ones."""
    return sorted(concepts, key=lambda one: (one.law != "harmonic", len(one.numbers)))
