"""Problems in object frames far from their contacts: same forces, multipliers and proofs."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import InfeasibleError, Objective, Synthesizer
from fulcrum.synthesis import problem as problem_module
from fulcrum.synthesis.analysis.conflict import conflict
from fulcrum.synthesis.analysis.sensitivity import sensitivities
from fulcrum.synthesis.best_effort import best_effort
from fulcrum.synthesis.path.problem import Load
from fulcrum.synthesis.path.synthesizer import solve_path
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.robust.grip import robust_grip
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
from tests.helpers.paths import carriage
from tests.helpers.problems import BOX_WEIGHT, arms, box, random_feasible

SYNTHESIZER = Synthesizer()
FAR = np.array([6e5, -5e5, 6.2e5])  # 1e6 m
# Places 1e6 m away are rounded to 1e-10 m, and moments of 100 N there to 1e-8 N m; a grip of 1 N
# takes that and the solver's 1e-9.
AGREEMENT = 1e-6


def moved(problem, p):
    """The same problem with the object frame's origin at -p."""
    w_ext_O = problem.w_ext_O.copy()
    w_ext_O[3:] += np.cross(p, w_ext_O[:3])
    return replace(problem, p_OC_O=problem.p_OC_O + p, w_ext_O=w_ext_O)


def gravity(problem, p):
    """The weight of the box, its centre at p."""
    return Gravity(BOX_WEIGHT, problem.w_ext_O[:3] / BOX_WEIGHT, np.asarray(p))


@pytest.mark.parametrize("size", [0.1, 1.0, 3.0, 30.0, 1e3, 1e6])
@pytest.mark.parametrize("seed", range(20))
def test_forces_do_not_depend_on_the_object_frame(seed, size):
    problem = random_feasible(seed)
    near, far = (SYNTHESIZER.solve(p) for p in (problem, moved(problem, FAR * size / 1e6)))
    assert far.value == pytest.approx(near.value, rel=AGREEMENT, abs=1e-7 * problem.load)
    assert far.residuals.primal < 1e-7 * problem.load


def test_a_far_frame_about_its_own_origin_would_give_other_forces(monkeypatch):
    # The negative control: without the shift 1e6 m spoil the box's grip, in silence.
    problem = box(0.0)
    assert SYNTHESIZER.solve(moved(problem, FAR)).value == pytest.approx(27.2446, abs=1e-4)
    monkeypatch.setattr(problem_module, "_NEAR", np.inf)
    assert SYNTHESIZER.solve(moved(problem, FAR)).value < 0.5 * 27.2446


def test_equations_about_a_near_origin_are_as_they_were():
    problem = box(30.0)
    assert not problem.p_OB_O.any()
    assert problem.w_ext_B is problem.w_ext_O


def test_sensitivities_do_not_depend_on_the_object_frame():
    # Off the symmetry plane, where the multipliers are unique.
    problem = box(30.0, joints=arms())
    problem = replace(
        problem, w_ext_O=problem.w_ext_O + np.array([0.3, 0.2, 0.1, 0.02, 0.03, 0.01])
    )
    near = sensitivities(SYNTHESIZER.solve(problem), gravity(problem, np.zeros(3)))
    far = sensitivities(SYNTHESIZER.solve(moved(problem, FAR)), gravity(problem, FAR))
    assert far.weight == pytest.approx(near.weight, rel=1e-5)
    np.testing.assert_allclose(far.center_of_mass, near.center_of_mass, atol=1e-4)


def test_proofs_and_their_conflicts_do_not_depend_on_the_object_frame():
    limited = box(30.0)
    contacts = tuple(replace(c, f_n_max=5.0) for c in limited.contacts)
    limited = replace(limited, contacts=contacts)
    sentences = []
    for p in (np.zeros(3), FAR):
        with pytest.raises(InfeasibleError) as caught:
            SYNTHESIZER.solve(moved(limited, p))
        proof = caught.value.certificate
        assert proof.proves(1e4 * BOX_WEIGHT)
        sentences.append(conflict(proof, gravity(limited, p), np.eye(3)).bearable)
    assert sentences[1] == pytest.approx(sentences[0], rel=AGREEMENT)


def test_the_best_effort_is_balanced_about_the_contacts_in_a_far_frame():
    problem = box(30.0)
    contacts = tuple(replace(c, f_n_max=5.0) for c in problem.contacts)
    near = best_effort(replace(problem, contacts=contacts))
    far = best_effort(moved(replace(problem, contacts=contacts), FAR))
    # Its moments count about another point: the forces differ, but as little as near frames do.
    assert np.linalg.norm(far.imbalance) < 1.5 * np.linalg.norm(near.imbalance)


def test_one_grip_for_many_worlds_does_not_depend_on_the_object_frame():
    uncertainty = UncertaintySet(mass=0.2, center=(0.02, 0.02, 0.02), friction=0.2)
    problem = replace(box(30.0), objective=Objective.NORM_NORMAL_FORCE)
    near = robust_grip(uncertainty.worlds(problem, gravity(problem, np.zeros(3))))
    far = robust_grip(uncertainty.worlds(moved(problem, FAR), gravity(problem, FAR)))
    np.testing.assert_allclose(far.f_n, near.f_n, rtol=AGREEMENT)


def test_an_object_moves_along_a_path_as_fast_in_a_far_frame():
    path = carriage(21)
    load = path.loads[0]
    w_a_O = load.w_a_O.copy()
    w_a_O[:, 3:] += np.cross(FAR, w_a_O[:, :3])
    problems = tuple(moved(problem, FAR) for problem in load.problems)
    far = replace(path, loads=(Load(problems, w_a_O, load.w_b_O),))
    near, far = solve_path(path), solve_path(far)
    assert far.duration == pytest.approx(near.duration, rel=AGREEMENT)
    assert far.imbalance < 1e-7
