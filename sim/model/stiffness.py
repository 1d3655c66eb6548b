r"""MuJoCo's ``solref`` and ``solimp`` from contact stiffness [N/m] and damping [N·s/m].

MuJoCo (documentation, "Computation", constraint model) gives row i of an active constraint the
force

.. math:: f = \frac{a_{ref} - J \dot v}{R}, \qquad a_{ref} = -b\, J v - k\, r, \qquad
          R = \frac{1 - d}{d} A

with the gap r (negative where bodies overlap) and the impedance d, here constant (``solimp = (d, d,
..)``). A is MuJoCo's estimate of the inverse mass at the contact: the sum of
``body_invweight0[0]`` of both bodies. A ``solref`` with negative entries means :math:`k = k' d /
d^2` and :math:`b = b' / d`, with :math:`k', b'` the entries without their sign. So with the depth
:math:`x = -r`

.. math:: f = \frac{k'}{(1 - d) A}\, x + \frac{b'}{(1 - d) A}\, \dot x
              + \frac{d}{(1 - d) A}\, \ddot x

The first two terms are a spring and a damper: a contact with stiffness K and damping D has

.. math:: k' = K (1 - d) A, \qquad b' = D (1 - d) A

The third is a mass m between the bodies while they touch, which real pads do not have. It keeps
the time step stable for bodies of any mass, since spring and damper are integrated explicitly:

.. math:: m = \frac{d}{(1 - d) A} \ge \frac{\Delta t}{c} \max(D, K \Delta t), \qquad c = 1/2

m is taken no larger, since a light finger takes up m with every touch and then chatters. Fingers
of 0.1 kg at 1e6 N/m chatter without end with c = 0.1, and not with 0.5. With c = 1 an object that
stands on its edge at 4e5 N/m diverges. So m depends on the time step. d is at least :data:`_LEAST`.

Friction rows are dampers of the sliding velocity. Their time constant of :math:`2 \Delta t / d`
means :math:`a_{ref} = -J v / \Delta t`: sliding stops within the step. With a longer one soft
contacts creep.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from fulcrum.sim.scenario import ContactMaterial
from fulcrum.synthesis.checks import positive

# c above: bound of damping rate times time step, and of (frequency times time step)^2, of m [-].
_EXPLICIT = 0.5
# The least impedance [-]. Below it friction fails: its compliance is proportional to (1 - d) / d.
_LEAST = 0.2


@dataclass(frozen=True)
class SolverParameters:
    """A contact's parameters in MuJoCo."""

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    solreffriction: tuple[float, float]


def solver_parameters(
    material: ContactMaterial, inverse_mass: float, timestep: float
) -> SolverParameters:
    """Return the parameters that give a contact its stiffness and damping.

    Args:
        material: Stiffness and damping of the contact.
        inverse_mass: MuJoCo's estimate A of the inverse mass [1/kg].
        timestep: Time step [s].
    """
    positive("inverse_mass", inverse_mass)
    least_mass = max(material.damping, material.stiffness * timestep) * timestep / _EXPLICIT
    ratio = max(least_mass * inverse_mass, _LEAST / (1.0 - _LEAST))  # d / (1 - d)
    d = ratio / (1.0 + ratio)
    scale = inverse_mass / (1.0 + ratio)
    return SolverParameters(
        solref=(-material.stiffness * scale, -material.damping * scale),
        solimp=(d, d, 0.001, 0.5, 2.0),
        solreffriction=(2.0 * timestep / d, 1.0),
    )


def specify_stiffness(
    spec: mujoco.MjSpec, scene: mujoco.MjModel, materials: dict[str, ContactMaterial]
) -> None:
    """Set the stiffness of a specification's contact pairs, for the compiled scene's masses."""
    for pair in spec.pairs:
        inverse_mass = pair_inverse_mass(scene, scene.pair(pair.name).id)
        found = solver_parameters(materials[pair.name], inverse_mass, scene.opt.timestep)
        pair.solref, pair.solimp = found.solref, found.solimp
        pair.solreffriction = found.solreffriction


def set_stiffness(model: mujoco.MjModel, materials: dict[str, ContactMaterial]) -> None:
    """Set the stiffness of a compiled scene's contact pairs, for its present masses.

    Args:
        model: Compiled scene; its ``body_invweight0`` must be up to date (``mj_setConst``).
        materials: Material of each pair, by the pair's name.
    """
    for name, material in materials.items():
        pair = model.pair(name).id
        found = solver_parameters(material, pair_inverse_mass(model, pair), model.opt.timestep)
        model.pair_solref[pair], model.pair_solimp[pair] = found.solref, found.solimp
        model.pair_solreffriction[pair] = found.solreffriction


def pair_inverse_mass(model: mujoco.MjModel, pair: int) -> float:
    """Return MuJoCo's estimate A of the inverse mass at the contacts of a pair [1/kg]."""
    geoms = [int(model.pair_geom1[pair]), int(model.pair_geom2[pair])]
    return float(model.body_invweight0[model.geom_bodyid[geoms], 0].sum())
