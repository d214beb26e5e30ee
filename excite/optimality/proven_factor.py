"""A factor that holds for all states, with a proof: positions by a grid, velocities and accelerations by polynomials.

In a cell of the grid ``Q(p)`` is the interpolation between the cell's corners, a convex combination, to within
``sum_i w_i^2 / 8 max |d2Q / dp_i2|``. So certificates at the corners, with that error added, prove the whole cell.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product

import clarabel
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from excite.optimality.cutting_planes import DualCertificate, conic_solution
from excite.optimality.limited_states import LimitedStates, MomentConditions, matrix_of, triangle, triangle_basis
from regressors.samples import Array, Index

MOST_COORDINATES, MOST_POSITIONS = 3, 2
COARSE, FINE = 10, 20  # cells along each of two positions; finer towards its limits, where velocities are low
_ALONE = 3  # times as many along a single one
_MOST = 4.0  # times the factor of the states that were looked at, beyond which a proof is given up
_LOWEST = 1e-3  # of the highest velocity, where none is possible
_ABOVE = 1.002  # of the smallest factor of a corner, so that its certificate serves at others too


#: Corners of cells, shape (N, c) in positions that count, and what holds in all cells around each: the largest width
#: along the axes, shape (N, c), and the highest velocities, as parts of their limits, shape (N, k); and the steps of
#: the positions along each axis, in the columns of a matrix of shape (c, c).
Grid = tuple[Array, Array, Array, Array]


def proven_factor(
    certificate: DualCertificate, guess: float, seed: int, tell: Callable[[str], None], cells: int = FINE
) -> float | None:
    """Factor that is proven for all states; None where the problem is not one of few coordinates that can be proven."""
    chosen = _functions(certificate)
    if chosen is None:
        return None
    functions, positions = chosen
    grid = _grid(certificate.conditions, functions, positions, cells if positions.size > 1 else _ALONE * cells)
    patterns = list(product((1.0, -1.0), repeat=functions.size))
    largest = 0.0
    for number, signs in enumerate(patterns):
        tell(f"proof: {number} of {len(patterns)} sign patterns of the velocities")
        try:
            pattern = SignPattern(certificate, functions, np.array(signs))
            if (largest := of_pattern(pattern, grid, max(largest, guess), _MOST * guess, seed)) > _MOST * guess:
                return None
        except NotPolynomial:
            return None
    return largest


def _functions(certificate: DualCertificate) -> tuple[Index, Index] | None:
    """The limited functions that serve as coordinates, and those of them with positions; None without as many."""
    states, counted = certificate.conditions.states, certificate.conditions.counted
    (functions,) = np.nonzero(states.speeds & np.isfinite(states.acceleration))
    k = states.n
    if k > MOST_COORDINATES or functions.size != k or int(counted.sum()) > MOST_POSITIONS:
        return None
    of_others = np.any(certificate.rows.positions_that_count() & ~counted)
    if of_others or np.linalg.matrix_rank(states.directions[functions]) < k:
        return None
    of_counted = ~np.any(states.directions[:, ~counted] != 0.0, axis=1) & np.isfinite(states.radius)
    positions = functions[of_counted[functions]]
    return (functions, positions) if positions.size == int(counted.sum()) else None


def of_pattern(pattern: SignPattern, grid: Grid, guess: float, most: float, seed: int) -> float:
    """Factor that is proven for one choice of the signs of speeds, at least the guess; infinite if above `most`.

    A certificate of one corner is tried at all others, and serves wherever it holds.
    """
    corners, widths, highest, axes = grid
    states, rng = pattern.states, np.random.default_rng(seed)
    # |m' E m| <= sum_i e_i m_i^2 with e the sums of rows, since E is symmetric
    of_Q, of_D = (np.einsum("na,aij->ni", widths**2 / 8, bound) for bound in pattern.curvature(axes, rng))
    lower, D, of_h = pattern.matrices(corners, rng)
    Q, unit = lower + of_h + of_Q[:, :, None] * np.eye(of_Q.shape[1]), np.eye(of_Q.shape[1])
    D = D - of_D[:, :, None] * unit
    V, A = states.velocity[pattern.functions], states.acceleration[pattern.functions]
    linked = np.full(V.size, np.inf) if states.bandwidth is None else (states.bandwidth * V / A) ** 2
    certificates = SumOfSquares(pattern.signs, linked)
    factor, known = guess, list[RestOfSquares]()
    while factor <= most:
        missing = factor * D - Q  # to be positive for all velocities and accelerations
        left = np.arange(len(Q))
        for rest in known:
            left = left[~rest.serves(missing[left], highest[left])]
        while left.size:
            worst = left[np.argmax(highest[left].sum(axis=1))]
            rest = certificates.rest(missing[worst], highest[worst])
            if not rest.serves(missing[[worst]], highest[[worst]])[0]:
                break
            known.append(rest)
            left = left[~rest.serves(missing[left], highest[left])]
        else:
            return factor
        factor = _ABOVE * max(factor, certificates.factor(Q[worst], D[worst], highest[worst]))
    return np.inf


def _grid(conditions: MomentConditions, functions: Index, positions: Index, cells: int) -> Grid:
    """Corners of all cells that hold positions within the limits."""
    states, counted = conditions.states, conditions.counted
    axes = [states.middle[i] - states.radius[i] * np.cos(np.linspace(0.0, np.pi, cells + 1)) for i in positions]
    if not axes:
        return np.zeros((1, 0)), np.zeros((1, 0)), np.ones((1, functions.size)), np.zeros((0, 0))
    beside = [np.maximum(*(np.pad(np.diff(axis), ends) for ends in ((0, 1), (1, 0)))) for axis in axes]
    z = _combinations(axes)
    widths = _combinations(beside)
    inverse = np.asarray(np.linalg.inv(states.directions[positions][:, counted]), dtype=float)
    known = np.isfinite(states.radius) & ~np.any(states.directions[:, ~counted] != 0.0, axis=1)
    of_z = states.directions[:, counted] @ inverse
    distance = np.abs(z @ of_z.T - states.middle) - widths @ np.abs(of_z).T
    nearest = np.maximum(distance, 0.0) / states.radius
    inside = np.all(nearest[:, known] <= 1.0, axis=1)
    highest = _highest(states, nearest[inside], known, functions)
    return (z @ inverse.T)[inside], widths[inside], highest, inverse


def _combinations(axes: Sequence[Array]) -> Array:
    """All combinations of values along some axes, shape (N, axes)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _highest(states: LimitedStates, nearest: Array, known: NDArray[np.bool_], functions: Index) -> Array:
    """``|dz| / V`` that is possible at a fraction ``nearest`` of the positions' range from its middle."""
    if states.bandwidth is None:
        return np.ones((len(nearest), functions.size))
    possible = states.bandwidth * states.radius[functions] / states.velocity[functions]
    inside = possible * np.sqrt(np.maximum(1.0 - nearest[:, functions] ** 2, 0.0))
    return np.where(known[functions], np.clip(inside, _LOWEST, 1.0), 1.0)


Polynomial = dict[tuple[int, ...], float]  # sorted indices of the variables (v, a) of each monomial
_MARGIN = 1e-6  # of the largest number of Q and D, which takes up what the solver leaves


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    result: Polynomial = defaultdict(float)
    for (x, p), (y, q) in product(a.items(), b.items()):
        result[tuple(sorted(x + y))] += p * q
    return result


def _names(k: int) -> list[tuple[int, ...]]:
    """Monomials m, as indices of (v, a)."""
    rows, columns = np.tril_indices(k)
    squares = [tuple(sorted((int(i), int(j)))) for i, j in zip(rows, columns, strict=True)]
    return [(), *((i,) for i in range(2 * k)), *squares]


class SumOfSquares:
    """Certificates for scaled v and a of k functions, for given signs: ``0 <= signs v <= 1`` and ``|a| <= 1``."""

    def __init__(self, signs: Array, linked: Array) -> None:
        k = signs.size
        self._k, self._names = k, _names(k)
        self._linked = np.flatnonzero(np.isfinite(linked))
        self._factors = linked[self._linked]
        self._sizes = [len(self._names), *(1 + k for _ in range(k))]
        gram = _gram(self._names, len(self._names), {(): 1.0})
        columns = [*gram]
        for i in range(k):
            columns += _gram(self._names, 1 + k, {(): 1.0, (i, i): -1.0})
        self._free = len(columns)
        columns += _bounds(signs)
        self._places: dict[tuple[int, ...], int] = {}
        for column in columns:
            for key in column:
                self._places.setdefault(key, len(self._places))
        self._columns = np.stack([_column(each, self._places) for each in columns], axis=1)
        self._of_m = self._columns[:, : len(gram)]

    def _links(self, highest: Array) -> Array:
        """Columns of the links, for velocities in units of the highest ones."""
        k = self._k
        links = [
            {(): float(factor), (i, i): -float(factor * highest[i] ** 2), (k + i, k + i): -1.0}
            for i, factor in zip(self._linked.tolist(), self._factors, strict=True)
        ]
        return np.array([_column(each, self._places) for each in links]).reshape(-1, len(self._places)).T

    def _scales(self, highest: Array) -> Array:
        return np.array([np.prod([highest[i] for i in name if i < self._k]) for name in self._names])

    def factor(self, Q: Array, D: Array, highest: Array) -> float:
        """Smallest factor with a certificate of ``m' Q m <= factor m' D m``; infinite where none was found."""
        # Q, D (|m|, |m|); highest (k,)
        scales = self._scales(highest)
        of_Q, of_D = (self._of_m @ triangle(M * np.outer(scales, scales)) for M in (Q, D))
        A = np.concatenate([self._columns, self._links(highest)], axis=1)
        margin = np.zeros(len(A))
        margin[self._places[()]] = _MARGIN * max(np.abs(of_Q).max(), np.abs(of_D).max())
        x = self._solved(A, of_Q + margin, of_D)
        lacking = self._lacking(x, A, of_Q + margin, of_D)
        return float(x[0]) if lacking <= margin.max() else np.inf

    def rest(self, M: Array, highest: Array) -> RestOfSquares:
        """The certificate of ``m' M m >= 0`` that leaves most of M, but for its square of all monomials."""
        scales = np.outer(*[self._scales(highest)] * 2)
        size, unit = float(np.abs(M * scales).max()), np.eye(len(M))
        of_M, of_unit = (self._of_m @ triangle(each) for each in (M * scales / size, unit))
        A = np.concatenate([self._columns, self._links(highest)], axis=1)
        x = self._solved(A, -of_M, of_unit)  # A x = of_M + x_0 of_unit
        N = M * scales / size + x[0] * unit - matrix_of(x[1 : 1 + self._of_m.shape[1]], len(M))
        N[0, 0] += self._lacking(x, A, -of_M, of_unit)
        return RestOfSquares(size * N, scales, highest)

    def _solved(self, A: Array, of_Q: Array, of_D: Array) -> Array:
        """``A x = factor of_D - of_Q`` with the least factor; the factor, then x."""
        count = A.shape[1]
        equations = sp.hstack([sp.csc_matrix(-of_D[:, None]), sp.csc_matrix(A)])
        signs = sp.hstack([sp.csc_matrix((count, 1)), -sp.eye_array(count)])
        cones = [clarabel.ZeroConeT(len(A)), *(clarabel.PSDTriangleConeT(size) for size in self._sizes)]
        cones.append(clarabel.NonnegativeConeT(count - self._free))
        right = np.concatenate([-of_Q, np.zeros(count)])
        return np.array(conic_solution(np.eye(1 + count)[0], sp.vstack([equations, signs]), right, cones).x)

    def _lacking(self, x: Array, A: Array, of_Q: Array, of_D: Array) -> float:
        """By how much a solution may fall short of a certificate: scaled variables, and monomials, are at most 1."""
        if not np.all(np.isfinite(x)):
            return np.inf
        short = float(np.abs(A @ x[1:] - x[0] * of_D + of_Q).sum())
        first = 1
        for size in self._sizes:
            count = size * (size + 1) // 2
            lowest = float(np.linalg.eigvalsh(matrix_of(x[first : first + count], size))[0])
            short += size * max(0.0, -lowest)
            first += count
        largest = np.abs(A[:, self._free :]).sum(axis=0)
        return short + float(largest @ np.maximum(-x[1 + self._free :], 0.0))


_ROUNDED = 1e-9


@dataclass(frozen=True, eq=False)
class RestOfSquares:
    """``m' N m >= 0`` up to the highest velocities: ``m' M m >= 0`` wherever ``M - N`` is positive semidefinite."""

    N: Array  # (|m|, |m|) in the monomials of velocities in units of the highest ones
    scales: Array  # (|m|, |m|) products of these units
    highest: Array  # (k,)

    def serves(self, M: Array, highest: Array) -> NDArray[np.bool_]:
        """Whether it proves each matrix positive, shape (N,)."""  # M (N, |m|, |m|); highest (N, k)
        slower = np.all(highest <= self.highest, axis=1)
        if not np.all(np.isfinite(self.N)):
            return np.zeros_like(slower)
        scaled = M * self.scales
        lowest = np.linalg.eigvalsh(scaled - self.N)[:, 0]
        return np.asarray(slower & (lowest >= _ROUNDED * np.abs(scaled).max(axis=(1, 2))))


def _bounds(signs: Array) -> list[Polynomial]:
    """Linear bounds on v and a, and the products of all pairs of them."""
    linear: list[Polynomial] = []
    for i, sign in enumerate(signs.tolist()):
        a = signs.size + i
        linear += [{(i,): sign}, {(): 1.0, (i,): -sign}, {(): 1.0, (a,): 1.0}, {(): 1.0, (a,): -1.0}]
    return [*linear, *(_product(a, b) for a, b in combinations_with_replacement(linear, 2))]


def _column(polynomial: Polynomial, places: dict[tuple[int, ...], int]) -> Array:
    column = np.zeros(len(places))
    for key, value in polynomial.items():
        column[places[key]] += value
    return column


def _gram(names: list[tuple[int, ...]], size: int, factor: Polynomial) -> list[Polynomial]:
    """Polynomials ``m' E m`` times a factor, of the basis matrices E of the first monomials."""
    polynomials = []
    for E in triangle_basis(size):
        total: Polynomial = defaultdict(float)
        for i, j in zip(*np.nonzero(E), strict=True):
            for key, value in _product({tuple(sorted(names[i] + names[j])): float(E[i, j])}, factor).items():
                total[key] += value
        polynomials.append(total)
    return polynomials


_DEGREE = 4  # of Y'Y in each angle
_AGREES = 1e-9
_CHECKS = 12


class NotPolynomial(Exception):
    """The rows are no polynomial of the expected form."""


def monomials(v: Array, a: Array) -> Array:
    """``m`` at N instants, shape (N, 1 + 2 k + k (k + 1) / 2)."""
    i, j = np.tril_indices(v.shape[1])
    return np.concatenate([np.ones((len(v), 1)), v, a, v[:, i] * v[:, j]], axis=1)


@dataclass(frozen=True, eq=False)
class SignPattern:
    """``Q(p)`` and ``D(p)`` for one choice of the signs of k speeds, in scaled v and a within [-1, 1]."""

    certificate: DualCertificate
    functions: Index  # (k,) the limited functions whose velocities and accelerations are v and a
    signs: Array  # (k,)

    @property
    def states(self) -> LimitedStates:
        """Within the limits."""
        return self.certificate.conditions.states

    def states_at(self, p: Array, v: Array, a: Array) -> Array:
        """States (y, dy, ddy) of positions, shape (N, counted), and scaled velocities and accelerations."""
        k = self.states.n
        S = np.zeros((len(p), 3 * k))
        S[:, :k] = self.states.centre
        S[:, :k][:, self.certificate.conditions.counted] = p
        inverse = np.linalg.inv(self.states.directions[self.functions])
        S[:, k : 2 * k] = (v * self.states.velocity[self.functions]) @ inverse.T
        S[:, 2 * k :] = (a * self.states.acceleration[self.functions]) @ inverse.T
        return S

    def matrices(self, p: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """``<F, lower>``, ``<F, upper> + constant`` and ``c' h`` as matrices of m, shape (N, |m|, |m|) each."""
        k = self.states.n
        size = 1 + 2 * k + k * (k + 1) // 2
        v, a = self.signs * rng.uniform(0.05, 1.0, (2 * size, k)), rng.uniform(-1.0, 1.0, (2 * size, k))
        m = monomials(v, a)
        G = np.stack([self._coefficients(np.tile(point, (len(v), 1)), v, a, m) for point in p])
        of_h = np.stack([self._of_conditions(np.tile(point, (len(v), 1)), v, a) for point in p])
        dual, prior = self.certificate, self.certificate.rows.prior
        lower, upper = (np.einsum("nrim,ij,nrjl->nml", G, M, G, optimize=True) for M in (dual.lower, dual.upper))
        lower[:, 0, 0] += float(np.sum(prior * dual.lower))
        upper[:, 0, 0] += float(np.sum(prior * dual.upper)) + dual.constant
        return lower, upper, of_h

    def _coefficients(self, p: Array, v: Array, a: Array, m: Array) -> Array:
        """``G`` at one p, shape (r, b, |m|), by least squares over twice as many instants as monomials."""
        Y = self.certificate.rows(self.states_at(p, v, a))
        flat = Y.reshape(len(Y), -1)
        G, *_ = np.linalg.lstsq(m, flat, rcond=None)
        if np.abs(m @ G - flat).max() > _AGREES * max(1.0, float(np.abs(flat).max())):
            raise NotPolynomial
        return np.asarray(G.T.reshape(*Y.shape[1:], m.shape[1]))

    def _of_conditions(self, p: Array, v: Array, a: Array) -> Array:
        """``c' h`` as a matrix of (1, v, a) within that of m, by least squares."""
        k = self.states.n
        size = 1 + 2 * k + k * (k + 1) // 2
        i, j = np.tril_indices(1 + 2 * k)
        more_v, more_a = np.concatenate([v] * 3), np.concatenate([a, -a[::-1], 0.5 * np.roll(a, 1, axis=0)])
        u = np.concatenate([np.ones((len(more_v), 1)), more_v, more_a], axis=1)
        S = self.states_at(np.tile(p[:1], (len(more_v), 1)), more_v, more_a)
        values = self.certificate.conditions.values(S) @ self.certificate.moments
        products = u[:, i] * u[:, j]
        c, *_ = np.linalg.lstsq(products, values, rcond=None)
        if np.abs(products @ c - values).max() > _AGREES * max(1.0, float(np.abs(values).max())):
            raise NotPolynomial
        M = np.zeros((size, size))
        M[i, j] += 0.5 * c
        M[j, i] += 0.5 * c
        return M

    def curvature(self, axes: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Bounds on second derivatives of ``<F, lower> + c' h`` and of ``<F, upper>``, shape (axes, |m|, |m|) each.

        From the Fourier coefficients over full turns, which are exact for trigonometric polynomials; c' h is
        quadratic in p.
        """  # axes (counted, counted)
        n = int(self.certificate.conditions.counted.sum())
        if not n:
            size = self.matrices(np.zeros((1, 0)), rng)[0].shape
            return np.zeros((0, *size[1:])), np.zeros((0, *size[1:]))
        count = 2 * _DEGREE + 1
        angles = 2 * np.pi * np.arange(count) / count
        lower, upper, _ = self.matrices(_combinations([angles] * n), rng)
        found = []
        for values in (lower, upper):
            c = np.fft.fftn(values.reshape(*(count,) * n, *values.shape[1:]), axes=tuple(range(n))) / count**n
            self._check_degree(c, n, values is lower, rng)
            orders = np.fft.fftfreq(count, 1 / count)
            along = np.stack(np.meshgrid(*[orders] * n, indexing="ij"), axis=-1) @ axes
            found.append(np.tensordot(np.moveaxis(along**2, -1, 0), np.abs(c), n))
        found[0] = found[0] + self._of_quadratic(axes, rng)
        return found[0], found[1]

    def _check_degree(self, c: Array, n: int, is_lower: bool, rng: np.random.Generator) -> None:
        p = rng.uniform(-np.pi, np.pi, (_CHECKS, n))
        values = self.matrices(p, rng)[0 if is_lower else 1]
        orders = np.fft.fftfreq(2 * _DEGREE + 1, 1 / (2 * _DEGREE + 1))
        places = list(np.ndindex(*c.shape[:n]))
        expected = sum(np.exp(1j * p @ orders[list(place)])[:, None, None] * c[place] for place in places)
        if np.abs(expected - values).max() > 1e-8 * max(1.0, float(np.abs(values).max())):
            raise NotPolynomial

    def _of_quadratic(self, axes: Array, rng: np.random.Generator) -> Array:
        """The same of c' h: second differences, the same everywhere."""
        n = len(axes)
        points = np.concatenate([np.zeros((1, n)), *[np.array([e, -e, 2 * e]) for e in axes.T]])
        h = self.matrices(points, rng)[2]
        second = np.stack([h[1 + 3 * i] - 2 * h[0] + h[2 + 3 * i] for i in range(n)])
        other = np.stack([h[3 + 3 * i] - 2 * h[1 + 3 * i] + h[0] for i in range(n)])
        if np.abs(second - other).max() > 1e-8 * max(1.0, float(np.abs(h).max())):
            raise NotPolynomial
        return np.asarray(np.abs(second))
