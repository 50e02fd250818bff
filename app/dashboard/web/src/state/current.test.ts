import { afterEach, expect, it } from "vitest";
import { chosenLanguage } from "../words/say";
import { currentWords } from "./current";
import { units } from "./format";

afterEach(() => {
  units.value = "metric";
  chosenLanguage.value = "system";
});

it("the current is said with its speed and where it goes", () => {
  expect(currentWords({ speed_mps: 0.31, toward_deg: 74.2 })).toEqual({
    words: "0.3 m/s → 074°",
    arrow_deg: 74.2,
  });
  expect(currentWords({ speed_mps: 0.5, toward_deg: 359.7 }).words).toBe("0.5 m/s → 000°");
});

it("the current is said in knots and in Portuguese where these were chosen", () => {
  units.value = "nautical";
  chosenLanguage.value = "pt";
  expect(currentWords({ speed_mps: 0.36, toward_deg: 180 }).words).toBe("0,7 kn → 180°");
});

it("still water goes nowhere", () => {
  expect(currentWords({ speed_mps: 0.01, toward_deg: 90 })).toEqual({
    words: "0.0 m/s",
    arrow_deg: null,
  });
});
