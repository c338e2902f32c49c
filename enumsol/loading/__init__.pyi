"""Where the names are at home."""

from .growing import HistoryProgress as HistoryProgress, histories as histories
from .history import History as History
from .history_data import HistoryData as HistoryData, Refinement as Refinement, Stage as Stage
from .maps import (
    MapFold as MapFold,
    MapRow as MapRow,
    MultiplicityMap as MultiplicityMap,
    multiplicity_map as multiplicity_map,
)
from .steps import LoadStep as LoadStep
