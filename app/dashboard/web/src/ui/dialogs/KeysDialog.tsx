import "./KeysDialog.css";
import { keysOpen, singleKeys } from "../../state/store";
import { say } from "../../words/say";
import { FURTHER, SHORTCUTS } from "../keys";
import { sets } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

/** What every key does. */
export function KeysDialog() {
  const lines = [
    ...SHORTCUTS.map(({ key, sign, words }) => [sign ?? key.toUpperCase(), words] as const),
    ...FURTHER,
  ];
  return (
    <Dialog
      open={keysOpen.value}
      onClose={sets(keysOpen, false)}
      name="keys"
      kind="wide"
      heading={say("keys.keys")}
    >
      <dl class="keys" data-testid="keys">
        {lines.map(([sign, words]) => (
          <div key={sign}>
            <dt>
              <kbd>{sign}</kbd>
            </dt>
            <dd>{say(words as "keys.close")}</dd>
          </div>
        ))}
      </dl>
      <label class="check">
        <input
          type="checkbox"
          checked={singleKeys.value}
          data-testid="single-keys"
          onChange={(event) => {
            singleKeys.value = event.currentTarget.checked;
          }}
        />
        {say("keys.singleKeys")}
      </label>
    </Dialog>
  );
}
