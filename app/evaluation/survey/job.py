"""One run of the field experiment as a job for :mod:`app.evaluation.runs.jobs`."""

from dataclasses import asdict, dataclass
from typing import Any

from app.estimation import Sensor, SingleBeam
from app.evaluation.runs.jobs import Progress
from app.evaluation.survey.run import run_survey, run_survey_at_sea
from app.evaluation.survey.world import SurveyScenario
from app.exploration.planner.options import PlannerOptions
from app.mapping.types import Soundings


@dataclass(frozen=True)
class SurveyJob:
    """One run of ``survey``."""

    scenario: SurveyScenario
    planner: str
    options: PlannerOptions
    recorded: Soundings | None
    minutes: float | None = None
    """How long vehicles with turning circles fly; None: straight legs, counted or by the metre."""

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.planner}, seed {self.scenario.seed}, symmetry {self.scenario.symmetry}"

    @property
    def steps(self) -> int:
        """Its length."""
        return self.scenario.steps

    @property
    def sensor(self) -> Sensor:
        """What its vehicles measure with."""
        return SingleBeam(self.scenario.relative_noise)

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        how = (self.scenario, self.planner, self.options)
        if self.minutes is None:
            result = asdict(run_survey(*how, progress, self.recorded))
            del result["minutes"], result["flown_m"], result["on_plan_m"]
        else:
            result = asdict(run_survey_at_sea(*how, self.minutes, progress, self.recorded))
        if self.recorded is None:
            del result["recorded_track"], result["ratio_recorded"]
        return result
