/**
 * A dialog that leaves the top bar free: a browser's own modal dialogs cover everything, and the stop has to be in reach
 * whatever is open.
 */

import "./Dialog.css";
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import { say } from "../../words/say";
import { Button, Trouble } from "./Controls";

interface DialogProps {
  open: boolean;
  onClose: () => void;
  name: string;
  id?: string;
  heading: ComponentChildren;
  /** What went wrong; empty when all is well. */
  fault?: string;
  /** Words of the button that closes it. */
  closing?: string;
  /** Further buttons. */
  actions?: ComponentChildren;
  kind?: string;
  /** Over another dialog. */
  above?: boolean;
  /** Whether its buttons come first for the keyboard, before what it shows. */
  asks?: boolean;
  /** For tests and styles. */
  data?: Record<`data-${string}`, string | boolean>;
  children: ComponentChildren;
}

/** Those that are open, the last one on top: Escape closes that one. */
const stack: object[] = [];

export function Dialog({
  open,
  onClose,
  name,
  id = `${name}-dialog`,
  heading,
  fault = "",
  closing = say("dialog.close"),
  actions,
  kind = "",
  above = false,
  asks = false,
  data = {},
  children,
}: DialogProps) {
  const dialog = useRef<HTMLDialogElement>(null);
  const close = useRef(onClose);
  close.current = onClose;

  // With what is drawn: the focus that goes back later is taken from where somebody types by then.
  useLayoutEffect(() => {
    const element = dialog.current;
    if (!open || !element) return;
    const me = {};
    const before = document.activeElement;
    stack.push(me);
    element.show();
    if (asks) element.querySelector<HTMLElement>(".dialog-actions>button")?.focus({ preventScroll: true });
    const leave = () => {
      const at = stack.indexOf(me);
      if (at >= 0) stack.splice(at, 1);
    };
    const onKey = (event: KeyboardEvent) => {
      if (event.key !== "Escape" || stack.at(-1) !== me) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      // At once: the next key may come before this dialog is drawn as closed.
      leave();
      close.current();
    };
    window.addEventListener("keydown", onKey);
    return () => {
      window.removeEventListener("keydown", onKey);
      leave();
      element.close();
      if (before instanceof HTMLElement && before.isConnected) before.focus();
    };
  }, [open]);

  return (
    <>
      {open ? <div class={`scrim${above ? " above" : ""}`} aria-hidden="true" /> : null}
      <dialog
        ref={dialog}
        class={`dialog ${kind}${above ? " above" : ""}`}
        aria-labelledby={`${name}-title`}
        data-testid={id}
        {...data}
      >
        <h2 id={`${name}-title`}>{heading}</h2>
        {children}
        <footer class="dialog-foot">
          <Trouble words={fault} />
          <div class="dialog-actions">
            <Button id={`${name}-close`} onClick={onClose}>
              {closing}
            </Button>
            {actions}
          </div>
        </footer>
      </dialog>
    </>
  );
}
