"""Files of paths: arrays and a JSON text in one .npz."""

from __future__ import annotations

import json
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checks import file_path
from enumsol.continuation.options import ContinuationOptions
from enumsol.continuation.path_data import ARRAYS, PathData, PathStats, PathStatus, PointKind, Transition
from enumsol.errors import InvalidArgumentError
from enumsol.files import writing
from enumsol.roots.local_branch import LocalBranchTest
from enumsol.statuses import ContactStatus

if TYPE_CHECKING:
    import os

_FORMAT = 1


def save_path(path: PathData, file: str | os.PathLike[str]) -> None:
    """Write a path; see Path.save."""
    meta = {
        "format": _FORMAT,
        "kinds": path.kinds,
        "transitions": [_pack(item) for item in path.transitions],
        "status": path.status,
        "message": path.message,
        "orientation": path.orientation,
        "interval": path.interval,
        "options": path.options.to_dict(),
        "next_step": path.next_step,
        "stats": path.stats.__dict__,
        "node_ids": path.node_ids,
        "names": [[status.value for status in point.statuses] for point in path],
    }
    arrays = {name: getattr(path, name) for name in ARRAYS}
    place = file_path(file, "path")
    with writing(place, "path"), place.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)


def load_path(file: str | os.PathLike[str]) -> PathData:
    """Read a path; see Path.load."""
    place = file_path(file, "path")
    try:
        with np.load(place, allow_pickle=False) as data:
            meta = json.loads(str(data["meta"]))
            arrays = {name: data[name] for name in ARRAYS}
        if meta["format"] != _FORMAT:
            raise InvalidArgumentError(f"{file} has format {meta['format']!r}; this version reads format {_FORMAT}")
        return _unpacked(meta, arrays)
    except OSError as error:
        reason = error.strerror or error
        raise InvalidArgumentError(f"{file} cannot be read ({reason}); expected a file of Path.save") from error
    except (LookupError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, InvalidArgumentError):
            raise
        raise InvalidArgumentError(f"{file} does not hold a path ({error}); expected a file of Path.save") from error


def _unpacked(meta: dict[str, Any], arrays: dict[str, Any]) -> PathData:
    low, high = meta["interval"]
    return PathData(
        **arrays,
        kinds=tuple(PointKind(kind) for kind in meta["kinds"]),
        transitions=tuple(_unpack(item) for item in meta["transitions"]),
        status=PathStatus(meta["status"]),
        message=meta["message"],
        orientation=meta["orientation"],
        interval=(float(low), float(high)),
        options=ContinuationOptions.from_dict(meta["options"]),
        next_step=meta["next_step"],
        stats=PathStats(**meta["stats"]),
        node_ids=tuple(meta["node_ids"]),
        _names=tuple(tuple(ContactStatus(value) for value in names) for names in meta["names"]),
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
