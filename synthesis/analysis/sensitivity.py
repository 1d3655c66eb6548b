r"""Derivatives of the optimal objective of (17) by its parameters, from the multipliers alone.

By the envelope theorem the optimal value changes with a parameter p as the Lagrangian does, at
fixed forces and multipliers: :math:`d\Phi^*/dp = \partial L/\partial p`, with L as in
:mod:`synthesis.solution`. Term by term:

- The weight W along the unit vector g at the centre of mass c gives the wrench
  :math:`W (g,\ c \times g)`, so that with :math:`\nu = (\nu_f, \nu_m)`

  .. math:: \frac{d\Phi}{dW} = \nu_f \cdot g + \nu_m \cdot (c \times g), \qquad
            \frac{d\Phi}{dc} = W\, g \times \nu_m

- The cone of contact i is :math:`\|D f_t\| / \mu_i - f_n \le 0` with the multiplier
  :math:`y_n`, the normal component of y: the tangential ones are then
  :math:`-y_n` times the gradient of :math:`\|D f_t\| / \mu_i`. Its derivative by
  :math:`\mu_i` is :math:`-y_n \|D f_t\| / \mu_i^2`, and where :math:`y_n > 0` the cone is active:

  .. math:: \frac{d\Phi}{d\mu_i} = - \frac{y_n f_n}{\mu_i}

- Bounds: :math:`d\Phi/dF_{min} = \alpha`, :math:`d\Phi/dF_{max} = -\beta`,
  :math:`d\Phi/d\tau_{max} = -\gamma_+`, :math:`d\Phi/d\tau_{min} = \gamma_-`. The torque
  utilisation itself depends on the limits of the joints that attain it: with its subgradient h in
  the torques, :math:`-\Phi h_k` is added for :math:`\tau_{max}` where :math:`h_k > 0`, and for
  :math:`\tau_{min}` where :math:`h_k < 0`.

The friction margin s is where :math:`\lambda^*(s, p) = 0` for the parametric problem of
:mod:`synthesis.synthesizer`, whose multipliers a solution holds. There :math:`\partial \lambda^* /
\partial s = -\sum y_n f_n / s`, so that :math:`ds/dp = (s / \sum y_n f_n)\, \partial\lambda^*/
\partial p` with the same :math:`\partial\lambda^*/\partial p` as above.

If multipliers are not unique (more active constraints than forces to determine), the optimal value
has a kink, and each set of multipliers gives a slope between the left and the right one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fulcrum.synthesis import Objective, Solution
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.problem import Gravity

# Unit of each objective, as text.
UNITS = {
    Objective.MAX_NORMAL_FORCE: "N",
    Objective.NORM_NORMAL_FORCE: "N",
    Objective.MAX_TORQUE: "N·m",
    Objective.NORM_TORQUE: "N·m",
    Objective.MAX_TORQUE_UTILISATION: "-",
    Objective.FRICTION_MARGIN: "-",
}


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of the optimal objective by each parameter [unit of the objective per ..].

    Attributes:
        weight: Derivative by the weight [per N].
        center_of_mass: Derivatives by the centre of mass along the object's axes [per m].
        friction: Derivatives by the friction coefficients, by contact with friction [per 1].
        f_n_min: Derivatives by the preloads, by contact [per N].
        f_n_max: Derivatives by the finite grip limits, by contact [per N].
        tau_min: Derivatives by the finite lower torque limits, by joint [per N·m].
        tau_max: Derivatives by the finite upper torque limits, by joint [per N·m].
    """

    weight: float
    center_of_mass: tuple[float, float, float]
    friction: dict[str, float]
    f_n_min: dict[str, float]
    f_n_max: dict[str, float]
    tau_min: dict[str, float]
    tau_max: dict[str, float]


def sensitivities(solution: Solution, gravity: Gravity) -> Sensitivities:
    """Return the derivatives of a solution's optimal value.

    Args:
        solution: Solution of a problem whose external wrench contains the weight.
        gravity: The weight.
    """
    problem, multipliers = solution.problem, solution.multipliers
    contacts, joints = problem.contacts, problem.joints
    scale = _scale(solution)
    nu = scale * multipliers.equilibrium
    g, c = gravity.direction_O, gravity.center_O - problem.p_OB_O
    center = gravity.weight * np.cross(g, nu[3:])
    y_n, f_n = scale * multipliers.cone[:, N], solution.w_OC_C[:, N]
    by_tau_max, by_tau_min = -scale * multipliers.tau_max, scale * multipliers.tau_min
    if problem.objective is Objective.MAX_TORQUE_UTILISATION:
        by_tau_max = by_tau_max - solution.value * np.maximum(multipliers.gradient, 0.0)
        by_tau_min = by_tau_min + solution.value * np.maximum(-multipliers.gradient, 0.0)
    names = () if joints is None else joints.names
    tau_min = np.zeros(0) if joints is None else joints.tau_min
    tau_max = np.zeros(0) if joints is None else joints.tau_max
    return Sensitivities(
        weight=float(nu[:3] @ g + nu[3:] @ np.cross(c, g)),
        center_of_mass=(float(center[0]), float(center[1]), float(center[2])),
        friction={
            contact.name: float(-y_n[i] * f_n[i] / contact.mu)
            for i, contact in enumerate(contacts)
            if contact.model.has_friction
        },
        f_n_min={c.name: float(scale * multipliers.f_n_min[i]) for i, c in enumerate(contacts)},
        f_n_max={
            c.name: float(-scale * multipliers.f_n_max[i])
            for i, c in enumerate(contacts)
            if np.isfinite(c.f_n_max)
        },
        tau_min={names[k]: float(by_tau_min[k]) for k in np.flatnonzero(np.isfinite(tau_min))},
        tau_max={names[k]: float(by_tau_max[k]) for k in np.flatnonzero(np.isfinite(tau_max))},
    )


def _scale(solution: Solution) -> float:
    """Return the factor from the multipliers to those of the objective; 1 except for the margin."""
    if solution.problem.objective is not Objective.FRICTION_MARGIN:
        return 1.0
    rough = solution.problem.contact_set.rough
    work = (solution.multipliers.cone[:, N] * solution.w_OC_C[:, N])[rough].sum()
    return float(solution.value / work) if work > 0.0 else 0.0
