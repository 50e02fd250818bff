"""The answer to a batch of measurements or scans."""

from app.missions.sounding_views import BatchVerdict, ItemVerdict, Verdict


def batch_verdict(items: list[ItemVerdict]) -> BatchVerdict:
    """Return the verdicts on a batch, in its order, with how many there are of each."""
    tally = {verdict: sum(item.verdict is verdict for item in items) for verdict in Verdict}
    return BatchVerdict(
        accepted=tally[Verdict.ACCEPTED],
        rejected=tally[Verdict.REJECTED],
        duplicate=tally[Verdict.DUPLICATE],
        items=items,
    )
