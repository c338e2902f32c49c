"""The checkers of proofs, which import nothing of the search.

What a verified proof says
    For the problem's own A, Bn, Bt, f, gap, slip offset and friction, read as exact numbers (or, where the report
    says "S and g as computed", for the condensed data), and for alpha as an exact fraction: the listed roots and
    families solve the problem, and nothing else does. The proof of a branch graph says that every solution for
    every alpha of an interval lies in the surviving selections and, if it holds arcs, what each of them does along
    the interval, except for short intervals that it leaves undecided. The proof of a history says it of every step
    from every start in its ball, and that the ends of all roots are such starts. All this rests on the energy bound
    (theory, (5.2)), on branchings that cover (``trusted.status_rows.children_of``), on the a-priori error bounds of
    IEEE double arithmetic with rounding to nearest in ``arithmetic.balls``, ``condensation.enclosure`` and
    ``trusted``, and on rational arithmetic in ``checker.rational``. Linear algebra kernels may sum in any order and
    fuse multiplications and additions; fast matrix multiplication of Strassen's kind and changed rounding modes are
    excluded.

What checker and search share
    The checkers (``checker.verify``, ``checker.graph_checker``, ``checker.history_checker``, ``checker.space_checker``)
    import nothing of the search, neither its trees and relaxations nor its arcs and results, and
    a test guards that. They are not independent of all that it uses. These serve both, and an error in one of them may
    write a false proof and accept it:

    - ``trusted.status_rows``: the codes, the rows and the branchings that cover, on which writer and reader have to
      agree;
    - ``condensation.products``, ``condensation.enclosure`` and ``arithmetic.balls``: balls for S, g and F, the
      proofs that A and S are positive definite, and linear systems of balls, on small arrays with the compiled
      operations of ``arithmetic._balls`` (where these are missing, with ``arithmetic.plain_pairs``);
    - ``trusted.exclusion``: the exclusion inequality, of which the search has a compiled copy, at one alpha and over
      a piece of an interval (``trusted.over_interval``); ``trusted.energy_bounds``, what multipliers prove;
      ``trusted.quadratic_forms``, other forms than the energy;
    - of bodies that nothing holds: ``model.rigid_modes``, the springs and the bounds; in ``condensation.enclosure``
      balls for G and h; ``trusted.floating_bounds``, what multipliers prove, ``trusted.confinement``, beyond which
      bounds there are no solutions, and ``trusted.joint_roots``, which selections share one root;
    - ``trusted.at_alpha``: the verified solve of a selection and the contradiction of its equations;
      ``trusted.precise_at_alpha``, the same solve with many digits, loaded where double arithmetic does not decide;
    - ``trusted.uniqueness``, the test by which a subtree is closed by its only possible solution, and which of these
      solutions are the same, and the test that a root is alone below an assignment;
      ``trusted.uniqueness_weights``, the form of both; ``trusted.same_roots``, the list of roots without those that
      several leaves hold; of a body that nothing holds ``trusted.reference`` and ``trusted.root_forms``, the test that
      no other root than a known one lies below an assignment;
    - for the arcs of branch graphs: ``trusted.selection``, the numbers of unknowns and conditions;
      ``trusted.arcs.selection_balls``, ``trusted.arcs.series`` and ``trusted.arcs.over_parts``, a selection over an
      interval as a series with bounds of its error; ``trusted.arcs.precise``, ``trusted.arcs.bordered``,
      ``trusted.arcs.taylor`` and ``trusted.arcs.many_digits``, the same with many digits, loaded only where a box asks
      for it;
      ``trusted.arcs.only_branch``, the test by which the roots of arcs are the only solutions over a piece, with the
      form of ``trusted.over_interval``;
    - for problems in 3D, and loaded for their proofs only: ``trusted.space.sector_rows``, the rows and branchings
      and the exclusion inequality; ``trusted.space.slip_forms``, forms other than the energy;
      ``trusted.space.leaves`` and ``trusted.space.turning``, what a complete assignment holds and which leaves
      share a root; ``trusted.space.space_uniqueness``, the test that a whole problem has one solution only;
      ``trusted.space.product_forms``, the ellipsoids of forms of products;
      ``trusted.space.boxed_solution``, the test that a box holds exactly one, and which of these are
      the same, with the derivatives of ``trusted.space.natural_map``; over an interval of alpha
      ``trusted.space.solution_curve``, the test that a box holds one curve of solutions,
      ``trusted.space.curve_chains``, that boxes hold one curve, ``trusted.space.pieces``, what holds over a
      piece of alpha, ``trusted.space.leaf_arcs``, that the solutions of an assignment there are one arc,
      ``trusted.space.curve_runs``, bounds of a curve there, and ``trusted.space.piece_forms``, the test that it has
      all solutions with some statuses; ``trusted.space.curve_parts``, into which arcs a curve is cut, with the
      derivatives of ``trusted.space.curve_events``;
      ``model.sectors``, the ends of sectors; ``condensation.space_condensed``, balls for S and g in the
      variables in which friction is isotropic; of bodies that nothing holds the same with G and h,
      ``trusted.space.resultants``, what multipliers and balance prove, and ``trusted.space.space_reference`` with
      ``trusted.root_forms``, that no other root than a known one lies below an assignment; ``model.problem3d``
      and ``model.friction``, the data and their checks;
    - for histories: ``trusted.positions``, where a root leaves the contact nodes, in 3D by its leaf
      ``trusted.space.leaf_positions``; ``model.restart``, the problem of a step;
    - ``condensation.unloaded`` and ``condensation.free_displacements``: the alpha at which g vanishes, and for the
      search whether it does at all (then there is no proof), and the solution of A X = K in rationals;
      ``condensation.data``: F(alpha) and f(alpha) without rounding; of ``arithmetic.rationals`` the pivots of a
      definite matrix, and floats as rationals (that the search cuts intervals at simple numbers proves nothing);
    - ``proof.proof_file`` and of ``proof.reading`` what a fraction in a proof may be: the file;
    - ``proof.records`` and, for graphs in 3D, ``proof.curve_records``: what a record of each kind may say, and in which
      trees its theorem holds (``proof.leaves``); ``proof.declared_forms``, what leaves refer to. The search writes
      records by these classes, the checkers read them by the same ones, strictly, and so does a search that resumes
      from an earlier proof. It takes what ``proof.begun`` finds, and proves it again before ``proof.writer`` writes it.
      What a record makes of a leaf is not in these classes: a checker tests it;
    - ``model.problem``, ``model.mesh``, ``model.cells``, ``model.contact_body``, ``condensation.data``,
      ``condensation.condensed``, ``condensation.factorization``, ``support.deadlines``, ``support.immutable``,
      ``support.arguments``, ``support.array_arguments``, ``support.array_types``, ``support.files``,
      ``support.saved``, ``support.messages`` and ``errors``: the data, their checks and their fingerprint, the
      factorization of A (no bound assumes that it is accurate), S and g as computed;
    - numpy, scipy and python-flint.

    They are shared because the two must agree. A leaf is written when its inequality is proven positive, and a second
    set of bounds, right but not the same, would refuse true proofs near a degeneracy; whether a number is zero has to
    be decided alike. What is shared knows nothing of a search, and the tests hold it against rational arithmetic that
    uses none of it. The checker's own are what a search gets wrong: the order of the file's records, that the leaves
    cover all selections and the pieces the interval, which leaf or part of an arc proves what, which events are the
    same point, the counts, the joining of root sets, and for degenerate leaves the condensation and the root sets in
    rationals.

What counts as one root
    A root at which every condition holds strictly solves one selection only, and so two such roots of two leaves are
    two. Roots on the border of several selections are decided in rationals and joined where they meet, as are the
    polytopes of a family; none of them can meet a strict root.

    A root that closes a subtree is the only one with the statuses of its fixed nodes, which hold strictly. Two such
    roots are one if one of them surely has the statuses of the other one's fixed nodes, and two if some node has no
    status that both may have; so with roots of single selections. Where neither is so, one more part counts as
    undecided.

    In 3D a root that slips along the common end of two sectors is found in both. Roots of leaves with the same statuses
    are one if the directions of one lie in the box of angles in which the other is proven to be the only one, and two
    if their forces differ for certain. Where neither is proven, one more part counts as undecided. Roots that are the
    only ones in boxes are one if the box of one surely holds the other; so with roots of leaves. A root that
    closes the whole tree is the only solution, whatever statuses hold there.

    Of a root that several leaves hold, every leaf encloses the end; a history has to go on from one of these enclosures
    (theory, section 13.3).

Cross-checks
    They use nothing of the proof and are printed with the result. The indices of all roots and families add up to +1,
    the degree of the problem without friction: ``RootSet.index_sum``. Where all roots are regular, their number is odd.

    - Complete and +1: as it must be.
    - None and not whole: the sum is not known. What was left undecided, or was not reached, holds roots whose indices
      bring the sum to +1; a sum of +1 so far proves nothing, since roots may be missing in pairs.
    - None otherwise: the index of a degenerate root or family could not be found within the limits of the local
      analysis (very many selections hold there). The count of roots does not depend on it.
    - Complete, and another sum or an even number of regular roots: a contradiction, unless nothing holds the body
      (theory, section 14.2). Either the program or the machine
      is wrong; please report it with the problem and the proof.
"""
