"""The layers of the package: which room imports which, which arrows run up, which modules form circles.

    python tools/draw_rooms.py [--tree DIR] [--name NAME] [--picture]

``--tree`` is a checkout (default: this one); ``--name`` writes ``results/NAME.txt``, with ``--picture`` also
``results/NAME.png``. Without a name the text is printed.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

from import_graph import circles, direct_arrows, floors, read_imports, room_arrows, room_of, upward_arrows

HERE = Path(__file__).resolve().parent
PACKAGE = "enumsol"


class Architecture:
    """Rooms, floors, arrows and circles of one checkout."""

    def __init__(self, tree: Path) -> None:
        self.lines, self.imports = read_imports(tree / PACKAGE, PACKAGE)
        self.arrows = room_arrows(self.imports)
        self.up = upward_arrows(self.arrows)
        self.circles = circles((item.importer, item.imported) for item in self.imports)
        self.modules: dict[str, list[str]] = defaultdict(list)
        for module in self.lines:
            self.modules[room_of(module)].append(module)
        self.floors = floors(self.modules, self.arrows)

    def text(self) -> str:
        """Floors from the top down, arrows that run up, circles."""
        out = [
            f"{len(self.lines)} modules in {len(self.modules)} rooms, {sum(self.lines.values())} lines; "
            f"{len(self.imports)} imports make {len(self.arrows)} arrows between rooms",
            f"arrows that run up: {len(self.up)}; circles of modules: {len(self.circles)}"
            + (f" ({', '.join(f'{len(c)} modules' for c in self.circles)})" if self.circles else ""),
            f"longest module: {max(self.lines.values())} lines ({max(self.lines, key=self.lines.__getitem__)})",
            "",
        ]
        for floor in range(max(self.floors.values()), 0, -1):
            for room in sorted(room for room, height in self.floors.items() if height == floor):
                names = [module.partition(f"{PACKAGE}.{room}.")[2] for module in self.modules[room]]
                size = sum(self.lines[module] for module in self.modules[room])
                below = sorted({b for a, b in self.arrows if a == room})
                out.append(f"floor {floor:>2}  {room:<13} {size:>5} lines  {' '.join(name for name in names if name)}")
                out.append(f"          imports  {' '.join(below) or '-'}")
        for a, b in self.up:
            out += ["", f"up: {a} -> {b}"]
            out += [f"    {item.importer}:{item.line} -> {item.imported}" for item in self.arrows[a, b]]
        for circle in self.circles:
            out += ["", f"circle of {len(circle)} modules: {' '.join(circle)}"]
        return "\n".join(out) + "\n"

    def draw(self, file: Path) -> None:
        """Rooms as boxes, one row a floor; arrows up in red, those that follow from longer ways in light grey."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        top = max(self.floors.values())
        rows = {floor: sorted(r for r, f in self.floors.items() if f == floor) for floor in range(1, top + 1)}
        figure = Figure(figsize=(12, 1.0 + 0.8 * top), layout="constrained")
        FigureCanvasAgg(figure)
        axis = figure.subplots()
        place = {
            room: ((k + 1 + 0.12 * (floor % 3 - 1)) / (len(row) + 1), floor)
            for floor, row in rows.items()
            for k, room in enumerate(row)
        }
        needed = direct_arrows(set(self.arrows) - set(self.up))
        for pair in self.arrows:
            start, end = (place[room] for room in pair)
            colour, width, order = ("#c23b4b", 1.8, 3) if pair in self.up else ("#dedede", 0.6, 1)
            if pair in needed:
                colour, width, order = "#555555", 0.9, 2
            style = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 9, "shrinkB": 11}
            axis.annotate("", end, start, arrowprops=style | {"connectionstyle": "arc3,rad=0.08"}, zorder=order)
        for room, (x, y) in place.items():
            size = sum(self.lines[module] for module in self.modules[room])
            box = {"boxstyle": "round,pad=0.35", "facecolor": "#eef3fa", "edgecolor": "#1f5fa8", "linewidth": 0.9}
            name = "__init__" if room == "." else room
            axis.text(x, y, f"{name}\n{size}", ha="center", va="center", fontsize=8, bbox=box, zorder=4)
        axis.set_xlim(0, 1)
        axis.set_ylim(0.4, top + 0.6)
        axis.set_axis_off()
        axis.set_title(
            f"{len(self.lines)} modules, {len(self.arrows)} arrows between rooms, {len(self.up)} of them up; "
            f"{len(self.circles)} circle{'s' if len(self.circles) != 1 else ''} of modules",
            fontsize=10,
        )
        figure.savefig(file, dpi=100)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--tree", type=Path, default=HERE.parent, help="a checkout of the project")
    parser.add_argument("--name", help="write results/NAME.txt and do not print")
    parser.add_argument("--picture", action="store_true", help="draw results/NAME.png too (needs matplotlib)")
    chosen = parser.parse_args(arguments)
    architecture = Architecture(chosen.tree)
    if chosen.name is None:
        print(architecture.text(), end="")
        return
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    (results / f"{chosen.name}.txt").write_text(architecture.text(), encoding="utf-8")
    if chosen.picture:
        architecture.draw(results / f"{chosen.name}.png")


if __name__ == "__main__":
    main()
