"""Operations on balls: what they hold, and that the compiled ones are those of numpy to the last bit."""

import importlib.util
import pickle
import sys
import warnings
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from numpy.lib.stride_tricks import as_strided

from enumsol.arithmetic import balls
from enumsol.arithmetic.balls import Ball, Inverse


@pytest.fixture(scope="module")
def plain():
    """The module as it is where nothing was compiled."""
    spec = importlib.util.spec_from_file_location("plain_balls", balls.__file__)
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "plain_balls", module)
        patch.setitem(sys.modules, "enumsol.arithmetic._balls", None)
        spec.loader.exec_module(module)
    assert module.Ball.__mro__[1].__module__ == "enumsol.arithmetic.plain_pairs"
    return module


@pytest.fixture(params=["as it is", "plain"])
def kind(request, plain):
    """Balls of either code."""
    return Ball if request.param == "as it is" else plain.Ball


def test_the_compiled_operations_are_used_where_they_are():
    compiled = pytest.importorskip("enumsol.arithmetic._balls")
    assert issubclass(Ball, compiled.Pair)
    assert not any(name in vars(Ball) for name in ("__add__", "__sub__", "__mul__", "__matmul__", "size", "exact"))


EXTREME = np.array(
    [0.0, -0.0, 5e-324, -3e-310, 2.0**-1022, 1e-200, 1.0, -1.0, 1 / 3, 1e200, -1e308, 1.7e308, np.inf, -np.inf, np.nan]
)
STRIDES = ("plain", "transposed", "columns", "every other", "reversed", "repeated", "byte-swapped", "off by a byte")


def numbers(rng, shape, extreme):
    """Random floats, some of them extreme."""
    values = rng.standard_normal(shape) * 10.0 ** rng.integers(-9, 9)
    return np.where(rng.random(shape) < extreme, rng.choice(EXTREME, shape), values)


def with_strides(values, how):
    """The same numbers at other places in memory."""
    if how == "transposed":
        return np.array(values.T, order="C").T
    if how == "columns" and values.ndim:
        return np.repeat(values, 2, axis=-1)[..., ::2]
    if how == "every other" and values.ndim:
        return np.repeat(values, 3, axis=0)[::3]
    if how == "reversed" and values.ndim:
        return np.array(values[..., ::-1])[..., ::-1]
    if how == "repeated" and values.ndim and len(values):
        return as_strided(values, values.shape, (0, *values.strides[1:]))
    if how == "byte-swapped":
        return values.astype(">f8")
    if how == "off by a byte":
        room = np.zeros(values.nbytes + 1, dtype=np.uint8)[1:]
        moved = room.view(np.float64).reshape(values.shape)
        moved[...] = values
        return moved
    return values


def random_pair(rng, shape, extreme=0.0, alike=True):
    """Midpoints and radii with this shape, mostly with the same layout."""
    how = rng.choice(STRIDES[:4] if rng.random() < 0.7 else STRIDES)
    with np.errstate(invalid="ignore"):
        mid, rad = numbers(rng, shape, extreme), np.abs(numbers(rng, shape, extreme)) * rng.choice([0.0, 1e-12, 1.0])
    return with_strides(mid, how), with_strides(rad, how if alike else rng.choice(STRIDES))


def random_shapes(rng):
    """Two shapes that fit together, of up to four axes."""
    shape = [int(n) for n in rng.integers(0 if rng.random() < 0.05 else 1, 5, size=rng.integers(0, 5))]
    if rng.random() < 0.1:  # around the size beyond which numpy has it
        shape = [int(rng.choice([31, 32, 33])), 64]
    one, other = ([1 if rng.random() < 0.2 else n for n in shape] for _ in range(2))
    return tuple(one[rng.integers(0, len(one) + 1) if rng.random() < 0.3 else 0 :]), tuple(
        other[rng.integers(0, len(other) + 1) if rng.random() < 0.3 else 0 :]
    )


def assert_same(found, expected):
    """Bit for bit, signs of zeros too, with the same type and layout; of what is not a number no more than that."""
    assert type(found) is type(expected)
    assert found.shape == expected.shape
    assert found.dtype == expected.dtype
    assert np.array_equal(found, expected, equal_nan=True)
    known = ~np.isnan(expected)
    assert np.array_equal(np.signbit(found)[known], np.signbit(expected)[known])
    if isinstance(expected, np.ndarray) and expected.size > 1:
        assert found.strides == expected.strides


def assert_same_balls(found, expected):
    assert_same(found.mid, expected.mid)
    assert_same(found.rad, expected.rad)


@pytest.mark.parametrize("extreme", [0.0, 0.1, 0.7])
def test_compiled_sums_differences_products_and_sizes_are_those_of_numpy(plain, extreme):
    rng = np.random.default_rng(1)
    for _ in range(800):
        one, other = random_shapes(rng)
        alike = rng.random() < 0.8
        a, b = random_pair(rng, one, extreme, alike), random_pair(rng, other, extreme, alike)
        with np.errstate(all="ignore"):
            for operation in ("__add__", "__sub__", "__mul__"):
                found = getattr(Ball(*a), operation)(Ball(*b))
                assert_same_balls(found, getattr(plain.Ball(*a), operation)(plain.Ball(*b)))
            assert_same(Ball(*a).size, plain.Ball(*a).size)
        assert_same_balls(Ball.exact(a[0]), plain.Ball.exact(a[0]))


def test_layouts_of_results_are_those_of_numpy(plain):
    """Later sums depend on them: every pair of layouts of two axes, and vectors beside them."""
    base = np.arange(1.0, 257.0).reshape(16, 16)
    views = [base[:3, :4], base[:4, :3].T, base[:3:2, :4], base[:3, ::5], base[:6:2, ::4], base[:4, :6:2].T]
    views += [base.T[:3, :4], base[:3, :1], base[:1, :4], base[:1, :4].T[:3, :1], base[0, :4], base[:4, 0]]
    views += [np.float64(3), np.array(3.0)]
    views += [np.broadcast_to(base[0, :4], (3, 4)), np.broadcast_to(base[:3, :1], (3, 4)), np.broadcast_to(3.0, (3, 4))]
    views += [np.array(base[:4, :3]).T[None], np.arange(12.0).reshape(4, 3, 1).transpose(2, 1, 0)]
    fitting = 0
    for a in views:
        for b in views:
            try:
                np.broadcast_shapes(a.shape, b.shape)
            except ValueError:
                continue
            fitting += 1
            for pair in ((a, a), (a, np.array(a))):
                for operation in ("__add__", "__sub__", "__mul__"):
                    expected = getattr(plain.Ball(*pair), operation)(plain.Ball(b, b))
                    assert_same_balls(getattr(Ball(*pair), operation)(Ball(b, b)), expected)
    assert fitting > 250


def exact_product(a, b):
    """The product of matrices of floats in fractions."""
    left, right = (np.vectorize(Fraction, otypes=[object])(np.atleast_1d(x)) for x in (a, b))
    return left @ right


@pytest.mark.parametrize("shapes", [((4, 4), (4, 4)), ((3,), (3, 2)), ((2, 5), (5,)), ((6,), (6,)), ((1, 40), (40, 1))])
def test_products_of_matrices_hold_the_exact_ones(kind, shapes):
    rng = np.random.default_rng(2)
    for trial in range(20):
        (a, a_rad), (b, b_rad) = (random_pair(rng, shape) for shape in shapes)
        if trial % 2:  # nearly nothing is left of the sum
            b = -b if b.ndim < 1 else b * rng.choice([1.0, -1.0, 1e-8], size=b.shape)
        product = kind(a, a_rad) @ kind(b, b_rad)
        assert np.shape(product.mid) == np.shape(product.rad) == np.shape(a @ b)
        # numbers in the balls, ends among them
        for t in (0, 1, -1):
            inside = [
                np.vectorize(Fraction, otypes=[object])(mid) + t * np.vectorize(Fraction, otypes=[object])(rad)
                for mid, rad in ((a, a_rad), (b, b_rad))
            ]
            exact = np.ravel(inside[0] @ inside[1])
            mid, rad = np.ravel(product.mid), np.ravel(product.rad)
            assert all(abs(Fraction(m) - e) <= Fraction(r) for m, r, e in zip(mid, rad, exact, strict=True))


def test_products_of_matrices_agree_with_numpy_around_the_switch(plain):
    rng = np.random.default_rng(3)
    shapes = [(n, k, m) for n in (1, 3, 15, 16, 17) for k in (1, 2, 16, 17) for m in (1, 4, 16)]
    shapes += [(64, 64, 1), (65, 64, 1)]
    for n, k, m in shapes:
        for left, right in (((n, k), (k, m)), ((k,), (k, m)), ((n, k), (k,)), ((2, n, k), (k, m))):
            a, b = random_pair(rng, left), random_pair(rng, right)
            found, expected = Ball(*a) @ Ball(*b), plain.Ball(*a) @ plain.Ball(*b)
            assert np.shape(found.mid) == np.shape(expected.mid)
            assert type(found.mid) is type(expected.mid)
            assert getattr(found.mid, "strides", 0) == getattr(expected.mid, "strides", 0)
            assert np.all(np.abs(found.mid - expected.mid) <= np.minimum(found.rad, expected.rad))
            np.testing.assert_allclose(found.rad, expected.rad, rtol=1e-13)


def test_no_product_of_matrices_looks_better_than_it_is(plain):
    """Where the numpy code bounds nothing, the loops bound nothing either."""
    rng = np.random.default_rng(4)
    with np.errstate(all="ignore"):
        for _ in range(500):
            n, k, m = rng.integers(1, 5, size=3)
            a, b = random_pair(rng, (n, k), 0.3), random_pair(rng, (k, m), 0.3)
            found, expected = Ball(*a) @ Ball(*b), plain.Ball(*a) @ plain.Ball(*b)
            assert np.array_equal(np.isfinite(found.rad), np.isfinite(expected.rad))
            assert np.array_equal(np.isnan(found.rad), np.isnan(expected.rad))
            bounded = np.isfinite(expected.rad)
            np.testing.assert_allclose(found.rad[bounded], expected.rad[bounded], rtol=1e-13)


def test_overflow_and_what_is_no_number_raise_nothing_in_small_balls():
    pytest.importorskip("enumsol.arithmetic._balls")
    huge = Ball(np.array([[1e308, np.inf], [np.nan, 0.0]]), np.array([[1e308, 0.0], [np.inf, np.nan]]))
    with warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("error")
        for result in (huge + huge, huge - huge, huge * huge, huge @ huge):
            assert not np.any(np.isfinite(result.mid) & np.isfinite(result.rad))
        assert not np.any(np.isfinite(huge.size))


def test_what_does_not_fit_is_refused_as_by_numpy(kind):
    one = kind.exact(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="broadcast"):
        one * kind.exact(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="mismatch"):
        one @ kind.exact(np.zeros((2, 3)))
    with pytest.raises(AttributeError):
        one + np.zeros((2, 3))


def test_what_is_no_array_of_doubles_is_left_to_numpy(kind):
    whole = kind.exact(np.arange(4))
    assert whole.rad.dtype == whole.mid.dtype == np.dtype(np.intp)
    long = kind.exact(np.arange(4, dtype=np.longdouble))
    assert (long * long).mid.dtype == np.dtype(np.longdouble)
    assert (whole * whole).mid.dtype == np.dtype(np.intp)
    assert np.array_equal((whole @ whole).mid, 14)
    assert kind.exact([1.0, 2.0]).mid.shape == (2,)
    assert (kind(2.0, 0.0) * kind(np.ones(2), np.zeros(2))).mid.tolist() == [2.0, 2.0]


def test_radii_may_be_of_another_shape(kind):
    found = kind(np.ones((2, 3)), np.zeros(3)) + kind(np.ones(3), np.float64(0.5))
    assert found.mid.shape == found.rad.shape == (2, 3)


def test_balls_are_kept_as_they_are(kind):
    ball = kind(np.arange(6.0).reshape(2, 3), np.full((2, 3), 0.5))
    assert ball.T.shape == (3, 2)
    assert ball[1].mid.tolist() == [3.0, 4.0, 5.0]
    assert (-ball)[0, 1].mid == -1.0
    assert type(ball * ball) is type(ball[0]) is type(ball.T) is type(kind.exact(ball.mid)) is kind
    assert repr(ball[0, 0]) == f"Ball(mid={ball.mid[0, 0]!r}, rad={ball.rad[0, 0]!r})"
    if kind is Ball:
        again = pickle.loads(pickle.dumps(ball))
        assert type(again) is Ball
        assert_same_balls(again, ball)


@pytest.mark.parametrize("size", [1, 3, 12])
def test_the_inverse_of_a_matrix_in_a_ball(size):
    """All inverses are in the ball, and it is hardly wider than that of a system with the unit matrix."""
    rng = np.random.default_rng(size)
    mid = rng.normal(size=(size, size)) + 3 * np.eye(size)
    rad = 1e-9 * rng.random((size, size))
    inverse = Inverse.of(Ball(mid, rad))
    found, solved = inverse.whole(), inverse.solve(Ball.exact(np.eye(size)))
    assert np.all(found.rad <= 1.1 * solved.rad + 1e-14)
    for _ in range(20):
        corner = mid + rad * rng.choice([-1, 1], size=rad.shape)
        exact = fmpq_mat([[fmpq(*x.as_integer_ratio()) for x in row] for row in corner.tolist()])
        parts = (exact.inv().entries(), found.mid.ravel().tolist(), found.rad.ravel().tolist())
        for value, m, r in zip(*parts, strict=True):
            # a corner that was rounded may lie outside by its rounding
            assert abs(value - fmpq(*m.as_integer_ratio())) <= fmpq(*r.as_integer_ratio()) * (1 + fmpq(1, 10**6))
