/** How well each cell is known: never seen, visible, accurate, as in the papers' figure. Pure. */

import { say } from "../../words/say";
import type { Drawing } from "./drawings";
import { ACCURATE, VISIBLE } from "./seafloor";

export const LANDMARKS: Drawing = {
  words: () => [say("landmark.unseen"), say("landmark.visible"), say("landmark.accurate")],
  colours: [
    [176, 58, 46],
    [244, 196, 80],
    [46, 125, 110],
  ],
  classOf: (flags) => (flags & ACCURATE ? 2 : flags & VISIBLE ? 1 : 0),
};
