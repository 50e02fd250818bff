import { say } from "../../words/say";
/** Colours of the map in each look, and the stripes of forbidden zones. */

export type Look = "light" | "dark" | "contrast";

export const PAPER = {
  light: {
    sea: "#e6eef3",
    land: "#e9e2d0",
    shore: "#9a8f74",
    grid: "#b3c5d1",
    area: "#16394f",
    keepOut: "#9b1c1c",
    holiday: "#7a1fa2",
    crossing: "#b3261e",
    casing: "#ffffff",
    ink: "#0f222d",
  },
  dark: {
    sea: "#0c1922",
    land: "#2b2a22",
    shore: "#6f6a55",
    grid: "#26404f",
    area: "#d5e6f0",
    keepOut: "#ff8f8f",
    holiday: "#ff9df5",
    crossing: "#ffb300",
    casing: "#06121a",
    ink: "#eaf2f6",
  },
  contrast: {
    sea: "#ffffff",
    land: "#e6e6e6",
    shore: "#000000",
    grid: "#7a7a7a",
    area: "#000000",
    keepOut: "#b00000",
    holiday: "#6a00a8",
    crossing: "#b00000",
    casing: "#ffffff",
    ink: "#000000",
  },
} as const;

export type Paper = (typeof PAPER)[Look];

/** A small square with a diagonal stripe that joins at its edges. */
export function striped(colour: string, size = 12, width = 2): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const context = canvas.getContext("2d");
  if (!context) throw new Error(say("paper.thisBrowserCannotDrawOnA"));
  context.strokeStyle = colour;
  context.globalAlpha = 0.75;
  context.lineWidth = width;
  for (const start of [-size, 0, size]) {
    context.beginPath();
    context.moveTo(start - width, size + width);
    context.lineTo(start + size + width, -width);
    context.stroke();
  }
  return canvas;
}
