import type { MountingSpec } from "../../api/types";
import { plain } from "../../state/format";
import { say } from "../../words/say";

/** A mounting in words. */
export function described(mounting: MountingSpec): string {
  const [forward, starboard, down] = mounting.offset_m;
  const parts = [
    mounting.roll_deg ? say("mountings.roll", { angle: plain(mounting.roll_deg) }) : "",
    mounting.pitch_deg ? say("mountings.pitch", { angle: plain(mounting.pitch_deg) }) : "",
    mounting.heading_deg ? say("mountings.heading", { angle: plain(mounting.heading_deg) }) : "",
    mounting.latency_s ? say("mountings.latency", { seconds: plain(mounting.latency_s) }) : "",
    forward || starboard || down
      ? say("mountings.offset", {
          forward: plain(forward),
          starboard: plain(starboard),
          down: plain(down),
        })
      : "",
  ].filter((part) => part !== "");
  return parts.length ? parts.join(", ") : say("mountings.straight");
}
