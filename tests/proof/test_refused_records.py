"""What the entries of a record may not be, each refused with a reason of its own."""

import base64
import json
import re
from fractions import Fraction

import numpy as np
import pytest
from refusals import bad_argument

from enumsol.model.statuses import CONTACT, FORWARD, OPEN, SLIP_PLUS, STICK, UNDECIDED
from enumsol.proof import curve_records, leaves, reading, records
from enumsol.proof.leaves import leaves_of
from enumsol.proof.records import Limits


def texts(rows, values):
    """Multipliers as two texts."""
    return [
        base64.b64encode(np.array(part, dtype).tobytes()).decode() for part, dtype in ((rows, "<u4"), (values, "<f8"))
    ]


FORM = ["q", [6, 6], [1.0, 2.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0], [1.5]]
DECLARED = records.DeclaredForm.read(FORM, Limits((UNDECIDED,) * 2))
IN_CONTACT = records.DeclaredForm.read(["q", [6, 5], *FORM[2:]], Limits((UNDECIDED,) * 2))
LIMITS = Limits((UNDECIDED, STICK), friction=[True, True], declared=[DECLARED, IN_CONTACT])
#: One weight for every free node, and four more where it has friction.
WEIGHTS = [1.0] * 5


@pytest.mark.parametrize(
    ("kind", "entries", "why"),
    [
        (leaves.Excluded, [1, ""], "its multipliers are not two texts"),
        (leaves.Excluded, texts([0, 1], [1.0]), "2 rows and 1 multipliers"),
        (leaves.Excluded, texts([0] * 15, [1.0] * 15), "it has 15 multipliers, and there are 14 rows"),
        (leaves.Excluded, texts([14], [1.0]), "row 14 does not exist; there are 14"),
        (leaves.Excluded, texts([0], [np.inf]), "a multiplier is not finite"),
        (records.DeclaredForm, [[6], *FORM[2:]], "a form cannot be read: its codes are not a list of 2 codes"),
        (records.DeclaredForm, [[6, "6"], *FORM[2:]], "a form cannot be read: its codes are not a list of 2 codes"),
        (records.DeclaredForm, [[6, 7], *FORM[2:]], "a form cannot be read: a status code is not among 0 to 6"),
        (records.DeclaredForm, [*FORM[1:3], [float("inf")]], "a form cannot be read: a number is not finite"),
        (records.DeclaredForm, [*FORM[1:3], [-1.0]], "a multiplier of a form is negative"),
        (
            records.DeclaredForm,
            [FORM[1], [*FORM[2][:4], -0.5, 0.0, 0.0, 0.0], FORM[3]],
            "a multiplier of a form is negative",
        ),
        (leaves.Excluded, [*texts([0], [1.0]), 3], "its form was not declared"),
        (leaves.Excluded, [*texts([0], [1.0]), 0], "its form was not declared"),
        (leaves.Excluded, [*texts([0], [1.0]), True], "its form was not declared"),
        (leaves.Closed, [[OPEN], [0], WEIGHTS, [0.0] * 4], "its selection is not a list of 2 codes"),
        (leaves.Closed, [[OPEN, 9], [0], WEIGHTS, [0.0] * 4], "a node cannot have the code"),
        (leaves.Closed, [[FORWARD, STICK], [0], WEIGHTS, [0.0] * 4], "a node cannot have the code"),
        (leaves.Closed, [[OPEN, STICK], [2], WEIGHTS, [0.0] * 4], "its free nodes are not a list of nodes"),
        (leaves.Closed, [[OPEN, STICK], [1, 0], WEIGHTS, [0.0] * 4], "its free nodes are not ascending"),
        (leaves.Closed, [[OPEN, STICK], [0], WEIGHTS[1:], [0.0] * 4], "expected 5 numbers"),
        (leaves.Closed, [[OPEN, OPEN], [0], WEIGHTS, [0.0] * 4], "a node that has a status in its proof has another"),
        (leaves.Closed, [[OPEN, SLIP_PLUS], [0], WEIGHTS, 1], "its selection does not lie below its assignment"),
        (leaves.Closed, [[OPEN, STICK], [], WEIGHTS, 1], "its free nodes are not those of its assignment"),
        (leaves.NoRoot, ["exactly"], "a root or a solved selection is claimed where statuses are still open"),
    ],
)
def test_what_an_entry_may_not_be(kind, entries, why):
    with pytest.raises(ValueError, match=re.escape(why)):
        kind.read([kind.kind, *entries], LIMITS)


@pytest.mark.parametrize(("point", "why"), [(["1/1"] * 3, "points of 4 fractions"), (["1/1"] * 3 + [1], "not a text")])
def test_what_a_point_may_not_be(point, why):
    final = Limits((OPEN, STICK), friction=[True, True])
    with pytest.raises(ValueError, match=why):
        leaves.RootSetRecord.read(["D", [["1/1"] * 4, point], 1], final)


def test_a_form_serves_what_is_below_its_assignment():
    """The second form before was declared where all is undecided, the last one where a node is in contact."""
    entries = texts([0], [1.0])
    assert leaves.Excluded.read(["x", *entries, 2], LIMITS).by == 2
    assert leaves.Excluded.read(["x", *entries, 1], LIMITS).by == 1
    above = Limits((UNDECIDED, UNDECIDED), friction=[True, True], declared=[DECLARED, IN_CONTACT])
    with pytest.raises(ValueError, match="its form was made for another assignment"):
        leaves.Excluded.read(["x", *entries, 1], above)
    below = Limits((UNDECIDED, CONTACT), friction=[True, True], declared=[DECLARED, IN_CONTACT])
    assert leaves.Excluded.read(["x", *entries, 1], below).terms.values.tolist() == [1.0]


def test_forms_that_say_the_same():
    again = records.DeclaredForm.read(json.loads(json.dumps(DECLARED.write())), Limits((UNDECIDED,) * 2))
    assert again.same(DECLARED)
    assert not IN_CONTACT.same(DECLARED)
    assert not records.DeclaredForm.read([*FORM[:2], [*FORM[2][:6], 0.0, 1.0], [1.5]], Limits((UNDECIDED,) * 2)).same(
        DECLARED
    )


def test_no_two_kinds_begin_alike():
    """Whatever has a letter has it alone, in all trees."""
    kinds = [kind for tree in records.Tree for kind in {*leaves_of(tree).values()}]
    others = [records.Branching, records.DeclaredForm, records.CutPiece]
    every = {*kinds, *others}
    assert len({curve_records.BOX, *(kind.kind for kind in every)}) == len(every) + 1 == 19


@pytest.mark.parametrize("kind", [leaves.Closed, leaves.Alone, leaves.BoxedRoot, leaves.Unloaded])
def test_what_rests_on_a_definite_stiffness_is_no_leaf_of_other_bodies(kind):
    assert all(kind not in leaves_of(tree).values() for tree in records.Tree.FLOATING)
    assert any(kind in leaves_of(tree).values() for tree in records.Tree.HELD)


@pytest.mark.parametrize("by", [1, leaves.RATIONAL])
@pytest.mark.parametrize("tree", [*records.Tree.FLOATING, records.Tree.PIECE])
def test_only_bodies_that_are_held_have_exclusions_by_other_forms(tree, by):
    limits = Limits((UNDECIDED, STICK), tree, [True, True], [DECLARED, IN_CONTACT], modes=1)
    with pytest.raises(ValueError, match=r"its form was not declared|it cannot be tested in rational arithmetic"):
        leaves.Excluded.read(["x", *texts([0], [1.0]), by], limits)


def test_a_proof_holds_no_longer_fractions():
    last = Fraction(10**reading.MOST_DIGITS - 1, 10 ** (reading.MOST_DIGITS - 1))
    assert reading.rational_from(reading.rational_text(last, "alpha")) == last
    bad_argument("alpha is a fraction of more than 4000 digits", reading.rational_text, last + 1, "alpha")
