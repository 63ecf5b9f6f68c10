"""The stages one after the other: the sort of a parcel that rides in along the border.

With no distance between parcel and border, Delta s = 0, the sequence is
    border and fence    from the start of the swing: corner 1 is on the fence at once;
    along the fence     from where the lower wall has turned parallel to the fence, phi = q5(C);
    free motion         from where N vanishes.
N is continuous, but for its viscous part, where the first gives way to the second: on a straight
fence the gap at C is then that of corner 1. The rate of rotation is not: (2.27) makes phi' jump
to the fence's. (A wall that is not pressed in would be parallel just where corner 2 passes the
hinge. That moment is the other choice for the switch; phi then jumps too.)
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from .. import polar
from ..impact import Fence, initial_state
from . import along_fence, border_and_fence, free_motion
from .common import FREE, TIED, Sample, foot, parcel_of


class Run(NamedTuple):
    """A stage that has been integrated.

    name: of the stage. start, end: on the drive's clock of the `Impact` [s]. why: the event that
    ended it, or None at the horizon. samples: Sample of arrays on a uniform grid of times, both
    ends included. first, last: state vectors. evaluations: calls of the right-hand side.
    """

    name: str
    start: float
    end: float
    why: str | None
    samples: Sample
    first: np.ndarray
    last: np.ndarray
    evaluations: int


class Sort(NamedTuple):
    """A sort. runs: the stages in their order. kick: jump of phi' [rad/s], and turn: jump of phi
    [rad], where the rotation becomes tied. lost: kinetic energy of rotation [J] that goes with
    the kick."""

    runs: tuple
    kick: float
    turn: float
    lost: float

    @property
    def samples(self):
        """Sample of arrays: those of the stages one after the other."""
        columns = zip(*(run.samples for run in self.runs), strict=True)
        return Sample(*(np.concatenate(parts) for parts in columns))


def integrate(stage, impact, start, end, state, until=None, rtol=1e-7, every=5e-4):
    """Integrate one stage from a state vector until its first event, or to `end` [s]: a `Run`.

    until: names of the events of `stage.EVENTS` that end it, by default all of them. rtol:
    relative tolerance; the absolute one, on every state, is rtol/1000. every: time between
    samples [s]. Times are on the drive's clock of `impact`: since its first contact, that is, since
    the start of the swing where drive_angle is 0.
    """
    names = list(stage.EVENTS) if until is None else list(until)
    events = []
    for name in names:

        def crossing(time, state, event=stage.EVENTS[name]):
            return event(impact, time, state)

        crossing.terminal, crossing.direction = True, stage.EVENTS[name].direction
        events.append(crossing)
    found = solve_ivp(
        lambda time, state: stage.derivative(impact, time, state),
        (start, end),
        state,
        "LSODA",
        rtol=rtol,
        atol=1e-3 * rtol,
        events=events,
        dense_output=True,
    )
    if not found.success:
        raise RuntimeError(found.message)
    why = None
    if found.status == 1:
        why = next(name for name, at in zip(names, found.t_events, strict=True) if at.size)
    finish = float(found.t[-1])
    times = np.linspace(start, finish, max(2, 1 + round((finish - start) / every)))
    rows = [stage.sample(impact, float(time), found.sol(time)) for time in times]
    samples = Sample(*(np.array(column) for column in zip(*rows, strict=True)))
    return Run(stage.NAME, start, finish, why, samples, state, found.y[:, -1], found.nfev)


def on_border(impact, front):
    """State vector `FREE` at the start of the swing: fence at rest, lower wall on the border,
    foremost point at x = `front` [m], riding with the belt."""
    count = impact.link.frequency.size
    x = front - impact.size[0] / 2 + impact.center[0]
    y = impact.size[1] / 2 + impact.center[1]
    motion = polar.CartesianState(x, y, 0.0, impact.belt_speed, 0.0, 0.0)
    return np.concatenate([np.zeros(2 * count), polar.polar_state_from_cartesian(motion)])


def on_fence(impact):
    """State vector `FREE` with the lower wall on the fence, D = 0, C_s over the arc coordinate
    `impact.distance` at the angle `impact.drive_angle`.

    The fence has swung free of contact since it started; the parcel turns with the drive,
    advances with the fence and slides along it with the belt's share, v cos(q5).
    """
    state = initial_state(impact)
    modal = state[: 2 * impact.link.frequency.size]
    x, y = state[modal.size : modal.size + 2].tolist()  # on the fence's normal through U
    fence = Fence(impact, 0.0, modal)
    point = foot(impact, fence, x, y).point
    cosine, sine = np.cos(point.q5), np.sin(point.q5)
    height = polar.wall_distance(parcel_of(impact))
    along = impact.belt_speed * cosine
    across = point.y_dot * cosine - point.x_dot * sine
    motion = polar.CartesianState(
        point.x - height * sine,
        point.y + height * cosine,
        point.q5,
        along * cosine - across * sine,
        along * sine + across * cosine,
        fence.speed,
    )
    return np.concatenate([modal, polar.polar_state_from_cartesian(motion)])


def tied(state):
    """State vector `TIED` of a state vector `FREE`: phi and phi' dropped."""
    modal, motion = np.split(state, [-len(FREE)])
    return np.concatenate([modal, motion[[FREE.index(name) for name in TIED]]])


def untied(impact, time, state):
    """State vector `FREE` of a state vector `TIED`: phi and phi' those of the tie."""
    return np.concatenate([state[: -len(TIED)], along_fence.tie(impact, time, state)[1]])


def sort(impact, front=0.1, end=None, switch=border_and_fence.FLUSH, rtol=1e-7, every=5e-4):
    """The whole sort at Delta s = 0: a `Sort`.

    front: x of the parcel's foremost point when the swing starts [m]. end: [s], by default the
    drive's cycle. switch: event of `border_and_fence` at which the rotation becomes tied.
    """
    if impact.drive_angle != 0:
        raise ValueError(f"drive_angle must be 0, the start of the swing: {impact.drive_angle}")
    end = impact.cycle_time if end is None else end
    options = {"rtol": rtol, "every": every}
    riding = integrate(
        border_and_fence, impact, 0.0, end, on_border(impact, front), [switch], **options
    )
    if riding.why is None:
        raise RuntimeError("the wall never came to lie on the fence")
    state = tied(riding.last)
    _, motion, _ = along_fence.tie(impact, riding.end, state)
    before, after = float(riding.last[-1]), motion.phi_dot
    sliding = integrate(along_fence, impact, riding.end, end, state, **options)
    runs = [riding, sliding]
    if sliding.why is not None:
        state = untied(impact, sliding.end, sliding.last)
        runs.append(integrate(free_motion, impact, sliding.end, end, state, **options))
    return Sort(
        tuple(runs),
        after - before,
        motion.phi - float(riding.last[FREE.index("phi") - len(FREE)]),
        0.5 * parcel_of(impact).inertia * (before**2 - after**2),
    )
