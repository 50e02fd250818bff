/** Controls that several parts of the page have. */

import type { Signal } from "@preact/signals";
import type { AriaAttributes, ComponentChildren } from "preact";
import { useLayoutEffect } from "preact/hooks";
import { whyNotCommand } from "../../state/access";
import { dialogOpen } from "../../state/store";

/** Handlers that give a signal this value, the opposite of what it has, or what they are called with. */
export const sets =
  <T,>(signal: Signal<T>, value: T) =>
  () => {
    signal.value = value;
  };
export const flips = (signal: Signal<boolean>) => () => {
  signal.value = !signal.value;
};
export const into =
  <T,>(signal: Signal<T>) =>
  (value: T) => {
    signal.value = value;
  };

/** What came of something that was asked for, said to those who see and to those who hear the page. */
export function Hint({ text }: { text: string }) {
  return text ? (
    <p class="hint" role="status">
      {text}
    </p>
  ) : null;
}

interface ButtonProps extends AriaAttributes {
  id?: string;
  /** Its class. */
  kind?: string;
  /** Whether it commands: it says why where this user may not. */
  commands?: boolean;
  disabled?: boolean;
  /** Whether what it asked for is on its way: it does nothing meanwhile, and keeps the keyboard. */
  busy?: boolean;
  title?: string;
  /** Id of the form that it sends, as Enter in one of its fields does: only where the button may be pressed. */
  form?: string;
  onClick?: (event: MouseEvent) => void;
  children: ComponentChildren;
}

export function Button({
  id,
  kind = "command",
  commands = false,
  disabled,
  busy = false,
  title,
  form,
  onClick,
  ...rest
}: ButtonProps) {
  const why = commands ? whyNotCommand.value : "";
  const click = (event: MouseEvent) => {
    // The second click of a double click is no second command, and none for what has come to lie under it.
    const isSecond = commands && event.detail > 1;
    if (!busy && !isSecond) onClick?.(event);
    // A form is not sent, either.
    else event.preventDefault();
  };
  // Nor is a key that is held down.
  const press = (event: KeyboardEvent) => {
    if (event.repeat && event.key === "Enter") event.preventDefault();
  };
  return (
    <button
      type={form ? "submit" : "button"}
      form={form}
      class={kind}
      data-testid={id}
      disabled={disabled || why !== ""}
      aria-disabled={busy || undefined}
      title={why || title}
      onClick={click}
      onKeyDown={commands ? press : undefined}
      {...rest}
    />
  );
}

interface AskedTwiceProps {
  asked: Signal<boolean>;
  /** What asks, before it is asked. */
  first: ButtonProps;
  /** What does it. */
  last: ButtonProps;
  /** What leaves all as it is. */
  keep: ButtonProps;
}

/**
 * Does what cannot be taken back only by a second button. The first one becomes the one that keeps all: it has the
 * keyboard and the pointer, so that nobody goes on by pressing twice.
 */
export function AskedTwice({ asked, first, last, keep }: AskedTwiceProps) {
  return (
    <>
      {asked.value ? <Button key="last" {...last} /> : null}
      <Button key="first" {...(asked.value ? { onClick: sets(asked, false), ...keep } : first)} />
    </>
  );
}

interface ChoiceProps<T extends string> {
  value: T;
  /** Values with their words. */
  options: readonly (readonly [value: T, words: string])[];
  onChoose: (value: T) => void;
  label?: string;
  title?: string;
  id?: string;
}

/** One of several. */
export function Choice<T extends string>({ value, options, onChoose, label, title, id }: ChoiceProps<T>) {
  return (
    <select
      value={value}
      aria-label={label}
      title={title}
      data-testid={id}
      onChange={(event) => onChoose(event.currentTarget.value as T)}
    >
      {options.map(([name, words]) => (
        <option key={name} value={name}>
          {words}
        </option>
      ))}
    </select>
  );
}

/** What a table of titles offers. */
export const titles = <T extends string>(table: Readonly<Record<T, { title: string }>>) =>
  Object.entries<{ title: string }>(table).map(([name, { title }]) => [name as T, title] as const);

/** Values that are their own words. */
export const same = <T extends string>(values: readonly T[]) =>
  values.map((value) => [value, value] as const);

interface TypedProps {
  text: Signal<string>;
  label?: string;
  id: string;
  type?: "text" | "search" | "password";
  placeholder?: string;
  maxLength?: number;
  autocomplete?: string;
  invalid?: boolean;
  /** Id of a list of what may be meant. */
  list?: string;
}

/** A line of text, kept in a signal. */
export function Typed({ text, label, id, type = "text", invalid = false, ...rest }: TypedProps) {
  return (
    <input
      // The element's attributes depend on its type; these belong to every line of text.
      type={type as "text"}
      aria-label={label}
      aria-invalid={invalid ? "true" : "false"}
      value={text.value}
      data-testid={id}
      onInput={(event) => {
        text.value = event.currentTarget.value;
      }}
      {...rest}
    />
  );
}

interface FilesButtonProps {
  /** Endings of the files that are offered; nothing: any. */
  accept?: string;
  id: string;
  several?: boolean;
  busy?: boolean;
  onFiles: (files: File[]) => void;
  children: ComponentChildren;
}

/** Chooses files; the same ones can be chosen again. */
export function FilesButton({
  accept,
  id,
  several = false,
  busy = false,
  onFiles,
  children,
}: FilesButtonProps) {
  return (
    <label class="command file" aria-disabled={busy || undefined}>
      {children}
      <input
        type="file"
        accept={accept}
        multiple={several}
        disabled={busy}
        data-testid={id}
        onChange={(event) => {
          const files = [...(event.currentTarget.files ?? [])];
          event.currentTarget.value = "";
          if (files.length > 0) onFiles(files);
        }}
      />
    </label>
  );
}

interface FileButtonProps {
  accept: string;
  id: string;
  onText: (name: string, text: string) => void;
  children: ComponentChildren;
}

/** Reads a file of text. */
export function FileButton({ onText, ...rest }: FileButtonProps) {
  const read = async ([file]: File[]) => {
    if (file) onText(file.name, await file.text());
  };
  return <FilesButton onFiles={(files) => void read(files)} {...rest} />;
}

/** What went wrong, beside what was tried; nothing when all is well. */
export function Trouble({ words }: { words: string }) {
  return words ? (
    <p class="reason alarm" role="alert">
      {words}
    </p>
  ) : null;
}

/** Lets Escape, and the end of the part that waits, take back what is waited for, as soon as that is seen. */
export function useEscape<T>(waiting: Signal<T>, none: T): void {
  useLayoutEffect(() => {
    const stop = (event: KeyboardEvent) => {
      // A dialog over it, and what a field offers, are closed first.
      if (event.key === "Escape" && !event.defaultPrevented && !dialogOpen.peek()) waiting.value = none;
    };
    window.addEventListener("keydown", stop);
    return () => {
      window.removeEventListener("keydown", stop);
      waiting.value = none;
    };
  }, []);
}
