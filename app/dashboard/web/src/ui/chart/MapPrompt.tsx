import "./MapPrompt.css";
import { drawing, picking } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { mapFirst } from "./layout";

/** What is to be done on the map, where the form that asks for it lies over all of it and is away meanwhile. */
export function MapPrompt() {
  if (!mapFirst.value) return null;
  const shape = drawing.value?.shape;
  const words = shape
    ? shape === "polygon"
      ? "area.tapCorners"
      : "area.tapTwoCorners"
    : "fields.clickOnTheMap";
  const stop = () => {
    drawing.value = null;
    picking.value = null;
  };
  return (
    <div class="notice map-prompt" data-testid="map-prompt">
      <span role="status">{say(words)}</span>
      <Button id="back-to-form" onClick={stop}>
        {say("mission.cancel")}
      </Button>
    </div>
  );
}
