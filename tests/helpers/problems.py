"""Reference problems: the paper's box and cylinder, and random problems of every structure."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.synthesis import Contact, ContactModel, Joints, Objective, Problem, Role
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.contact import grasp_maps

BOX_WEIGHT = 20.0
BOX_BALANCE_DEG = float(np.degrees(np.arctan2(0.3, 0.1)))
CYLINDER_GRIP_LIMIT = 30.0


def axes(normal: Array, t: Array) -> Array:
    """R_OC with columns (t, o, n); t must be perpendicular to the normal."""
    return np.stack([t, np.cross(normal, t), normal], axis=1)


def _tilt(tilt_deg: float) -> Array:
    """R_WO: the object's x axis raised about the world's -y axis, which the pivot lies along."""
    R_WO: Array = Rotation.from_euler("y", -tilt_deg, degrees=True).as_matrix()
    return R_WO


def _weight(R_WO: Array, weight: float) -> Array:
    """Weight at the object's origin, the centre of mass, in object axes."""
    return np.concatenate([R_WO.T @ [0.0, 0.0, -weight], np.zeros(3)])


def box(
    tilt_deg: float = 0.0,
    *,
    along: float = 0.225,
    up: float = 0.05,
    weight: float = BOX_WEIGHT,
    environment: bool = True,
    joints: Joints | None = None,
    objective: Objective = Objective.MAX_NORMAL_FORCE,
) -> Problem:
    """The box of Table II, 0.3 x 0.2 x 0.1 m, on its edge at x = -0.15, z = -0.05.

    Args:
        tilt_deg: Angle of the 0.3 m side with the ground [deg].
        along: Distance of the hands from the edge along the 0.3 m side [m].
        up: Distance of the hands from the edge along the 0.1 m side [m].
        weight: Weight [N].
        environment: Without, the box is lifted off.
        joints: The joints behind the two hands.
        objective: What to minimise.
    """
    R_WO = _tilt(tilt_deg)
    ex, ey = np.eye(3)[:2]
    hand = partial(Contact, role=Role.HAND, model=ContactModel.SFCE, mu=0.1, e_n=0.5)
    edge = partial(Contact, role=Role.ENVIRONMENT, model=ContactModel.PCWF, mu=0.25)
    contacts = [hand("left"), hand("right")]
    R_OC = [axes(-ey, ex), axes(ey, ex)]
    p_OC_O = [[along - 0.15, 0.1, up - 0.05], [along - 0.15, -0.1, up - 0.05]]
    if environment:
        contacts += [edge("edge left"), edge("edge right")]
        R_OC += [R_WO.T, R_WO.T]
        p_OC_O += [[-0.15, 0.1, -0.05], [-0.15, -0.1, -0.05]]
    return Problem(
        contacts=tuple(contacts),
        R_OC=np.array(R_OC),
        p_OC_O=np.array(p_OC_O),
        w_ext_O=_weight(R_WO, weight),
        joints=joints,
        objective=objective,
    )


def arms(seed: int = 0) -> Joints:
    """Two arms of seven joints with random Jacobians and Baxter's torque limits."""
    rng = np.random.default_rng(seed)
    J_C = np.zeros((2, 6, 14))
    J_C[0, :, :7] = 0.2 * rng.normal(size=(6, 7))
    J_C[1, :, 7:] = 0.2 * rng.normal(size=(6, 7))
    tau_max = np.tile([50.0, 50.0, 50.0, 50.0, 15.0, 15.0, 15.0], 2)
    return Joints(
        names=tuple(f"{side}_{k}" for side in ("left", "right") for k in range(7)),
        J_C=J_C,
        tau_g=rng.uniform(-0.2, 0.2, size=14) * tau_max,
        tau_min=-tau_max,
        tau_max=tau_max,
    )


def cylinder(
    tilt_deg: float,
    *,
    depth: float = 0.0,
    upper_wall: bool = True,
    environment: bool = True,
    f_n_max: float = CYLINDER_GRIP_LIMIT,
) -> Problem:
    """The hollow cylinder of Table I on one rim point, a finger on either side of its wall.

    Args:
        tilt_deg: Angle of the axis with the ground [deg].
        depth: Distance of the fingers from the far rim [m].
        upper_wall: Whether the fingers hold the wall opposite to the rim contact, or above it.
        environment: Without, the cylinder is lifted off.
        f_n_max: Grip limit per finger [N].
    """
    R_WO = _tilt(tilt_deg)
    ex, _, ez = np.eye(3)
    side = 1.0 if upper_wall else -1.0
    finger = partial(
        Contact, role=Role.HAND, model=ContactModel.SFCE, mu=0.15, e_n=0.25, f_n_max=f_n_max
    )
    contacts = [finger("outer"), finger("inner")]
    R_OC = [axes(-side * ez, ex), axes(side * ez, ex)]
    p_OC_O = [[0.25 - depth, 0.0, 0.18 * side], [0.25 - depth, 0.0, 0.15 * side]]
    if environment:
        contacts.append(Contact("rim", Role.ENVIRONMENT, ContactModel.PCWF, mu=0.2))
        R_OC.append(R_WO.T)
        p_OC_O.append([-0.25, 0.0, -0.18])
    return Problem(
        contacts=tuple(contacts),
        R_OC=np.array(R_OC),
        p_OC_O=np.array(p_OC_O),
        w_ext_O=_weight(R_WO, 30.0),
    )


def random_feasible(seed: int, objective: Objective | None = None) -> Problem:
    """A problem with every kind of constraint around forces that are drawn first.

    Args:
        seed: Seed of the problem.
        objective: What to minimise; drawn, too, by default.
    """
    rng = np.random.default_rng(seed)
    objective = objective or list(Objective)[rng.integers(len(Objective))]
    hands, environment = rng.integers(1, 6), rng.integers(0, 6)
    size = 10.0 ** rng.uniform(-0.5, 2.0)
    contacts, wrenches = [], []
    for i in range(hands + environment):
        role = Role.HAND if i < hands else Role.ENVIRONMENT
        contact = _random_contact(rng, f"{role} {i}", role)
        if i == 0 and objective is Objective.FRICTION_MARGIN:
            contact = replace(contact, model=ContactModel.SFCE)
        w = _wrench_inside(rng, contact, size)
        limited = objective is Objective.FRICTION_MARGIN or rng.random() < 0.5
        contacts.append(
            replace(
                contact,
                f_n_min=float(w[2] * rng.uniform(0.0, 1.0)) if rng.random() < 0.5 else 0.0,
                f_n_max=float(w[2] * rng.uniform(1.0, 3.0)) if limited else np.inf,
            )
        )
        wrenches.append(w)
    R_OC = Rotation.random(len(contacts), rng=rng).as_matrix()
    p_OC_O = rng.uniform(-0.3, 0.3, size=(len(contacts), 3))
    w_OC_C = np.array(wrenches)
    w_ext_O = -np.einsum("mkj,mj->k", grasp_maps(R_OC, p_OC_O), w_OC_C)
    joints = None
    if objective.needs_joints or rng.random() < 0.5:
        joints = _joints_around(rng, w_OC_C[:hands], size, objective)
    return Problem(tuple(contacts), R_OC, p_OC_O, w_ext_O, joints, objective)


def random_infeasible(seed: int, objective: Objective | None = None) -> Problem:
    """A random problem made infeasible in a way that needs no solver to see.

    The three ways in turn: a weight beyond the sum of all that the contacts can bear, a pull away
    from contacts that can only push, and a preload whose torque exceeds a joint's limit.
    """
    problem = random_feasible(seed, objective)
    rng = np.random.default_rng([seed, 1])
    way = (_too_heavy, _pulled_away, _preloaded_beyond_torque)[seed % 3]
    return way(rng, problem)


def _random_contact(rng: np.random.Generator, name: str, role: Role) -> Contact:
    return Contact(
        name=name,
        role=role,
        model=list(ContactModel)[rng.integers(len(ContactModel))],
        mu=float(rng.uniform(0.1, 1.0)),
        e_t=float(rng.uniform(0.5, 2.0)),
        e_o=float(rng.uniform(0.5, 2.0)),
        e_n=float(10.0 ** rng.uniform(-2.0, 0.0)),
    )


def _wrench_inside(rng: np.random.Generator, contact: Contact, size: float) -> Array:
    """A wrench at a friction utilisation of at most 0.95, (6,)."""
    w = np.zeros(6)
    w[2] = size * rng.uniform(0.1, 1.0)
    tangential = list(contact.model.components[1:])
    if tangential:
        direction = rng.normal(size=len(tangential))
        direction *= rng.uniform(0.0, 0.95) / np.linalg.norm(direction)
        w[tangential] = w[2] * direction * contact.scale[1:]
    return w


def _joints_around(
    rng: np.random.Generator, w_OC_C: Array, size: float, objective: Objective
) -> Joints:
    """Joints, a third of their Jacobian columns zero, with unequal limits around given forces."""
    l = int(rng.integers(1, 15))
    J_C = 0.4 * rng.normal(size=(len(w_OC_C), 6, l)) * (rng.random((len(w_OC_C), 1, l)) > 0.33)
    tau_g = 0.1 * size * rng.normal(size=l)
    tau = np.einsum("nkl,nk->l", J_C, w_OC_C) + tau_g
    tau_min = np.minimum(tau, 0.0) - size * rng.uniform(0.01, 1.0, size=l)
    tau_max = np.maximum(tau, 0.0) + size * rng.uniform(0.01, 1.0, size=l)
    if objective is not Objective.MAX_TORQUE_UTILISATION:
        tau_min[rng.random(l) < 0.2] = -np.inf
        tau_max[rng.random(l) < 0.2] = np.inf
    return Joints(tuple(f"joint {k}" for k in range(l)), J_C, tau_g, tau_min, tau_max)


def _too_heavy(rng: np.random.Generator, problem: Problem) -> Problem:
    limits = rng.uniform(1.0, 10.0, size=len(problem.contacts))
    contacts = tuple(
        replace(c, f_n_min=0.0, f_n_max=float(f))
        for c, f in zip(problem.contacts, limits, strict=True)
    )
    # A contact force is at most f_n (1 + mu max(e_t, e_o)), here at most f_n (1 + 2 mu).
    strength = sum(c.f_n_max * (1.0 + 2.0 * c.mu) for c in contacts)
    direction = rng.normal(size=3)
    w_ext_O = problem.w_ext_O.copy()
    w_ext_O[:3] = direction / np.linalg.norm(direction) * strength * rng.uniform(1.01, 2.0)
    return replace(problem, contacts=contacts, w_ext_O=w_ext_O)


def _pulled_away(rng: np.random.Generator, problem: Problem) -> Problem:
    # All normals point along +z, and so does the wrench: nothing pushes the object back down.
    yaw = rng.uniform(-np.pi, np.pi, size=(len(problem.contacts), 1))
    w_ext_O = problem.w_ext_O.copy()
    w_ext_O[2] = abs(w_ext_O[2]) + 1.0
    return replace(problem, R_OC=Rotation.from_euler("z", yaw).as_matrix(), w_ext_O=w_ext_O)


def _preloaded_beyond_torque(rng: np.random.Generator, problem: Problem) -> Problem:
    hands = len(problem.hands)
    preload = float(rng.uniform(1.0, 10.0))
    contacts = tuple(
        replace(c, f_n_min=preload, f_n_max=np.inf) if i == problem.hands[0] else c
        for i, c in enumerate(problem.contacts)
    )
    # One joint pushes straight along the first hand's normal: tau = f_n.
    J_C = np.zeros((hands, 6, 1))
    J_C[0, 2, 0] = 1.0
    limit = np.array([preload * rng.uniform(0.3, 0.99)])
    joints = Joints(("slider",), J_C, np.zeros(1), -limit, limit)
    return replace(problem, contacts=contacts, joints=joints)


def load(problem: Problem) -> float:
    """The scale of the forces in a problem [N, N·m]."""
    return max(float(np.abs(problem.w_ext_O).max()), *(c.f_n_min for c in problem.contacts))
