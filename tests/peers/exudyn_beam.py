"""Exudyn, a flexible multibody code, with its implicit generalized-alpha integrator.

Two models of the same impact:

- "cables": twenty `ObjectANCFCable2D`, Exudyn's own beam, with the section of each frozen at its
  middle and its bending damping beta E I; a mass point; the contact law as the user function of a
  spring-damper between the two. The element interpolates the same cubics, but it is geometrically
  exact, so it stretches and shortens as it bends. With the motion scaled down by a factor, and
  b and k up by its square and cube, the linear beam's forces scale down exactly, and the
  geometry's part falls by the square of the factor: at 1 % the beam is linear to 1e-6. At full
  size the peak is 1.4 % higher.
- "matrices": `ObjectGenericODE2` with the race's own M, beta K and K. It is the faster one, and
  the deflection at the contact is one of its coordinates, so that a scalar spring-damper does.

User functions are symbolic: they run in C++.

Settings found by halving and doubling:

- Spectral radius 0.9, the default: 1 takes a fiftieth off the peak's error, 0.5 adds half of it.
- The fixed step's error is of second order and regular, 6e-5 of the peak at 0.25 ms, but 1.4 % of
  its elasticity in rho. So the peak is extrapolated (Richardson) from two runs, n and 2 n steps,
  for the gradient and at 5e-7; one run of the same cost is as good for the value at 1e-4.
- Modified Newton at 1e-6 relative; the cables' residual does not fall below 1e-7 N, the round-off
  of their axial forces, so the absolute tolerance is set above it.
- Dense factorisation is faster than sparse for these sizes.
- No sensitivities in Exudyn: gradient by forward differences (steps fixed, so without noise from
  an adaptive step), central where 5e-7 is asked for.
"""

from typing import NamedTuple

import exudyn
import numpy as np
from exudyn import itemInterface
from exudyn.advancedUtilities import CreateSymbolicUserFunction

from . import race

_symbolic = exudyn.symbolic
VERSION = exudyn.config.Version()


class Settings(NamedTuple):
    """alone: steps over the duration of the run for the value, None to extrapolate it too. steps:
    of the first of two runs that are extrapolated. tolerance: of Newton, relative. difference:
    relative step of the differences. central: whether they are central and extrapolated."""

    alone: int | None
    steps: int
    tolerance: float
    difference: float
    central: bool


SETTINGS = {
    (race.ENGINEERING.name, "matrices", None): Settings(834, 200, 1e-6, 1e-3, False),
    (race.ENGINEERING.name, "matrices", 8): Settings(650, 300, 1e-6, 1e-3, False),
    (race.ENGINEERING.name, "cables", None): Settings(834, 300, 1e-6, 2e-3, False),
    (race.TIGHT.name, "matrices", None): Settings(None, 1600, 1e-8, 1e-2, True),
}


def _law(displacement, velocity, factor):
    """N of a spring-damper whose length is the parcel's deflection short of D, symbolic."""
    zero = _symbolic.Real(0.0)
    depth = _symbolic.max(-1.0 * displacement, zero)
    viscous, stiff = race.VISCOSITY / factor**2, race.STIFFNESS / factor**3
    square = depth * depth
    return _symbolic.max(zero, square * (stiff * square - viscous * velocity))


def _connector(system, kind, markers, force):
    """A spring-damper between two markers, and its user function, which must outlive the run.

    kind: the item's name. force: of displacement and velocity, symbolic.
    """

    def user(mbs, t, itemNumber, displacement, velocity, stiffness, damping, offset):
        del mbs, t, itemNumber, stiffness, damping, offset
        return force(displacement, velocity)

    law = CreateSymbolicUserFunction(system, user, "springForceUserFunction", itemTypeName=kind)
    item = getattr(itemInterface, kind)(markerNumbers=markers, springForceUserFunction=law)
    return system.AddObject(item), law


def _matrices(system, parameters, modes):
    """The link as one object of M, beta K and K, and the parcel; the connector between them."""
    if modes is None:
        mass, stiffness, load = race.physical_matrices(parameters)
    else:
        kept = race.unit_modes(modes)
        rate, size = race.scales(parameters)
        mass, stiffness = np.eye(modes), np.diag(rate * kept.eigenvalues)
        load = size * kept.shape
    # The deflection at the contact, p . q, takes the place of the coordinate with the most of it.
    count, place = load.size, int(np.argmax(np.abs(load)))
    change = np.eye(count)
    change[place] = -load / load[place]
    change[place, place] = 1 / load[place]
    mass, stiffness = change.T @ mass @ change, change.T @ stiffness @ change
    zeros = [0.0] * count
    link = system.AddNode(
        itemInterface.NodeGenericODE2(
            numberOfODE2Coordinates=count,
            referenceCoordinates=zeros,
            initialCoordinates=zeros,
            initialCoordinates_t=zeros,
        )
    )
    system.AddObject(
        itemInterface.ObjectGenericODE2(
            nodeNumbers=[link],
            massMatrix=mass,
            stiffnessMatrix=stiffness,
            dampingMatrix=parameters[3] * stiffness,
        )
    )
    parcel = system.AddNode(
        itemInterface.Node1D(
            referenceCoordinates=[0.0], initialCoordinates=[0.0], initialVelocities=[race.SPEED]
        )
    )
    system.AddObject(itemInterface.Mass1D(mass=race.MASS, nodeNumber=parcel))
    markers = [
        system.AddMarker(itemInterface.MarkerNodeCoordinate(nodeNumber=parcel, coordinate=0)),
        system.AddMarker(itemInterface.MarkerNodeCoordinate(nodeNumber=link, coordinate=place)),
    ]

    def force(displacement, velocity):
        return -_law(displacement, velocity, 1.0)

    return _connector(system, "ObjectConnectorCoordinateSpringDamper", markers, force)


def _cables(system, parameters, factor):
    """The link as twenty cable elements clamped at the root; the connector to the parcel."""
    thickness, modulus, density, beta, length = parameters
    size = length / race.ELEMENTS
    nodes = [
        system.AddNode(
            itemInterface.NodePoint2DSlope1(referenceCoordinates=[i * size, 0.0, 1.0, 0.0])
        )
        for i in range(race.ELEMENTS + 1)
    ]
    elements = []
    for i in range(race.ELEMENTS):
        height = thickness * np.sqrt(1 - (i + 0.5) / race.ELEMENTS)
        area, second_moment = race.WIDTH * height, race.WIDTH * height**3 / 12
        element = itemInterface.ObjectANCFCable2D(
            length=size,
            massPerLength=density * area,
            bendingStiffness=modulus * second_moment,
            axialStiffness=modulus * area,
            bendingDamping=beta * modulus * second_moment,
            axialDamping=beta * modulus * area,
            nodeNumbers=nodes[i : i + 2],
        )
        elements.append(system.AddObject(element))
    fixed = system.AddNode(itemInterface.NodePointGround())
    ground = system.AddMarker(
        itemInterface.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0)
    )
    for coordinate in range(4):
        root = system.AddMarker(
            itemInterface.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=coordinate)
        )
        system.AddObject(itemInterface.ObjectConnectorCoordinate(markerNumbers=[ground, root]))
    where = race.CONTACT * length
    element = int(race.CONTACT * race.ELEMENTS)
    node = system.AddNode(
        itemInterface.NodePoint2D(
            referenceCoordinates=[where, 0.0], initialVelocities=[0.0, factor * race.SPEED]
        )
    )
    parcel = system.AddObject(itemInterface.ObjectMassPoint2D(mass=race.MASS, nodeNumber=node))
    place = [where - element * size, 0.0, 0.0]
    markers = [
        system.AddMarker(
            itemInterface.MarkerBodyPosition(bodyNumber=parcel, localPosition=[0.0, 0.0, 0.0])
        ),
        system.AddMarker(
            itemInterface.MarkerBodyPosition(bodyNumber=elements[element], localPosition=place)
        ),
    ]

    def force(displacement, velocity):
        return [0.0, -_law(displacement[1], velocity[1], factor), 0.0]

    return _connector(system, "ObjectConnectorCartesianSpringDamper", markers, force)


def force_history(parameters, steps, tolerance, model="matrices", modes=None, factor=1.0):
    """Times [s] and N [N] at every step of a run.

    model: "matrices" or "cables". modes: kept of the 40 by "matrices". factor: the motion's scale
    for "cables"; the forces returned are scaled back.
    """
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    if model == "matrices":
        connector, law = _matrices(system, parameters, modes)
    else:
        connector, law = _cables(system, parameters, factor)
    sensor = system.AddSensor(
        itemInterface.SensorObject(
            objectNumber=connector,
            outputVariableType=exudyn.OutputVariableType.Force,
            storeInternal=True,
        )
    )
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 0.99 * race.DURATION / steps
    settings.show.computationTime = False
    integration = settings.timeIntegration
    integration.verboseMode = 0
    integration.endTime = race.DURATION
    integration.numberOfSteps = steps
    integration.adaptiveStep = False
    integration.newton.useModifiedNewton = True
    integration.newton.relativeTolerance = tolerance
    integration.newton.absoluteTolerance = 1e-6 if model == "cables" else 1e-10
    system.SolveDynamic(settings, storeSolver=False)
    stored = system.GetSensorStoredData(sensor)
    del law  # the connector reads its expression tree until here
    force = stored[:, 1] if model == "matrices" else stored[:, 2]
    return stored[:, 0], np.abs(force) / factor


def make(accuracy, model="matrices", modes=None):
    """Exudyn at `accuracy` with one of the two models; the cables run at 1 % of the motion."""
    settings = SETTINGS[accuracy.name, model, modes]
    factor = 0.01 if model == "cables" else 1.0

    def once(parameters, steps):
        history = force_history(parameters, steps, settings.tolerance, model, modes, factor)
        return race.refined_peak(*history)

    def value(parameters):
        if settings.alone is None:
            return extrapolated(parameters)
        return once(parameters, settings.alone)

    def extrapolated(parameters):
        peak, time = once(parameters, settings.steps)
        closer, closer_time = once(parameters, 2 * settings.steps)
        return (4 * closer - peak) / 3, (4 * closer_time - time) / 3

    def value_and_gradient(parameters):
        parameters = np.asarray(parameters, float)
        middle, _ = extrapolated(parameters)
        slopes = np.empty(parameters.size)
        for index in range(parameters.size):

            def along(step, index=index):
                moved = parameters.copy()
                moved[index] *= np.exp(step)
                return np.log(extrapolated(moved)[0])

            h = settings.difference
            if settings.central:
                wide = (along(h) - along(-h)) / (2 * h)
                narrow = (along(h / 2) - along(-h / 2)) / h
                slopes[index] = (4 * narrow - wide) / 3
            else:
                slopes[index] = (along(h) - np.log(middle)) / h
        return middle, slopes * middle / parameters

    kind = {"cables": "its ANCF cables", "matrices": "full" if modes is None else f"{modes} modes"}
    name = f"Exudyn, {kind[model]}"
    return race.Peer(name, VERSION, value, value_and_gradient)
