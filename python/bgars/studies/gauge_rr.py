"""A whole gauge study: every characteristic, a verdict, and what was left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.records.short import Short
from bgars.studies.accuracy import TYPICAL_RUNS, Accuracy, accuracy_figures
from bgars.studies.characteristics import CHARACTERISTICS, TITLES
from bgars.studies.gauge import GaugeFigures, gauge_figures
from bgars.studies.plain import plain
from bgars.studies.readings import LeftOut, Readings, study_readings
from bgars.studies.references import check_references

if TYPE_CHECKING:
    from bgars.records.ball_result import Verdict
    from bgars.studies.references import References
    from bgars.studies.study_folder import Study

__all__ = ["FORMAT", "GaugeStudy", "gauge_rr"]

FORMAT = "bgars-grr"
FORMAT_VERSION = 1
FEW_MEASURANDS, FEW_PLACEMENTS, FEW_DF = 10, 3, 20


@dataclass(frozen=True, eq=False, repr=False)
class GaugeStudy(Short):
    """What a gauge study found.

    Attributes
    ----------
    study : Study
    figures : tuple of GaugeFigures
        Of each characteristic that was measured.
    accuracies : tuple of Accuracy
        Cg, Cgk, bias and linearity, as far as they are known; one for each of `figures`.
    readings : tuple of Readings
        Behind each of `figures`.
    verdict : {"pass", "fail", "undecided"}
        "pass" only if GRR is at most 10 % of the tolerance for every characteristic with limits, and nothing that the
        gauge measured in some runs was not measured in others.
    reasons : tuple of str
        Why it is not "pass".
    left_out : tuple of (str, LeftOut)
        Characteristic, and what was not measured in every run.
    warnings : tuple of str
    """

    study: Study
    figures: tuple[GaugeFigures, ...]
    accuracies: tuple[Accuracy, ...]
    readings: tuple[Readings, ...]
    verdict: Verdict
    reasons: tuple[str, ...]
    left_out: tuple[tuple[str, LeftOut], ...]
    warnings: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of the part, as the recipe says; without one a result is named after its run, so the study's folder."""
        first = self.study.runs[0].result
        return first.name if first.recipe is not None else self.study.folder.resolve().name

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the single readings as plain Python values; None where something is not known."""
        first = self.study.runs[0].result
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "part": self.name,
            "verdict": self.verdict,
            "reasons": list(self.reasons),
            "parts": list(self.study.parts),
            "placements": list(self.study.placements),
            "repeats": self.study.repeats,
            "runs": [str(run.path) for run in self.study.runs],
            "pixel_pitch_um": first.pixel_pitch_um,
            "version": first.version,
            "method": first.method,
            "characteristics": [plain(each) for each in self.figures],
            "accuracy": [plain(each) for each in self.accuracies],
            "left_out": [{"characteristic": name, **plain(each)} for name, each in self.left_out],
            "warnings": list(self.warnings),
        }


def gauge_rr(study: Study, references: References | None = None) -> GaugeStudy:
    """Judge a gauge by repeated measurements.

    Parameters
    ----------
    study : Study
        From :func:`bgars.read_study`.
    references : References, optional
        Reference values; without them there is no Cgk, bias or linearity.

    Returns
    -------
    GaugeStudy

    Raises
    ------
    InputError
        Nothing was measured in every run, or a reference of something that the study does not have.

    References
    ----------
    AIAG, Measurement Systems Analysis, 4th ed., 2010; ISO 22514-7:2021.
    """
    references = references or {}
    check_references(references, study)
    all_readings = [study_readings(study, characteristic) for characteristic in CHARACTERISTICS]
    used = tuple(readings for readings in all_readings if len(readings.labels))
    if not used:
        msg = f"{study.folder}: nothing was measured in every run; first: {all_readings[0].left_out[0]}"
        raise InputError(msg)
    figures = tuple(gauge_figures(readings, study.recipe) for readings in used)
    accuracies = tuple(
        accuracy_figures(readings, study.recipe, references, each.spread("TV").sigma)
        for readings, each in zip(used, figures, strict=True)
    )
    left_out = tuple((readings.characteristic.name, each) for readings in all_readings for each in readings.left_out)
    verdict, reasons = _verdict(study, all_readings, figures)
    return GaugeStudy(
        study, figures, accuracies, used, verdict, reasons, left_out, _warnings(study, figures, accuracies)
    )


def _verdict(
    study: Study, all_readings: list[Readings], figures: tuple[GaugeFigures, ...]
) -> tuple[Verdict, tuple[str, ...]]:
    judged = [each for each in figures if each.verdict is not None]
    reasons = [each.reason for verdict in ("fail", "undecided") for each in judged if each.verdict == verdict]
    verdicts = {each.verdict for each in judged}
    for readings in all_readings:
        title = readings.characteristic.title
        failed = [each for each in readings.left_out if each.measured]
        if failed:
            verdicts.add("undecided")
            reasons.append(f"{title}: {len(failed)} measured in some runs only, so left out; first: {failed[0]}")
        if readings.characteristic.tolerance(study.recipe) is not None and not readings.labels:
            verdicts.add("undecided")
            reasons.append(f"{title}: has a limit, but was not measured in every run")
    if not judged:
        verdicts.add("undecided")
        reasons.append(
            "no limits: GRR is known, but not whether it is good enough; give a recipe with a [limits] table"
        )
    verdict: Verdict = "fail" if "fail" in verdicts else "undecided" if "undecided" in verdicts else "pass"
    return verdict, tuple(reasons)


def _warnings(study: Study, figures: tuple[GaugeFigures, ...], accuracies: tuple[Accuracy, ...]) -> tuple[str, ...]:
    warnings = list(study.warnings)
    if 1 < len(study.placements) < FEW_PLACEMENTS:
        warnings.append(
            f"{len(study.placements)} placements: the contribution of placing (AV) is uncertain; use 3 or more"
        )
    if len(study.placements) == 1:
        warnings.append("one placement: GRR is repeatability only, without what placing the part adds")
    few = [each for each in figures if each.measurands < FEW_MEASURANDS]
    if few:
        names = ", ".join(f"{TITLES[each.characteristic]} ({each.measurands})" for each in few)
        warnings.append(
            f"fewer than {FEW_MEASURANDS} parts or balls: PV, percent of study and ndc are rough for {names}"
        )
    rough = [each for each in figures if each.anova.repeatability_df < FEW_DF]
    if rough:
        names = ", ".join(f"{TITLES[each.characteristic]} ({each.anova.repeatability_df})" for each in rough)
        warnings.append(f"fewer than {FEW_DF} degrees of freedom: the repeatability is rough for {names}")
    if any(each.cg == each.cg for each in accuracies) and accuracies[0].runs < TYPICAL_RUNS:
        warnings.append(f"Cg and Cgk rest on {accuracies[0].runs} runs of a part; {TYPICAL_RUNS} or more are usual")
    stray = [str(run.path) for run in study.runs if run.result.warnings]
    if stray:
        warnings.append(f"{len(stray)} runs have warnings of their own; first: {stray[0]}")
    return tuple(warnings)
