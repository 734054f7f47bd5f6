"""Studies of many inspections: how good the gauge is, and how good the process."""

from bgars.studies.gauge_rr import GaugeStudy, gauge_rr
from bgars.studies.references import read_references
from bgars.studies.study_folder import Study, read_study
from bgars.studies.trend import ProcessTrend, process_trend
from bgars.studies.trend_files import read_results

__all__ = [
    "GaugeStudy",
    "ProcessTrend",
    "Study",
    "gauge_rr",
    "process_trend",
    "read_references",
    "read_results",
    "read_study",
]
