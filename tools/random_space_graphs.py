"""Random problems in 3D over an interval of alpha: all solutions on whole curves, against searches at single alphas.

    PYTHONPATH=tests/helpers python tools/random_space_graphs.py [--nodes P] [--first SEED] [--last SEED]
        [--alphas N] [--max-nodes N]

Prints for every problem what the tree took, the curves and their boxes, gaps, whether the proof is verified, and at how
many alphas the number of roots or the place of one does not fit. Friction, or load, or both depend on alpha. Where
curves are not proven to be whole, or the tree is stopped, there are gaps, and nothing is compared.
"""

from __future__ import annotations

import argparse
import time
from fractions import Fraction

import numpy as np
from problems3d import random_over_alpha

import enumsol
from enumsol.arithmetic.ball_arrays import Ball
from enumsol.branches.space.cover import SpaceCover
from enumsol.trusted.space.solution_curve import lies_in


def misfits(cover: SpaceCover, alphas: list[float]) -> tuple[int, int]:
    """Roots in all, and how many alphas have another number of them than the curves, or one that is on none."""
    boxes = [box for chain in cover.chains for box in chain.boxes]
    roots = wrong = 0
    for alpha in alphas:
        found = enumsol.enumerate_roots(cover.problem, alpha)
        crossed = 0
        for chain in cover.chains:
            beside = np.array([joint.at(0.0).mid[-1] for joint in chain.joints]) - alpha
            crossed += int(np.sum(beside[1:] * beside[:-1] < 0))
        points = [np.concatenate([root.lambda_n, *root.lambda_t.T, [alpha]]) for root in found]
        on = [any(lies_in(box, Ball(x, 1e-12 * np.abs(x) + 1e-13)) for box in boxes) for x in points]
        roots += len(points)
        wrong += bool(found.complete and (crossed != len(points) or not all(on)))
    return roots, wrong


def main() -> None:
    """Parse the options, then one line a problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("nodes", 2), ("first", 0), ("last", 9), ("alphas", 10), ("max-nodes", 1000)):
        parser.add_argument(f"--{name}", type=int, default=default)
    options = parser.parse_args()
    for seed in range(options.first, options.last + 1):
        start = time.process_time()
        cover = SpaceCover(random_over_alpha(options.nodes, seed), (Fraction(0), Fraction(1)))
        cover.search(options.max_nodes)
        searched = time.process_time()
        report = enumsol.verify(cover.problem, cover.proof())
        checked = time.process_time()
        text = (
            f"p = {options.nodes}, seed {seed}: {cover.nodes} nodes, boxes {[len(c.links) for c in cover.chains]}, "
            f"{cover.failed} curves not whole, {len(cover.gaps)} gaps, verified {report.ok}, "
            f"CPU {searched - start:.1f} s and {checked - searched:.1f} s"
        )
        if not cover.gaps:
            alphas = np.random.default_rng(seed).uniform(0, 1, options.alphas).tolist()
            text += "; {} roots, {} alphas that do not fit".format(*misfits(cover, alphas))
        print(text, flush=True)


if __name__ == "__main__":
    main()
