"""Reports: all solutions, over an interval of alpha or at one, as one HTML page that needs no network."""

from __future__ import annotations

from enumsol.report.page import write_report

__all__ = ["write_report"]
