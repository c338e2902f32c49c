"""What the checkers import and what they share with the search: no more than ``enumsol.checker`` says."""

import ast
import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
from generators import integer_problem, through_the_unloaded_state
from helpers.floating_space import known_body

import enumsol
from enumsol import branch_graph, checker, enumerate_roots, write_problem

ROOT = Path(enumsol.__file__).parent


def inside(room, *modules):
    return [f"enumsol.{room}.{module}" for module in modules]


CHECKERS = inside("checker", "verify", "plane_checker", "graph_checker", "history_checker", "space_graph")
CHECKERS.append("enumsol.checker.stability_checker")
IN_SPACE = {
    *("enumsol.checker.space_checker", "enumsol.condensation.space_condensed", "enumsol.model.sectors"),
    *inside("trusted.space", "sector_margins", "sector_rows", "leaves", "boxed_solution"),
    *inside("trusted.space", "natural_map", "krawczyk", "space_uniqueness", "turning"),
    *inside("trusted.space", "leaf_equations", "force_bound"),
}
#: The search: its rooms, and what it alone uses of rooms that it shares with the checkers.
SEARCH = (
    *("enumsol.arithmetic.algebraic", "enumsol.condensation.exact", "enumsol.model.statuses"),
    *("enumsol.branches", "enumsol.continuation", "enumsol.loading", "enumsol.relaxation", "enumsol.roots"),
    *("enumsol.search", "enumsol.selections", "enumsol.support.workers"),
)
#: What may write a false proof and accept it: of these modules the search uses no more than these names; None: all.
SHARED = {
    "arithmetic.balls": {
        *("Ball", "SAFE", "TINY", "UNIT", "factor_above", "hull", "nearly_singular"),
        *("smaller", "solution", "upper_norm"),
    },
    "arithmetic.rationals": {
        *("as_objects", "is_positive_definite", "rational", "rational_matrix", "simplest", "to_fraction")
    },
    "condensation.data": {"Data", "EXACT_DOF_LIMIT", "ProblemData", "exactly_at"},
    "condensation.dynamic": {"DynamicStiffness", "Pencil"},
    "condensation.enclosure": {
        *("CondensedEnclosure", "EnclosedSystem", "NotEnclosedError", "RigidRows", "enclosure_of", "moved_by_modes")
    },
    "condensation.space_condensed": {"AlphaSpace", "EnclosedSpace", "SpaceSystem"},
    "condensation.unloaded": {"never_loaded", "solved", "vanishing_alpha"},
    "trusted.arcs.only_branch": {"branch_references", "only_roots"},
    "trusted.arcs.selection_balls": None,
    "trusted.exclusion": {"Terms", "exclusion_margin"},
    "trusted.floating_bounds": {"is_unbalanced", "motion_against", "motion_beside", "without_bound"},
    "trusted.arcs.over_parts": None,
    "trusted.over_interval": {"EnclosedPiece", "PieceNumbers"},
    "trusted.arcs.precise": None,
    "trusted.arcs.taylor": {"AlphaFunctions", "ShortExpansion", "ball_of", "precision"},
    "trusted.positions": {"certain_statuses", "tangential_positions"},
    "trusted.reference": {"PlaneReference"},
    "trusted.selection": None,
    "trusted.uniqueness": {*("closed_solution", "numbers_of", "only_solution", "same_solution")},
    "trusted.at_alpha": {"ClosedSolution", "VerifiedSelection", "settled_selection", "solve_selection"},
    "trusted.motions_of_body": {
        *(
            "BodyMotions",
            "Setting",
            "direction",
            "friction_changes",
            "friction_directions",
            "friction_over",
            "reciprocal",
        ),
    },
    "trusted.running_away": None,
    "trusted.quadratic_forms": {"EnclosedForm", "QuadraticForm", "equations_of", "multiplied"},
    "trusted.status_rows": None,
    "trusted.space.sector_margins": {"SlipForm"},
    "trusted.space.sector_rows": None,
    "trusted.space.leaf_equations": {"with_free_bounds"},
    "trusted.space.leaves": None,
    "trusted.space.force_bound": {"unbounded"},
    "trusted.space.turning": {"turned_by"},
    "trusted.space.boxed_solution": {
        *("Box", "BoxedSolution", "BoxProblem", "apart_in_boxes", "is_inside", "solution_in_box")
    },
    "trusted.space.krawczyk": {"Contraction", "NaturalMap", "Step"},
    "trusted.space.solution_curve": None,
    "trusted.space.curve_parts": None,
    "trusted.space.curve_runs": {
        *("CurveChain", "CurveLink", "CurveParts", "LinkRange", "apart", "goes_on", "link_between")
    },
    "trusted.space.pieces": {"AlphaPiece", "LeafArc", "lie_along"},
    "trusted.space.space_uniqueness": {
        *("LeafReference", "LooseSolution", "PieceWeights"),
        *("equations", "how_far_off", "moderate_units"),
    },
    "proof.proof_file": {"PROOF_VERSION", "Proof", "fraction_text", "packed", "coarse"},
    "proof.reading": {"fits", "rational_text"},
    "proof.records": None,
    "proof.stability_records": None,
    "proof.curve_records": None,
    "proof.leaves": None,
    "proof.writer": None,
    "model.sectors": None,
}
#: Rooms of such modules, and the checkers' own, of which the search uses nothing.
TRUSTED = (
    *("enumsol.arithmetic.", "enumsol.checker.", "enumsol.condensation.", "enumsol.trusted.", "enumsol.proof."),
    "enumsol.model.sectors",
)
#: Of these rooms what proves nothing: the data, and S and g as computed.
DATA = {"condensation.condensed", "condensation.factorization"}


def is_search(module):
    return any(module == name or module.startswith(name + ".") for name in SEARCH)


@cache
def path_of(module):
    """The source of a module of enumsol, or None when there is none of that name."""
    path = ROOT.parent.joinpath(*module.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py", path.with_suffix(".pyx")):
        if file.is_file():
            return file
    return None


@cache
def imports_of(module):
    """(module, name) of all imports anywhere in a module's source: in functions and for types only, too."""
    if path_of(module).suffix == ".pyx":
        return set()
    tree = ast.parse(path_of(module).read_text())
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {(alias.name, None) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} imports relatively"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                is_module = inner.startswith("enumsol.") and path_of(inner)
                found.add((inner, None) if is_module else (node.module, alias.name))
    return {(name, what) for name, what in found if name == "enumsol" or name.startswith("enumsol.")}


def closure_of(modules):
    """All modules of enumsol that these import, however indirectly; of the package itself only what is asked of it."""
    found, waiting = set(), list(modules)
    while waiting:
        module = waiting.pop()
        if module in found or module == "enumsol":
            continue
        found.add(module)
        waiting += [name for name, _ in imports_of(module)]
        # importing a module runs the packages that it is in
        waiting.append(module.rpartition(".")[0])
    return found


def test_no_module_of_the_search_is_imported_however_indirectly():
    closure = closure_of(CHECKERS)
    assert closure >= {*CHECKERS, *IN_SPACE, "enumsol.checker.rational"}
    assert not {module for module in closure if is_search(module)}
    # the public names stand in a module that imports for types only
    assert all(what is None for module in closure for name, what in imports_of(module) if name == "enumsol")


def test_the_guard_sees_the_search_where_it_is():
    users = (["enumsol.branches.construction"], ["enumsol.gallery", "enumsol.cli.graph", "enumsol.roots.root_set"])
    assert all(any(map(is_search, closure_of(modules))) for modules in users)
    assert all(map(path_of, SEARCH))


def listed():
    """The page that lists what a proof rests on."""
    return (ROOT.parent / "docs" / "trust.md").read_text(encoding="utf-8")


def test_the_help_fits_a_screen_and_says_how_many_lines_are_trusted():
    text = checker.__doc__
    assert text.count("\n") < 45
    code = "import sys; sys.path.insert(0, 'tools'); import trusted_lines; print(trusted_lines.by_room())"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT.parent)
    rooms = ast.literal_eval(done.stdout)
    said = re.findall(r"([\d,]+) in ``(\w+)``", text)
    assert {room for _, room in said} == rooms.keys() - {"errors"}
    for number, room in said:
        assert abs(int(number.replace(",", "")) - rooms[room]) < 60 + 0.05 * rooms[room], room


def test_what_the_checkers_load_is_listed():
    # whatever they rest on besides their own modules is said in one place
    others = {m for m in closure_of(CHECKERS) if not m.startswith("enumsol.checker")}
    assert others
    for module in others:
        if path_of(module).name == "__init__.py" and not imports_of(module):
            continue  # a room's docstring
        assert f"`{module.removeprefix('enumsol.')}`" in listed()


def test_what_is_listed_exists():
    modules = re.findall(r"`((?:trusted|condensation|arithmetic|proof|model|support|checker)\.[\w.]+)`", listed())
    assert len(modules) > 50
    assert [name for name in modules if not is_there(name)] == []
    assert is_there("trusted.status_rows.children_of")
    assert not is_there("trusted.no_module")


def is_there(name):
    """True for a module, and for a name in a module."""
    inside, _, last = name.rpartition(".")
    place = path_of(f"enumsol.{inside}")
    return path_of(f"enumsol.{name}") is not None or (
        place is not None and place.name != "__init__.py" and last in place.read_text(encoding="utf-8")
    )


def test_what_the_search_uses_of_what_is_trusted_is_listed():
    used = {}
    for file in ROOT.rglob("*.py"):
        module = ".".join(file.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")
        if is_search(module):
            for name, what in imports_of(module):
                part = name.removeprefix("enumsol.")
                if name.startswith(TRUSTED) and not is_search(name) and part not in DATA:
                    used.setdefault(part, set()).add(what)
    for part, names in used.items():
        assert SHARED.get(part, set()) is None or names <= SHARED[part], f"the search uses {names} of {part}"
        assert f"`{part}`" in listed()
    assert set(used) == set(SHARED)


def loaded_for(proofs, folder):
    """The modules that a process has loaded that checked the proofs of these results, each of a problem."""
    for k, (problem, found) in enumerate(proofs):
        write_problem(problem, folder / f"{k}.npz")
        found.proof.save(folder / f"{k}.proof")
    code = (
        "import sys, json, enumsol; from enumsol.checker.verify import verify; "
        "from enumsol.proof.proof_file import Proof; "
        f"reports = [verify(enumsol.read_problem(f'{folder}/{{k}}.npz'), Proof.load(f'{folder}/{{k}}.proof')) "
        f"for k in range({len(proofs)})]; assert all(report.complete for report in reports); "
        "print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_no_module_of_the_search_is_loaded_by_a_verification(tmp_path):
    """Point proofs with and without rational leaves, and a graph's, checked in a process of their own."""
    degenerate = integer_problem(np.random.default_rng(34), 2)
    moving, interval = through_the_unloaded_state()
    plain = enumsol.gallery.one_node_triangle()
    proofs = [(degenerate, enumerate_roots(degenerate, 0.0)), (plain, enumerate_roots(plain, 5.0))]
    proofs += [(moving, branch_graph(moving, interval)), (plain, enumsol.histories(plain, [5, 4]))]
    sliding = enumsol.gallery.block_on_table(1, 1, push=1.0)
    proofs.append((sliding, enumerate_roots(sliding, 0)))
    modules = loaded_for(proofs, tmp_path)
    assert modules >= {*CHECKERS, "enumsol.checker.rational"} - {
        "enumsol.checker.space_graph",
        "enumsol.checker.stability_checker",
    }
    assert not {module for module in modules if is_search(module)}
    assert not modules & IN_SPACE


def test_a_proof_in_space_loads_no_more_than_the_checker(tmp_path):
    problems = enumsol.gallery.block3d(2, 1, 2), known_body(105).problem
    modules = loaded_for([(problem, enumerate_roots(problem, 1.0)) for problem in problems], tmp_path)
    assert modules >= IN_SPACE
    assert not {module for module in modules if is_search(module)}


def test_the_claims_point_at_the_one_place():
    from enumsol.cli import graph

    readme = ROOT.parent / "README.md"
    for text in (graph.verify.__doc__, *([readme.read_text()] if readme.is_file() else [])):
        assert "shares no code" not in text
        assert "enumsol.checker" in text
