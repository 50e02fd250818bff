import { THEMES, themeWords } from "../../state/device/themes";
import { type CoordinateFormat, type Units, units } from "../../state/format";
import { coordinateFormat, keysOpen, settingsOpen, theme } from "../../state/store";
import { chosenLanguage, LANGUAGES, type Language, OWN_NAMES, say } from "../../words/say";
import { Button, Choice, into, sets } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

/** What each person sets for himself, remembered on this device. */
export function SettingsDialog() {
  const languages: readonly (readonly [Language | "system", string])[] = [
    ["system", say("settings.asTheBrowser")],
    ...LANGUAGES.map((one) => [one, OWN_NAMES[one]] as const),
  ];
  const measures: readonly (readonly [Units, string])[] = [
    ["metric", say("settings.metric")],
    ["nautical", say("settings.nautical")],
  ];
  const positions: readonly (readonly [CoordinateFormat, string])[] = [
    ["decimal", say("mapTools.decimalDegrees")],
    ["minutes", say("mapTools.degreesAndMinutes")],
  ];
  return (
    <Dialog
      open={settingsOpen.value}
      onClose={sets(settingsOpen, false)}
      name="settings"
      heading={say("settings.settings")}
      actions={
        <Button
          id="open-keys"
          onClick={() => {
            settingsOpen.value = false;
            keysOpen.value = true;
          }}
        >
          {say("keys.keys")}
        </Button>
      }
    >
      <label class="field">
        {say("settings.language")}
        <Choice
          id="language"
          value={chosenLanguage.value}
          options={languages}
          onChoose={into(chosenLanguage)}
        />
      </label>
      <label class="field">
        {say("settings.colours")}
        <Choice
          id="theme"
          value={theme.value}
          options={THEMES.map((one) => [one, themeWords(one)] as const)}
          onChoose={into(theme)}
        />
      </label>
      <label class="field">
        {say("settings.units")}
        <Choice id="units" value={units.value} options={measures} onChoose={into(units)} />
      </label>
      <label class="field">
        {say("settings.positions")}
        <Choice
          id="coordinate-format"
          value={coordinateFormat.value}
          options={positions}
          onChoose={into(coordinateFormat)}
        />
      </label>
      <p class="hint">{say("settings.remembered")}</p>
    </Dialog>
  );
}
