"""What the synthesis is measured against: (17) with max-normal-force on other solvers.

Every peer is a class whose ``prepare`` does what may be done ahead for one pose (timed nowhere) and
whose ``solve`` does the rest and returns the largest normal force of the hands [N].
"""

import contextlib
import io

import clarabel
import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis.conic import ConicForm
from fulcrum.synthesis.solver import solver_settings

TOLERANCE = 1e-9


class Matrices:
    """The conic form of all poses, prebuilt: rows in the order equalities, inequalities, cones."""

    def __init__(self, problems, torque_limits=True):
        self.form = form = ConicForm(problems[0], torque_limits)
        mask = form.sparsity(problems[0])
        self.q = np.zeros(form.columns)
        self.q[form.aux_column] = 1.0
        self.nonnegative = form.linear_rows.stop - form.equilibrium_rows.stop
        self.widths = [width for _, width in form.cones]
        equality, conic = mask[:6], mask[6:]
        self.A_pattern, self.G_pattern = (_pattern(rows) for rows in (equality, conic))

    def dense(self, problem):
        A, b = self.form.matrices(problem)
        scale = self.form.row_scale(b)
        return A * scale[:, None], b * scale

    def sparse(self, problem):
        """(A, b, G, h) with one sparsity for all problems."""
        A, b = self.dense(problem)
        return fill(self.A_pattern, A[:6]), b[:6], fill(self.G_pattern, A[6:]), b[6:]

    def value(self, x, problem):
        return float(x[self.form.aux_column]) * problem.load


def _pattern(mask):
    return sp.csc_matrix(mask.astype(float))


def fill(pattern, dense):
    """The dense matrix in the sparsity of a pattern; explicit zeros stay."""
    columns = np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
    filled = pattern.copy()
    filled.data = dense[pattern.indices, columns].copy()
    return filled


class Clarabel:
    """Clarabel, update and solve on prebuilt matrices: the bare solve.

    With all rows it is set as the synthesis sets it for a careful solve, without the torque limits
    as for an attempt.
    """

    def __init__(self, problems, torque_limits=True):
        self.matrices = matrices = Matrices(problems, torque_limits)
        settings = solver_settings()
        settings.iterative_refinement_enable = torque_limits
        form = matrices.form
        self.pattern = _pattern(form.sparsity(problems[0]))
        A, b = matrices.dense(problems[0])
        P = sp.csc_matrix((form.columns, form.columns))
        self.solver = clarabel.DefaultSolver(
            P, matrices.q, fill(self.pattern, A), b, form.clarabel_cones, settings
        )

    def prepare(self, problem):
        A, b = self.matrices.dense(problem)
        return fill(self.pattern, A).data.tolist(), b.tolist()

    def solve(self, data, b):
        self.solver.update(A=data, b=b)
        return self.solver.solve()

    def value(self, result, problem):
        return self.matrices.value(result.x, problem)


class Ecos:
    """ECOS on prebuilt matrices; its interface has no update."""

    def __init__(self, problems):
        import ecos

        self.call = ecos.solve
        self.matrices = Matrices(problems)
        self.dims = {"l": self.matrices.nonnegative, "q": self.matrices.widths}

    def prepare(self, problem):
        A, b, G, h = self.matrices.sparse(problem)
        return G, h, A, b

    def solve(self, G, h, A, b):
        return self.call(
            self.matrices.q, G, h, self.dims, A, b, verbose=False,
            abstol=TOLERANCE, reltol=TOLERANCE, feastol=TOLERANCE,
        )  # fmt: skip

    def value(self, result, problem):
        return self.matrices.value(result["x"], problem)


class Qoco:
    """QOCO, update and solve on prebuilt matrices."""

    def __init__(self, problems):
        import qoco

        self.matrices = matrices = Matrices(problems)
        A, b, G, h = matrices.sparse(problems[0])
        rows, columns = G.shape
        self.solver = qoco.QOCO()
        self.solver.setup(
            columns, rows, 6, None, matrices.q, A, b, G, h, matrices.nonnegative,
            len(matrices.widths), np.array(matrices.widths, dtype=np.int32),
            abstol=TOLERANCE, reltol=TOLERANCE, verbose=False,
        )  # fmt: skip

    def prepare(self, problem):
        A, b, G, h = self.matrices.sparse(problem)
        return A.data, b, G.data, h

    def solve(self, A, b, G, h):
        self.solver.update_vector_data(b=b, h=h)
        self.solver.update_matrix_data(A=A, G=G)
        return self.solver.solve()

    def value(self, result, problem):
        # From one pose to a distant one an update sometimes ends "inaccurate", far off.
        if str(result.status) != "QOCO_SOLVED":
            return np.nan
        return self.matrices.value(result.x, problem)


class CvxpyRebuilt:
    """CVXPY as one writes it down, made anew at every call."""

    def __init__(self, problems):
        pass

    def prepare(self, problem):
        return (problem,)

    def solve(self, problem):
        grip, constraints = cvxpy_program(problem, problem.G, problem.w_ext_O, problem.joints.J_C,
                                          problem.joints.tau_g)  # fmt: skip
        return cp.Problem(cp.Minimize(grip), constraints).solve(solver=cp.CLARABEL)

    def value(self, result, problem):
        return float(result)


class CvxpyParameters:
    """CVXPY with parameters (DPP), compiled once."""

    def __init__(self, problems):
        problem = problems[0]
        shape = (6, problem.joints.J_C.shape[2])
        self.G = [cp.Parameter((6, 6)) for _ in problem.contacts]
        self.J = [cp.Parameter(shape) for _ in problem.hands]
        self.w, self.tau_g = cp.Parameter(6), cp.Parameter(shape[1])
        grip, constraints = cvxpy_program(problem, self.G, self.w, self.J, self.tau_g)
        self.program = cp.Problem(cp.Minimize(grip), constraints)
        assert self.program.is_dcp(dpp=True)

    def prepare(self, problem):
        return (problem,)

    def solve(self, problem):
        for parameters, values in ((self.G, problem.G), (self.J, problem.joints.J_C)):
            for parameter, value in zip(parameters, values, strict=True):
                parameter.value = value
        self.w.value, self.tau_g.value = problem.w_ext_O, problem.joints.tau_g
        return self.program.solve(solver=cp.CLARABEL)

    def value(self, result, problem):
        return float(result)


def cvxpy_program(problem, G, w_ext_O, J_C, tau_g):
    """Grip and constraints; numbers may be parameters."""
    w = [cp.Variable(len(c.model.components)) for c in problem.contacts]
    select = [np.eye(6)[:, list(c.model.components)] for c in problem.contacts]
    tau = tau_g + sum(
        (J.T @ select[i] @ w[i] for J, i in zip(J_C, problem.hands, strict=True)), start=0.0
    )
    constraints = [
        sum((G_i @ S @ w_i for G_i, S, w_i in zip(G, select, w, strict=True)), start=w_ext_O) == 0,
        tau <= problem.joints.tau_max,
        tau >= problem.joints.tau_min,
    ]
    for contact, w_i in zip(problem.contacts, w, strict=True):
        scaled = cp.multiply(1.0 / contact.scale[1:], w_i[1:])
        constraints += [cp.SOC(w_i[0], scaled), w_i[0] >= contact.f_n_min]
    return cp.max(cp.hstack([w[i][0] for i in problem.hands])), constraints


class Pyramids:
    """Linear constraints in the place of the cones, on a QP solver through qpsolvers.

    Inner approximation: the polygon of so many facets inscribed in the circle of tangential forces;
    with torsion its hull with the two poles, so twice as many facets. Corners lie on the contact
    axes, along which the forces here mostly act: that flatters the pyramids.
    """

    def __init__(self, problems, facets, solver):
        import qpsolvers

        if solver not in qpsolvers.available_solvers:
            raise ImportError(f"qpsolvers has no {solver}")
        self.qp, self.solver = qpsolvers, solver
        self.matrices = Matrices(problems)
        self.options = {"verbose": False}
        if solver in ("piqp", "proxqp"):
            self.options["eps_abs"] = 1e-8
        # DAQP factorises P: a trace of it leaves the optimum what it is to 1e-6.
        self.P = np.eye(self.matrices.form.columns) * (1e-7 if solver == "daqp" else 0.0)
        if solver == "piqp":
            self.options["backend"] = "dense"
        facing = 2.0 * np.pi * (np.arange(facets) + 0.5) / facets
        # |f_t| <= f_n along each facet's normal; the polygon's corners lie on the circle.
        polygon = np.stack([np.cos(facing), np.sin(facing)], axis=1) / np.cos(np.pi / facets)
        blocks = []
        for width in self.matrices.widths:
            normals = polygon if width == 3 else np.vstack(
                [np.column_stack([polygon, np.full(facets, sign)]) for sign in (1.0, -1.0)]
            )  # fmt: skip
            blocks.append(np.column_stack([-np.ones(len(normals)), normals]))
        self.linear = sp.block_diag(blocks).toarray()

    def prepare(self, problem):
        A, b = self.matrices.dense(problem)
        form = self.matrices.form
        # The cone rows read s = x: so the facets are `linear @ s <= 0`, with s = b - A x.
        cones = -self.linear @ A[form.cone_rows]
        bounds = slice(6, form.linear_rows.stop)
        G = np.vstack([A[bounds], cones])
        h = np.concatenate([b[bounds], np.zeros(len(cones))])
        return (self.qp.Problem(self.P, self.matrices.q, G, h, A[:6], b[:6]),)

    def solve(self, problem):
        with contextlib.redirect_stdout(io.StringIO()):
            return self.qp.solve_problem(problem, self.solver, **self.options)

    def value(self, result, problem):
        if not result.found:
            return np.nan
        return self.matrices.value(result.x, problem)


class Drake:
    """Drake's MathematicalProgram with Clarabel, made anew at every call as its users do."""

    def __init__(self, problems):
        from pydrake import solvers

        self.solvers = solvers
        self.solver = solvers.ClarabelSolver()

    def prepare(self, problem):
        return (problem,)

    def solve(self, problem):
        program = self.solvers.MathematicalProgram()
        w = [program.NewContinuousVariables(len(c.model.components)) for c in problem.contacts]
        grip = program.NewContinuousVariables(1)
        select = [list(c.model.components) for c in problem.contacts]
        G = np.hstack([G_i[:, s] for G_i, s in zip(problem.G, select, strict=True)])
        program.AddLinearEqualityConstraint(G, -problem.w_ext_O, np.concatenate(w))
        joints = problem.joints
        JT = np.hstack([joints.J_C[k][select[i]].T for k, i in enumerate(problem.hands)])
        hands = np.concatenate([w[i] for i in problem.hands])
        program.AddLinearConstraint(
            JT, joints.tau_min - joints.tau_g, joints.tau_max - joints.tau_g, hands
        )
        for contact, w_i in zip(problem.contacts, w, strict=True):
            A = np.diag(1.0 / contact.scale)
            program.AddLorentzConeConstraint(A, np.zeros(len(A)), w_i)
            program.AddBoundingBoxConstraint(contact.f_n_min, np.inf, w_i[0])
        for i in problem.hands:
            program.AddLinearConstraint(
                np.array([[1.0, -1.0]]), [-np.inf], [0.0], [w[i][0], grip[0]]
            )
        program.AddLinearCost([1.0], grip)
        return self.solver.Solve(program)

    def value(self, result, problem):
        return float(result.get_optimal_cost())
