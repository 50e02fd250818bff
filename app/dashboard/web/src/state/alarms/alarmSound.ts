/** The sound of alarms that nobody has taken; this device can be kept quiet. */

import { computed, effect } from "@preact/signals";
import { kept } from "../../persistentSignal";
import { openAlarms } from "../store";

export const alarmSound = kept("alarm-sound", true);

const PERIOD_MS = 4000;
const TONES_HZ = [880, 660];
const TONE_S = 0.18;
const LOUDNESS = 0.15;

/** Sounds two tones; a browser that was not touched yet stays silent. */
function sound(audio: AudioContext): void {
  TONES_HZ.forEach((hertz, i) => {
    const [tone, level] = [audio.createOscillator(), audio.createGain()];
    const begins = audio.currentTime + i * TONE_S;
    tone.frequency.value = hertz;
    level.gain.setValueAtTime(LOUDNESS, begins);
    level.gain.exponentialRampToValueAtTime(0.001, begins + TONE_S);
    tone.connect(level).connect(audio.destination);
    tone.start(begins);
    tone.stop(begins + TONE_S);
  });
}

/** Sounds for as long as an alarm is open whose cause goes on; returns what ends that. */
export function followAlarms(makeAudio = () => new AudioContext()): () => void {
  let audio: AudioContext | null = null;
  // The alarms are told anew with every message of the live view: the sound keeps its own pace.
  const sounds = computed(
    () =>
      alarmSound.value &&
      openAlarms.value.some(({ severity, ended_at }) => severity !== "minor" && ended_at === null),
  );
  return effect(() => {
    if (!sounds.value) return;
    const again = () => {
      audio ??= makeAudio();
      if (audio.state === "suspended") void audio.resume();
      sound(audio);
    };
    again();
    const timer = setInterval(again, PERIOD_MS);
    return () => clearInterval(timer);
  });
}
