"""The report of ``bathyfleet evaluate pcao`` says what was flown."""

from app.evaluation.pcao.report import Findings, markdown
from app.exploration.pcao.model import default_model


def report(**flown: object) -> str:
    return markdown(Findings(**flown), default_model(), {}, [], pictures=False)  # type: ignore[arg-type]


def test_it_says_how_many_landmarks_and_steps_were_flown() -> None:
    assert "1100 landmarks, 500 steps" in report()
    assert "200 landmarks, 40 steps" in report(landmarks=200, steps=40)


def test_runs_of_a_training_are_told_as_such() -> None:
    assert "were in no training" in report(seeds=range(100, 130))
    trained = report(seeds=range(2, 6))
    assert "were in no training" not in trained
    assert "of the seeds 2, 3 were in a training" in trained
