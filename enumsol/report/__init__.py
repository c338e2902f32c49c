"""Reports as HTML pages that need no network: all solutions, over an interval of alpha or at one, and histories."""

from __future__ import annotations

from enumsol.report.page import write_report

__all__ = ["write_report"]
