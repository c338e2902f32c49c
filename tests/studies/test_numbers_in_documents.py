"""Numbers of measurements in the documents are those of the studies' results: they cannot go stale."""

import re

import pandas as pd
import pytest
from documents import ROOT


def table(name):
    """A table of results; ``STUDY`` alone stands for its table of that name."""
    study, _, rest = name.partition("/")
    return pd.read_csv(ROOT / "studies" / study / "results" / f"{rest or study}.csv", dtype=str)


def notes(study, name=None):
    return (ROOT / "studies" / study / "results" / f"{name or study}.txt").read_text(encoding="utf-8")


def numbers(column):
    return pd.to_numeric(column)


def where(name, column, **values):
    """Numbers of a column, in rows with these values."""
    found = table(name)
    for key, value in values.items():
        found = found[found[key.replace("_", " ")] == value]
    assert len(found)
    return numbers(found[column])


def unwatched_workers():
    """Time of two workers of Dask that do not sample their stacks, as a share of that of others."""
    unwatched, watched = (where("workers", "seconds", p="64", kind=kind) for kind in ("dask, unwatched", "dask"))
    return unwatched.item() / watched.item()


def rounded(values, digits=2):
    """The least and the largest, to so many digits."""
    return tuple(float(f"{value:.{digits}g}") for value in (min(values), max(values)))


def largest_of(*names, column="any"):
    return numbers(table("one_certificate/largest").set_index("series").loc[list(names), column])


def certified(shape):
    """Problems that one certificate decides, in less than a second: the largest p, the least and the largest F."""
    found = table("one_certificate")
    found = found[found["problem"].str.startswith(shape) & (found["certificate"] == "yes")]
    most = numbers(found["p"]).max()
    found = found[numbers(found["p"]) == most]
    assert max(numbers(found["seconds"])) < 1
    return (most, *rounded(numbers(found["F"])))


def tree_of_a_block(cells):
    (found,) = table("one_certificate").query(f"problem == '3D block {cells}' and F == '0.3'")["tree nodes"]
    return (float(found.removeprefix("> ")),)


def nodes_of_discs(count):
    return where("discs", "nodes", unequal="weights", contacts="stiff", discs=str(count))


def feet_in_3d(column):
    """Of those that take a tree and were finished, the least and the largest."""
    found = table("search_in_3d/feet")
    return rounded(numbers(found[(found["complete"] == "True") & (numbers(found["nodes"]) > 1)][column]))


def measured(setting, column):
    return tuple(where("accuracy_vs_speed", column, setting=setting))


def wrong_near_a_degeneracy(nearer):
    """Per cent of the answers of fast arithmetic."""
    found = table("accuracy_vs_speed/accuracy_enumeration")
    distance = numbers(found["distance"])
    found = found[(found["setting"] == "fast 1e-09") & (distance > 0) & (distance < nearer)]
    return (round(100 * numbers(found["wrong"]).sum() / numbers(found["problems"]).sum()),)


def times_of_exact(*p):
    found = dict(re.findall(r"p = (\d+): ([\d.]+)", notes("accuracy_vs_speed")))
    return tuple(float(f"{float(found[size]):.3g}") for size in p)


def decided_from(*kinds):
    (line,) = re.findall("leaves nothing open from a distance of (.*)", notes("accuracy_vs_speed"))
    found = {kind: float(distance) for distance, kind in re.findall(r"([\d.e-]+) \((\w+)\)", line)}
    return tuple(found[kind] for kind in kinds)


def samples_that_cost_as_much():
    """The least number of samples tried that costs as much as a proven graph, and what 100 miss of its vertices."""
    found = table("samples_vs_graph/accuracy_sampling")
    found = found[found["method"] == "samples"]
    missed = where("samples_vs_graph/accuracy_sampling", "transitions missed %", method="samples", samples="100")
    return numbers(found[numbers(found["time ratio"]) > 1]["samples"]).min(), round(missed.item())


def jumps_as_printed():
    found = where("continuation_steps/accuracy_continuation", "jumps", varied="h_max", steps="as printed")
    (problems,) = re.findall(r"(\d+) problems", notes("continuation_steps", "accuracy_continuation"))
    return (*rounded(found), float(problems))


def many_loads(n):
    values = (where("condensation_cost/loads", column, n=str(n)).item() for column in ("n", "p", "ratio"))
    return tuple(float(f"{value:.2g}") if value < 10 else value for value in values)


def wedges_in_3d(p, column):
    return rounded(where("search_in_3d/wedges", column, p=p))


def seconds_of_wedges_in_3d(p):
    return rounded(where("search_in_3d/wedges", "search s", p=p).round())


#: Where a page says so: a sentence, with a place for each of its numbers, and what they are.
CLAIMS = [
    ("arithmetic", r"p = (\d+) in 2D and F from ([\d.]+) to ([\d.]+)", lambda: certified("256x")),
    ("arithmetic", r"p = (\d+) in 3D and F from ([\d.]+) to ([\d.]+)", lambda: certified("3D block")),
    ("arithmetic", r"up to F = (\d+), the largest value tried", lambda: rounded(largest_of("block pressed"))[:1]),
    ("arithmetic", r"F = ([\d.]+) to ([\d.]+) for blocks that are dr", lambda: rounded(largest_of("block dragged"))),
    ("arithmetic", r"up to F = ([\d.]+) to ([\d.]+) for wedges", lambda: rounded(largest_of("wedge", "3D wedge"))),
    (
        "arithmetic",
        r"Wedges take ([\d,]+) to ([\d,]+) nodes of the tree at p = 32",
        lambda: rounded(where("one_certificate/cost", "tree nodes", p="32"), 1),
    ),
    ("arithmetic", r"([\d,]+) at p = 48", lambda: rounded(where("workers", "nodes", p="48"))[1:]),
    ("arithmetic", r"([\d,]+) in \d+ s at p = 64", lambda: rounded(where("workers", "nodes", p="64"), 3)[1:]),
    ("arithmetic", r"in (\d+) s at p = 64", lambda: rounded(where("workers", "seconds", p="64", kind="none"), 2)[:1]),
    ("command_line", r"two of them took ([\d.]+) of the time", lambda: rounded([unwatched_workers()])[:1]),
    ("arithmetic", r"12 discs take (\d+) nodes", lambda: rounded(nodes_of_discs(12), 3)[1:]),
    ("arithmetic", r"20 discs (\d+) to (\d+)", lambda: rounded(nodes_of_discs(20), 3)),
    ("arithmetic", r"at F = 0.3 takes ([\d,]+) nodes of the tree with p = 12", lambda: tree_of_a_block("4x2x2")),
    ("arithmetic", r"more than ([\d,]+), where the study stops, with p = 30", lambda: tree_of_a_block("5x5x2")),
    ("arithmetic", r"take ([\d,]+) to ([\d,]+) nodes of the tree and \d+ to", lambda: wedges_in_3d("8", "nodes")),
    ("arithmetic", r"(\d+) to (\d+) s with eight", lambda: seconds_of_wedges_in_3d("8")),
    ("arithmetic", r"([\d,]+) to ([\d,]+) nodes and \d+ to \d+ s with twelve", lambda: wedges_in_3d("12", "nodes")),
    ("arithmetic", r"(\d+) to (\d+) s with twelve", lambda: seconds_of_wedges_in_3d("12")),
    (
        "arithmetic",
        r"with (\d+) to (\d+) contact nodes they take ([\d,]+) to ([\d,]+) nodes of the tree where no certificate",
        lambda: feet_in_3d("p") + feet_in_3d("nodes"),
    ),
    (
        "arithmetic",
        r"([\d,]+) small problems with known answers",
        lambda: (where("accuracy_vs_speed/accuracy_enumeration", "problems", setting="verified").sum(),),
    ),
    (
        "arithmetic",
        r"takes ([\d.]+) times the time of `.fast.` \|",
        lambda: rounded(measured("verified", "time ratio"))[1:],
    ),
    ("arithmetic", r"never wrong farther than ([\d.e-]+) from", lambda: measured("fast 1e-09", "right from")),
    ("arithmetic", r"nearer than 1e-10 (\d+) % of the answers are wrong", lambda: wrong_near_a_degeneracy(1e-10)),
    ("arithmetic", r"at distances from ([\d.e-]+) on", lambda: measured("fast 1e-13", "right from")),
    (
        "arithmetic",
        r"answers are wrong nearer than ([\d.e-]+) \|",
        lambda: measured("float32, fast 1e-09", "right from"),
    ),
    (
        "arithmetic",
        r"nearer than (\S+) to folds, (\S+) to transitions, (\S+) to continua and (\S+) to bifurcations",
        lambda: decided_from("fold", "transition", "family", "bifurcation"),
    ),
    (
        "arithmetic",
        r"takes ([\d.]+) times the time of `.fast.` at p = 1, (\S+) times at p = 4, and (\d+) times at p = 8",
        lambda: times_of_exact("1", "4", "8"),
    ),
    ("arithmetic", r"less than (\d+) samples, and 100 samples miss (\d+) %", samples_that_cost_as_much),
    ("arithmetic", r"made (\d+) to (\d+) jumps on (\d+) problems", jumps_as_printed),
    (
        "results",
        r"took ([\d.]+) to ([\d.]+) of the time of the search",
        lambda: rounded(numbers(table("certification_cost")["check / verified"])),
    ),
    (
        "from_a_mesh",
        r"body with ([\d,]+) degrees of freedom and (\d+) contact nodes, ten loads take ([\d.]+) times as long",
        lambda: many_loads(51520),
    ),
    (
        "histories",
        r"falls from ([\d.]+) to ([\d.]+) per cent",
        lambda: rounded(numbers(table("histories/fretting")["largest error %"]))[::-1],
    ),
    (
        "histories",
        r"takes (\d+) s of one core",
        lambda: (round(where("histories/maps", "CPU seconds", map="block").item()),),
    ),
    (
        "histories",
        r"([\d,]+) random histories of four",
        lambda: re.findall(r"(\d+) histories, 0", notes("histories", "random")),
    ),
    (
        "tutorial",
        r"jams from a coefficient of ([\d.]+) to ([\d.]+) on",
        lambda: rounded(numbers(table("jamming_wedge")["3 from"]), 3),
    ),
]
#: Paragraphs that name a study without a number of its results; theory.md has no numbers of measurements at all.
WITHOUT_NUMBERS = {
    ("architecture.md", "branching_rule"),
    ("three_dimensions.md", "fixed_points_basins"),
    ("architecture.md", "search_in_3d_choices"),
    ("README.md", "peers"),
    ("README.md", "same_body_by_other_codes"),
    ("arithmetic.md", "extremes"),
    ("from_a_mesh.md", "same_body_by_other_codes"),
    ("from_a_deck.md", "against_calculix"),
}


def read(path):
    return " ".join(path.read_text(encoding="utf-8").split())


@pytest.mark.parametrize(
    ("page", "pattern", "expected"), CLAIMS, ids=[f"{page}: {text[:40]}" for page, text, _ in CLAIMS]
)
def test_numbers_are_those_of_the_results(page, pattern, expected):
    (found,) = re.finditer(pattern, read(ROOT / "docs" / f"{page}.md"))
    assert tuple(float(number.replace(",", "")) for number in found.groups()) == tuple(map(float, expected()))


@pytest.mark.parametrize(
    "path",
    [ROOT / "README.md", *sorted({*(ROOT / "docs").glob("*.md")} - {ROOT / "docs" / "theory.md"})],
    ids=lambda path: path.name,
)
def test_paragraphs_that_name_a_study_give_its_numbers(path):
    ours = [pattern for page, pattern, _ in CLAIMS if page == path.stem]
    for paragraph in re.split(r"\n\s*\n|\n(?=- )", path.read_text(encoding="utf-8")):
        text = " ".join(paragraph.split())
        for name in re.findall(r"\bstudies/(?!README)(\w+)", re.sub(r"!\[.*?\]\(.*?\)", "", text)):
            assert (ROOT / "studies" / name).is_dir(), (path.name, name)
            assert (path.name, name) in WITHOUT_NUMBERS or any(re.search(p, text) for p in ours), (path.name, text)


def test_results_that_the_documents_name_are_there():
    for path in (*(ROOT / "docs").glob("*.md"), ROOT / "README.md"):
        for name in re.findall(r"`(studies/[\w/]+\.csv)`", path.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), (path, name)
