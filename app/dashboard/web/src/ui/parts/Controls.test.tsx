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
      props: { onClick: (event: { detail: number; preventDefault: () => void }) => void };
    };
    const preventDefault = vi.fn();
    // 0: by the keyboard.
    for (const detail of [1, 2, 0]) button.props.onClick({ detail, preventDefault });
    return [onClick.mock.calls.length, preventDefault.mock.calls.length];
  };
  expect(clicks(true)).toEqual([2, 1]);
  expect(clicks(false)).toEqual([3, 0]);
});

it("a button that waits for its answer asks for nothing more and sends no form", async () => {
  const { Button } = await import("./Controls");
  const onClick = vi.fn();
  const preventDefault = vi.fn();
  const button = Button({ busy: true, onClick, children: "Set" }) as unknown as {
    props: { onClick: (event: object) => void; disabled: boolean; "aria-disabled": boolean };
  };
  button.props.onClick({ detail: 0, preventDefault });
  expect(onClick).not.toHaveBeenCalled();
  expect(preventDefault).toHaveBeenCalledOnce();
  // It keeps the keyboard: one that is disabled would lose it.
  expect(button.props).toMatchObject({ disabled: false, "aria-disabled": true });
});

it("a key that is held down commands once", async () => {
  const { Button } = await import("./Controls");
  const pressed = (commands: boolean, repeat: boolean) => {
    const preventDefault = vi.fn();
    const button = Button({ commands, children: "Pause" }) as unknown as {
      props: { onKeyDown?: (event: object) => void };
    };
    button.props.onKeyDown?.({ key: "Enter", repeat, preventDefault });
    return preventDefault.mock.calls.length;
  };
  expect([pressed(true, false), pressed(true, true), pressed(false, true)]).toEqual([0, 1, 0]);
});
