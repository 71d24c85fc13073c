"""The claims of the paper, with the statistic and the tolerance of each, and the records of their evaluation.

`judgements` computes the statistics, and `over_seeds` joins the records of several seeds. The paper does not test claims C8 and C9: their
verdict says so, and the finding says what this project measures.
"""

import dataclasses
from collections.abc import Callable

from enhsim_tf.reproduce.paper import judgements
from enhsim_tf.reproduce.paper.judgements import NOT_REPRODUCED, NOT_TESTED, PARTLY, REPRODUCED, WORDS, Outcome
from enhsim_tf.reproduce.paper.pipeline import Experiment


@dataclasses.dataclass(frozen=True)
class Claim:
    """A claim of the paper and its evaluation.

    Args:
        id: C1 to C9.
        sentence: What the paper says.
        section: The section of the paper.
        figure: Name of the figure that shows it.
        statistic: The quantity that is measured.
        tolerance: The values that count as reproduced.
        judge: Computes the statistic and compares it with the tolerance.
        expected: The verdict of a full run. The command exits with code 1 if a verdict differs.
        close_calls: Further verdicts that a full run may return, because other seeds gave them.
        tested_by_paper: Whether the paper itself tests it.
    """

    id: str
    sentence: str
    section: str
    figure: str
    statistic: str
    tolerance: str
    judge: Callable[[Experiment], Outcome]
    expected: str
    close_calls: tuple[str, ...] = ()
    tested_by_paper: bool = True


CLAIMS = (
    Claim(
        "C1",
        "A wide, shallow network learns to map the highly quantised simulation to the smooth waveform in 40 epochs.",
        "2.2",
        "fig04_enhanced_simulation",
        "NRMSE of the enhanced signal on held-out data",
        "at most 0.15, and below the NRMSE of the coarse signal and of ridge regression; for a real channel only below these two",
        judgements.learns_mapping,
        PARTLY,
    ),
    Claim(
        "C2",
        "Inference is extremely fast: fidelity comes without substantial speed penalties.",
        "2.2",
        "fig04_enhanced_simulation",
        "seconds of telemetry generated per second of computation",
        "at least 10,000 (otherwise not reproduced), in at most twice the time of the coarse simulator alone (otherwise partly)",
        judgements.is_fast,
        PARTLY,
    ),
    Claim(
        "C3",
        "The enhanced signal alone is too clean to train a detector on.",
        "2.2",
        "fig04_enhanced_simulation",
        "false-alarm rate on real nominal windows, mean over detectors",
        "at least 10 % for every detector, with thresholds set for 1 %",
        judgements.is_too_clean,
        REPRODUCED,
    ),
    Claim(
        "C4",
        "To match the qualities of the noise, the model needs around 1,000 iterations.",
        "2.3",
        "fig12_accuracy_loss",
        "recorded iteration from which the noise stays within tolerance, when training goes on to 2,000 iterations: the absolute log ratio of the "
        "standard deviations is at most 0.1, and the difference in lag-1 correlation at most 0.05",
        "from 500 to 1,500; partly if it is another one, or if only one of the two stays within tolerance from 1,500 or an earlier one on",
        judgements.needs_iterations,
        REPRODUCED,
        close_calls=(PARTLY, NOT_REPRODUCED),
    ),
    Claim(
        "C5",
        "The discriminator improves slightly faster than the generator, and the two stay balanced.",
        "2.3",
        "fig12_accuracy_loss",
        "share of rows that the discriminator classifies correctly, mean over the second half of training",
        "from 0.5 to 0.8, or its binomial 95 % interval meets this range; and above 0.5 in the first half, with the whole interval (partly if only "
        "one of the two holds; not reproduced if neither does, or if the interval of the second half is outside of 0.35 to 0.95)",
        judgements.is_balanced,
        REPRODUCED,
    ),
    Claim(
        "C6",
        "After 1,000 iterations the generated noise is sufficiently similar to the actual noise.",
        "2.3",
        "fig06_real_or_generated_noise",
        "effective rank of generated noise divided by that of real noise",
        "the log ratio of the standard deviations is at most 0.1, the difference in lag-1 correlation at most 0.05 and the distance between the "
        "distributions of values at most 0.1 sd (otherwise not reproduced); the ratio of effective ranks is at least 0.8 and the classifier AUC at "
        "most 0.6 (otherwise partly)",
        judgements.noise_is_similar,
        PARTLY,
        close_calls=(NOT_REPRODUCED,),
    ),
    Claim(
        "C7",
        "The sum of both networks resembles the original telemetry.",
        "2.3",
        "fig13_combined",
        "AUC of a classifier that separates the sum from telemetry",
        "the log ratio of the standard deviations is at most 0.1, the distance between the distributions of values at most 0.1 sd and the roughness "
        "ratio from 0.8 to 1.25 (otherwise not reproduced); the AUC is at most 0.6 (otherwise partly)",
        judgements.sum_resembles,
        PARTLY,
        close_calls=(NOT_REPRODUCED,),
    ),
    Claim(
        "C8",
        "Detectors trained on such data are robust where those trained on clean simulation are not.",
        "title, abstract",
        "fig13_combined",
        "false-alarm rate on real nominal windows, trained on enhanced + GAN noise, mean over detectors",
        "for every detector, a rate of at most twice that of the detector trained on real telemetry plus 1 percentage point, and a recall at most 5 "
        "points lower (in part if at least half of the detectors meet this)",
        judgements.is_robust,
        NOT_TESTED,
        tested_by_paper=False,
    ),
    Claim(
        "C9",
        "The enhanced simulator infers realistic signals in degraded configurations it was not trained on.",
        "1, 3",
        "fig04_enhanced_simulation",
        "largest NRMSE over degraded modes, in units of the nominal NRMSE",
        "at most 2 in every mode, and an error below that of the coarse signal (in part if at least half of the modes meet this)",
        judgements.degrades_rightly,
        NOT_TESTED,
        tested_by_paper=False,
    ),
)


def judge(claims: tuple[Claim, ...], experiment: Experiment) -> list[dict]:
    """Evaluates the claims and returns one plain record for each, as stored in `results.json`."""
    records = []
    for claim in claims:
        outcome = claim.judge(experiment)
        verdict, finding = outcome.verdict, outcome.finding
        holds = None if claim.tested_by_paper else WORDS.get(verdict)
        if holds is not None:
            verdict, finding = NOT_TESTED, f"{holds} here: {finding}"
        said = {name: getattr(claim, name) for name in ("id", "sentence", "section", "figure", "statistic", "tolerance", "expected")}
        said |= {"close_calls": list(claim.close_calls), "value": outcome.value, "verdict": verdict, "holds": holds}
        records.append({**said, "finding": finding, "details": dict(outcome.details)})
    return records


def changed(records: list[dict]) -> list[str]:
    """Ids of the claims whose verdict is not an expected one."""
    return [record["id"] for record in records if record["verdict"] not in (record["expected"], *record.get("close_calls", ()))]
