import { linkAnnounced, missionAnnounced } from "../../state/alarms/announced";
import { othersWords } from "../../state/orders/otherUsers";
import { openAlarms } from "../../state/store";
import { say } from "../../words/say";

/** What a screen reader tells by itself, whatever is open: alarms at once, the rest when it has time. */
export function Heard() {
  const alarms = openAlarms.value;
  const [first] = alarms;
  return (
    <div class="visually-hidden">
      <div aria-live="assertive" aria-atomic="true" data-testid="heard-alarms">
        {first ? say("others.alarms", { alarms: alarms.length, message: first.message }) : ""}
      </div>
      <div aria-live="polite" aria-atomic="true" data-testid="heard">
        {othersWords.value || missionAnnounced.value}
      </div>
      <div aria-live="polite" aria-atomic="true" data-testid="heard-link">
        {linkAnnounced.value}
      </div>
    </div>
  );
}

/** What another watch-keeper just commanded. */
export function Others() {
  const words = othersWords.value;
  return words ? (
    <p class="notice others" data-testid="others">
      {words}
    </p>
  ) : null;
}
