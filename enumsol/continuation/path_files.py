"""Files of paths: arrays and a JSON text in one .npz."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enumsol.continuation.continuation_options import ContinuationOptions
from enumsol.continuation.path_data import ARRAYS, RIGID, PathData, PathStats, PathStatus, PointKind, Transition
from enumsol.model.statuses import ContactStatus
from enumsol.roots.local_branch import LocalBranchTest
from enumsol.support.arguments import file_path
from enumsol.support.files import read_arrays, reading, write_arrays

if TYPE_CHECKING:
    import os

_FORMAT = 1
_Path = TypeVar("_Path", bound=PathData)


def save_path(followed: PathData, path: str | os.PathLike[str]) -> None:
    """Write the path to a .npz file; the problem and the callables of a smooth path are not in it."""
    report = {
        "kinds": followed.kinds,
        "transitions": [_pack(item) for item in followed.transitions],
        "status": followed.status,
        "message": followed.message,
        "orientation": followed.orientation,
        "interval": followed.interval,
        "options": followed.options.to_dict(),
        "next_step": followed.next_step,
        "stats": followed.stats.__dict__,
        "node_ids": followed.node_ids,
        "names": [[status.value for status in point.statuses] for point in followed],
    }
    if followed.rigid_coordinates is not None:
        report[RIGID] = followed.rigid_coordinates.tolist()
    write_arrays(file_path(path, "path"), _FORMAT, report, {name: getattr(followed, name) for name in ARRAYS})


def load_path(kind: type[_Path], file: str | os.PathLike[str]) -> _Path:
    """Read a path as an object of that class; see Path.load."""
    place = file_path(file, "path")
    with reading(place, "a path", "Path.save"):
        return _unpacked(kind, *read_arrays(place, _FORMAT, ARRAYS))


def _unpacked(kind: type[_Path], report: dict[str, Any], arrays: dict[str, Any]) -> _Path:
    low, high = report["interval"]
    return kind(
        **arrays,
        kinds=tuple(PointKind(kind) for kind in report["kinds"]),
        transitions=tuple(_unpack(item) for item in report["transitions"]),
        status=PathStatus(report["status"]),
        message=report["message"],
        orientation=report["orientation"],
        interval=(float(low), float(high)),
        options=ContinuationOptions.from_dict(report["options"]),
        next_step=report["next_step"],
        stats=PathStats(**report["stats"]),
        node_ids=tuple(report["node_ids"]),
        _names=tuple(tuple(ContactStatus(value) for value in names) for names in report["names"]),
        rigid_coordinates=np.array(report[RIGID]) if RIGID in report else None,
    )


def _pack(item: Transition) -> dict[str, Any]:
    test = item.local_test
    packed = None
    if test is not None:
        signs = [[[s.value for s in statuses], sign] for statuses, sign in test.signs]
        packed = {"exists": test.exists, "premise": test.premise, "signs": signs}
    return {
        "point": item.point,
        "alpha": item.alpha,
        "before": [s.value for s in item.before],
        "after": [s.value for s in item.after],
        "nodes": item.nodes,
        "dalpha": [item.dalpha_before, item.dalpha_after],
        "local_test": packed,
    }


def _unpack(data: dict[str, Any]) -> Transition:
    test, packed = None, data["local_test"]
    if packed is not None:
        signs = tuple((tuple(ContactStatus(s) for s in statuses), sign) for statuses, sign in packed["signs"])
        test = LocalBranchTest.from_signs(signs, premise=packed["premise"])
    left, right = data["dalpha"]
    before, after = (tuple(ContactStatus(s) for s in data[name]) for name in ("before", "after"))
    return Transition(
        data["point"], data["alpha"], before, after, tuple(data["nodes"]), float(left), float(right), test
    )
