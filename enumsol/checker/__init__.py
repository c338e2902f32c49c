"""The checker of proofs, which imports nothing of the search; what both rest on is `enumsol.kernel` and below.

What a verified proof says
    For the problem's own A, Bn, Bt, f, gap, slip offset and friction, read as exact numbers (or, where the report says
    "S and g as computed", for the condensed data), and for alpha as an exact fraction: the listed roots and families
    solve the problem, and nothing else does. It rests on the energy bound (theory, (5.2)), on branchings that cover
    (``kernel.rows.children_of``), on the a-priori error bounds of IEEE double arithmetic with rounding to nearest in
    ``arithmetic.balls``, ``condensation.enclosure`` and ``kernel``, and on rational arithmetic in ``checker.rational``
    and ``checker.hull``. Linear algebra kernels may sum in any order and fuse multiplications and additions; fast
    matrix multiplication of Strassen's kind and changed rounding modes are excluded.

What counts as one root
    A root at which every condition holds strictly solves one selection only, and so two such roots of two leaves are
    two. Roots on the border of several selections are decided in rationals and joined where they meet, as are the
    polytopes of a family; none of them can meet a strict root.

Cross-checks
    They use nothing of the proof and are printed with the result. The indices of all roots and families add up to +1,
    the degree of the problem without friction: ``RootSet.index_sum``. Where all roots are regular, their number is odd.

    - Complete and +1: what has to be.
    - Incomplete and another sum: what was left undecided, or was not reached, holds roots whose indices make up the
      difference; at least as many as the difference is large, if all of them are regular.
    - Incomplete and +1: says nothing; roots may be missing in pairs of opposite indices.
    - None: the index of a degenerate root or family could not be found within the limits of the local analysis
      (very many selections hold there). The count of roots does not depend on it.
    - Complete, and another sum or an even number of regular roots: a contradiction. Either the program or the machine
      is wrong; please report it with the problem and the proof.

How far the data may change before the list of roots does: ``checker.stability.stability_radius``.
"""
