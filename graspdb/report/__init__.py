"""A session on one page: what was recorded, how good it is, what happened, where objects were touched."""

from graspdb.report.contents import SessionReport, read_report
from graspdb.report.page import report_page, write_report

__all__ = ["SessionReport", "read_report", "report_page", "write_report"]
