"""The checkers of proofs, which import nothing of the search.

What a verified proof says
    For the problem's own A, Bn, Bt, f, gap, slip offset and friction, read as exact numbers (or, where the report says
    "S and g as computed", for the condensed data), and for alpha as an exact fraction: the listed roots and families
    solve the problem, and nothing else does. The proof of a branch graph says it of every alpha of an interval, but
    for short intervals that it leaves undecided, and that of a history of every step from every start in its ball. One
    of stability says which roots run away, with the mass as given.

What it rests on
    The energy bound (theory, (5.2)), branchings that cover, a-priori error bounds of IEEE double arithmetic with
    rounding to nearest, and rational arithmetic. In lines of code, beside numpy, scipy and python-flint:

    - 6,900 in ``trusted``: the tests of leaves, of which the search calls the same ones before it writes a leaf;
    - 2,600 in ``checker``: reading, counting, joining of roots, and rational leaves in arithmetic of its own, for the
      checker alone;
    - 1,200 in ``condensation``: S, g and F as balls or rationals, proven from the data;
    - 1,400 in ``model``: the data, their checks and their fingerprint;
    - 1,000 in ``proof`` and 900 in ``support``: files and records, read within bounds; messages and limits;
    - 700 in ``arithmetic``: balls and rationals.

    Some two thirds of it serve graphs, 3D or bodies that nothing holds, and are loaded for their proofs only.

What checker and search share
    Tests of leaves and balls of the data: the two must agree near a degeneracy, and so an error in one of these may
    write a false proof and accept it. What is shared knows nothing of a search, and the tests of the package hold it
    against rational arithmetic and judges that use none of it. Kernels of linear algebra may sum in any order and fuse
    multiplications and additions; Strassen's fast matrix multiplication and changed rounding modes are excluded.

docs/trust.md has the list of all modules, what counts as one root, and cross-checks of a result.
"""
