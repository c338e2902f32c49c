"""Where the public names are at home: read by type checkers, and by lazy_loader when a name is first used."""

from . import (
    arithmetic as arithmetic,
    auditing as auditing,
    branches as branches,
    checker as checker,
    collection as collection,
    condensation as condensation,
    continuation as continuation,
    errors as errors,
    fem as fem,
    fixed_points as fixed_points,
    gallery as gallery,
    io as io,
    model as model,
    proof as proof,
    relaxation as relaxation,
    roots as roots,
    search as search,
    selections as selections,
    trusted as trusted,
)
from ._version import __version__ as __version__
from .auditing import audit as audit, compare_result as compare_result, follow_all as follow_all
from .branches import (
    BranchGraph as BranchGraph,
    Span as Span,
    branch_graph as branch_graph,
    link_samples as link_samples,
    multiplicity_table as multiplicity_table,
)
from .checker.reports import VerificationReport as VerificationReport
from .checker.verify import verify as verify
from .continuation import (
    ContinuationOptions as ContinuationOptions,
    NotConverged as NotConverged,
    Path as Path,
    SmoothPath as SmoothPath,
    follow as follow,
    local_branch_test as local_branch_test,
    newton as newton,
)
from .continuation.condensed_equation import PiecewiseSmoothEquation as PiecewiseSmoothEquation
from .errors import (
    EnumsolError as EnumsolError,
    FrictionJumpWarning as FrictionJumpWarning,
    IncompleteGraphError as IncompleteGraphError,
    Interrupted as Interrupted,
    InvalidArgumentError as InvalidArgumentError,
    InvalidProblemError as InvalidProblemError,
    MissingDependencyError as MissingDependencyError,
    NoSuchItemError as NoSuchItemError,
    NotHeldError as NotHeldError,
    OutOfMemoryError as OutOfMemoryError,
    OutputError as OutputError,
    TooLargeError as TooLargeError,
)
from .fem.deck_scenes import DeckModel as DeckModel, read_deck as read_deck
from .fixed_points import (
    FixedPoint as FixedPoint,
    TrescaSolution as TrescaSolution,
    is_fixed_point as is_fixed_point,
    lipschitz_estimate as lipschitz_estimate,
    solve_tresca as solve_tresca,
    successive_approximations as successive_approximations,
)
from .io import read_problem as read_problem, write_problem as write_problem
from .io.calculix import read_results as read_results, write_frd as write_frd, write_start as write_start
from .io.vtu import write_vtu as write_vtu
from .loading.growing import HistoryProgress as HistoryProgress, histories as histories
from .loading.history import History as History
from .loading.maps import MultiplicityMap as MultiplicityMap, multiplicity_map as multiplicity_map
from .loading.steps import LoadStep as LoadStep
from .model.mesh import BodyMesh as BodyMesh
from .model.problem import ContactProblem as ContactProblem
from .model.problem3d import (
    ContactProblem3D as ContactProblem3D,
    FrictionTable as FrictionTable,
    SlipMean as SlipMean,
)
from .model.statuses import ContactStatus as ContactStatus, sign_array as sign_array
from .proof.proof_file import Proof as Proof, ProofFormatError as ProofFormatError
from .report import write_report as write_report
from .roots.enumerate import enumerate_roots as enumerate_roots, is_unique as is_unique
from .roots.rates import Rates as Rates, Way as Way, rates as rates
from .roots.root import Enclosure as Enclosure, Polytope as Polytope, Root as Root, RootFamily as RootFamily
from .roots.root_set import (
    RigidBound as RigidBound,
    RootSet as RootSet,
    SearchStats as SearchStats,
    Undecided as Undecided,
)
from .roots.stability import Stability as Stability, stability as stability
from .search.outcome import SearchProgress as SearchProgress
