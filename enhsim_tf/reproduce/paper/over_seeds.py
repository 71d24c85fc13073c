"""The records of the claims over several seeds: ranges, the verdict of most seeds, and the overall verdict."""

from collections.abc import Mapping, Sequence
from typing import Any

from enhsim_tf.reproduce.paper.judgements import NOT_MEASURED, NOT_REPRODUCED, NOT_TESTED, PARTLY, REPRODUCED


def ranges(records_of: Mapping[int, list[dict]], budget: str) -> dict:
    """Smallest and largest value and the verdicts of each claim over seeds, as `spread.json` holds them."""
    spread = {}
    for claims in zip(*records_of.values(), strict=True):
        values = [claim["value"] for claim in claims if claim["value"] is not None]
        details = {key: [min(found), max(found)] for key in claims[0]["details"] if (found := [claim["details"][key] for claim in claims])}
        spread[claims[0]["id"]] = {
            "range": [min(values), max(values)] if values else None,
            "values": [claim["value"] for claim in claims],
            "verdicts": [claim["verdict"] for claim in claims],
            "holds": [claim.get("holds") for claim in claims],
            "details": details,
        }
    return {"budget": budget, "seeds": list(records_of), "claims": spread}


def of_most(verdicts: Sequence[str]) -> str:
    """The verdict of most seeds; where as many come to another, the worse."""
    best_last = (NOT_REPRODUCED, PARTLY, REPRODUCED)
    worst_first = sorted(set(verdicts), key=lambda verdict: best_last.index(verdict) if verdict in best_last else -1)
    return max(worst_first, key=verdicts.count)


def is_tie(verdicts: Sequence[str]) -> bool:
    """Whether two verdicts share the largest number of seeds, so that the worse of them counts."""
    counts = sorted((verdicts.count(verdict) for verdict in set(verdicts)), reverse=True)
    return len(counts) > 1 and counts[0] == counts[1]


def verdict_over(record: Mapping[str, Any], spread: Mapping[str, Any] | None) -> str:
    """The verdict on a claim by most seeds, or that of its record if only one seed was run."""
    return record["verdict"] if spread is None else of_most(spread["claims"][record["id"]]["verdicts"])


def titles_of_seeds(records: list[dict], spread: Mapping[str, Any]) -> list[str]:
    """The overall verdict by each seed alone."""
    verdicts = [(record["id"], spread["claims"][record["id"]]["verdicts"]) for record in records]
    return [title_verdict([{"id": name, "verdict": each[number]} for name, each in verdicts]) for number in range(len(spread["seeds"]))]


def title_verdict(records: list[dict], spread: Mapping[str, Any] | None = None) -> str:
    """The overall verdict in ReScience's manner: [Re] where every tested claim is reproduced, [¬Re] where one is not at all.

    Args:
        records: The judged claims.
        spread: What `ranges` made of them and of further seeds: the verdict of each claim is then that of most seeds.
    """
    over_seeds = {} if spread is None else {name: about["verdicts"] for name, about in spread["claims"].items()}
    tested = {of_most(over_seeds.get(record["id"]) or [record["verdict"]]) for record in records} - {NOT_TESTED, NOT_MEASURED}
    return "[Re]" if tested == {REPRODUCED} else "[¬Re]" if NOT_REPRODUCED in tested else "[Re, in part]"
