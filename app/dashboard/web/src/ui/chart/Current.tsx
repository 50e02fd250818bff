import "./Current.css";
import { currentWords } from "../../state/current";
import { hasEnded } from "../../state/stateNames";
import { live, mission, replayStep } from "../../state/store";
import { say } from "../../words/say";

/** The current beside the map's scale; nothing while no vehicle estimates it, or the service is silent. */
export function Current() {
  const present = mission.value;
  if (!present?.current || hasEnded(present) || !live.value || replayStep.value !== null) return null;
  const { words, arrow_deg } = currentWords(present.current);
  return (
    <output class="current" data-testid="current">
      {arrow_deg === null ? null : (
        <svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true">
          <path
            d="M10,17 V3 M5,8 L10,3 L15,8"
            transform={`rotate(${arrow_deg} 10 10)`}
            fill="none"
            stroke="currentColor"
            stroke-width="2"
            stroke-linecap="round"
            stroke-linejoin="round"
          />
        </svg>
      )}
      <span class="what">{say("current.current")} </span>
      {words}
    </output>
  );
}
