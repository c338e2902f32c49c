"""All solutions of a linear complementarity problem by Siconos: ``python by_siconos.py LCP.npz POINTS.npz``.

LCP.npz has M and q of w = M z + q, z >= 0, w >= 0, z'w = 0. Siconos' enumerative solver tries the 2^size bases one
after the other and stops at the first solution; it is called again from the basis behind it until it begins anew. What
was found so far is in POINTS.npz all the while. Imports nothing of enumsol.
"""

from __future__ import annotations

import os
import sys
import time

import numpy as np
import siconos.numerics as sn

given = np.load(sys.argv[1])
size = len(given["q"])
problem = sn.LCP(np.asfortranarray(given["M"]), given["q"])
options = sn.SolverOptions(sn.SICONOS_LCP_ENUM)
options.dparam[sn.SICONOS_DPARAM_TOL] = float(given["tolerance"])

points, basis, ended = [], -1, False
started = time.process_time()
while not ended:
    z, w = np.zeros((2, size))
    options.iparam[sn.SICONOS_LCP_IPARAM_ENUM_SEED] = basis + 1
    failed = sn.lcp_enum(problem, z, w, options)
    before, basis = basis, int(options.iparam[sn.SICONOS_LCP_IPARAM_ENUM_CURRENT_ENUM])
    ended = bool(failed) or basis <= before  # behind the last basis it goes on with the first one
    if not ended:
        points.append(z)
    seconds = time.process_time() - started
    np.savez("part.npz", points=np.reshape(points, (-1, size)), seconds=seconds, ended=ended)
    os.replace("part.npz", sys.argv[2])  # whole whenever this process is killed
