import { afterEach, beforeEach, expect, it, vi } from "vitest";

// What signals of the page ask for when they are made.
beforeEach(() => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
});
afterEach(() => {
  vi.unstubAllGlobals();
});

it("the second click of a double click is no second command", async () => {
  const { Button } = await import("./Controls");
  const clicks = (commands: boolean) => {
    const onClick = vi.fn();
    const button = Button({ commands, onClick, children: "Skip line" }) as unknown as {
      props: { onClick: (event: { detail: number }) => void };
    };
    // 0: by the keyboard.
    for (const detail of [1, 2, 0]) button.props.onClick({ detail });
    return onClick.mock.calls.length;
  };
  expect(clicks(true)).toBe(2);
  expect(clicks(false)).toBe(3);
});
