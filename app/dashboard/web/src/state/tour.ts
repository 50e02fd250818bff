/** The guided first mission: one thing at a time, each ended by what the operator really did. Pure. */

import type { Key } from "../words/say";

/** What the page knows that tells whether something was done. */
export interface TourFacts {
  /** State of the tour's mission; null while it is not shown. */
  state: string | null;
  checking: boolean;
  soundings: number;
  mapped: boolean;
  layer: string;
  /** Vehicles that wait because they were told to. */
  held: number;
  /** Whether a vehicle was held since the tour began and surveys again. */
  resumed: boolean;
  /** Corners of the line on the map. */
  corners: number;
  tab: string | null;
}

export interface TourStep {
  name: string;
  words: Key;
  /** Test ids of what is to be pressed: the first of them that is there is marked. */
  marks: readonly string[];
  done: (facts: TourFacts) => boolean;
}

const ended = (state: string | null) => state === "finished" || state === "aborted" || state === "failed";

export const TOUR: readonly TourStep[] = [
  {
    name: "checklist",
    words: "tour.checklist",
    marks: ["start"],
    done: ({ checking, state }) => checking || (state !== null && state !== "ready"),
  },
  {
    name: "start",
    words: "tour.start",
    marks: ["confirm-start", "start"],
    done: ({ state }) => state !== null && state !== "ready",
  },
  { name: "watch", words: "tour.watch", marks: [], done: ({ mapped }) => mapped },
  {
    name: "layer",
    words: "tour.layer",
    marks: ["layer"],
    done: ({ layer }) => layer === "uncertainty",
  },
  {
    name: "hold",
    words: "tour.hold",
    marks: ["hold-sim-1", "hold-sim-2"],
    done: ({ held, resumed }) => held > 0 || resumed,
  },
  {
    name: "resume",
    words: "tour.resume",
    marks: ["resume-sim-1", "resume-sim-2"],
    done: ({ resumed }) => resumed,
  },
  {
    name: "profile",
    words: "tour.profile",
    marks: ["measured-profile", "measure"],
    done: ({ tab, corners }) => tab === "profile" && corners > 1,
  },
  {
    name: "finish",
    words: "tour.finish",
    marks: ["confirm-finish", "finish"],
    done: ({ state }) => ended(state),
  },
  { name: "files", words: "tour.files", marks: ["toggle-files"], done: ({ tab }) => tab === "files" },
];

/** Steps that only a mission under way can do: they are passed over when it ended before. */
const UNDER_WAY: readonly string[] = ["watch", "hold", "resume"];

/** Where the tour stands: past all that is done already. `TOUR.length`: at its end. */
export function stepAfter(step: number, facts: TourFacts): number {
  let now = step;
  for (let found = TOUR[now]; found; found = TOUR[now]) {
    const passed = ended(facts.state) && UNDER_WAY.includes(found.name);
    if (!passed && !found.done(facts)) break;
    now += 1;
  }
  return now;
}
