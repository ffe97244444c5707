// A field for one number.

import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { refusals } from "./store";

/** Digits enough for single precision, without the noise behind them; fewer in narrow fields. */
export const shown = (value: number, digits = 6): string =>
  Number(value.toPrecision(digits)).toString();

/** A number between bounds, either of which may be missing. */
export function clamped(value: number, limits?: (number | null)[]): number {
  const [least, most] = [limits?.[0] ?? -Infinity, limits?.[1] ?? Infinity];
  return Math.min(Math.max(value, least), most);
}

/**
 * A field that always shows the number that holds. Emptied, it goes back to `fallback`; if that is
 * undefined, it keeps the number. Text that is no number changes nothing.
 */
export function NumberInput(props: {
  label: string;
  value: number | null;
  /** What an emptied field stands for: a number, or null where there need be none. */
  fallback?: number | null | undefined;
  limits?: (number | null)[] | undefined;
  class?: string;
  /** What an empty field says; else the fallback. */
  placeholder?: string;
  /** Digits that are shown; a number that is not touched keeps all of its own. */
  digits?: number | undefined;
  change(value: number | null): void;
}): JSX.Element {
  const text = props.value === null ? "" : shown(props.value, props.digits);
  // What the server has or will have: a change that is underway is not shown yet.
  const last = useRef({ value: props.value, text });
  if (last.current.value !== props.value) last.current = { value: props.value, text };
  // What is being typed is not written over; a field that only has the focus is.
  const field = useRef<HTMLInputElement>(null);
  const written = useRef(text);
  const write = (next: string): void => {
    field.current!.value = next;
    written.current = next;
  };
  useEffect(() => {
    const isTyped = field.current!.value !== written.current;
    if (document.activeElement !== field.current || !isTyped) write(text);
  }, [text]);
  // What was refused does not stay.
  useEffect(() => {
    if (last.current.text === text) return;
    last.current.text = text;
    write(text);
  }, [refusals.value]);
  const set = (event: JSX.TargetedEvent<HTMLInputElement>): void => {
    const input = event.currentTarget;
    const number = Number(input.value);
    const isEmpty = input.value.trim() === "" && !input.validity.badInput;
    const wanted = isEmpty
      ? props.fallback
      : Number.isFinite(number) && !input.validity.badInput
        ? clamped(number, props.limits)
        : undefined;
    write(wanted === undefined ? text : wanted === null ? "" : shown(wanted, props.digits));
    if (wanted === undefined || input.value === last.current.text) return;
    last.current.text = input.value;
    props.change(wanted);
  };
  const { fallback } = props;
  const placeholder =
    typeof fallback === "number" ? shown(fallback) : fallback === null ? "none" : "";
  return (
    <input
      type="number"
      step="any"
      class={props.class ?? ""}
      ref={field}
      defaultValue={text}
      title={props.digits && props.value !== null ? String(props.value) : undefined}
      placeholder={props.placeholder ?? placeholder}
      aria-label={props.label}
      onChange={set}
      onBlur={() => field.current && write(last.current.text)}
    />
  );
}
