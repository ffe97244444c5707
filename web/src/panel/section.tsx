// What sections of the panel are made of.

import type { ComponentChildren, JSX } from "preact";
import { NumberInput } from "../number";

export function Section(props: {
  title: string;
  open?: boolean;
  /** It was opened or closed. */
  toggled?(isOpen: boolean): void;
  children: ComponentChildren;
}): JSX.Element {
  return (
    <details
      open={props.open ?? true}
      onToggle={(e) => props.toggled?.((e.currentTarget as HTMLDetailsElement).open)}
    >
      <summary>{props.title}</summary>
      <div class="section">{props.children}</div>
    </details>
  );
}

export function Select(props: {
  label: string;
  value: string;
  options: { value: string; text?: string }[];
  title?: string | undefined;
  change(value: string): void;
}): JSX.Element {
  return (
    <label class="field" title={props.title}>
      <span>{props.label}</span>
      <select
        value={props.value}
        aria-label={props.label}
        onChange={(e) => {
          const chosen = e.currentTarget.value;
          // The list shows what holds, also if the choice is refused.
          e.currentTarget.value = props.value;
          props.change(chosen);
        }}
      >
        {props.options.map((o) => (
          <option value={o.value}>{o.text ?? o.value}</option>
        ))}
      </select>
    </label>
  );
}

export function Slider(props: {
  label: string;
  value: number;
  min: number;
  max: number;
  step: number;
  unit?: string;
  /** What an emptied field stands for; without one it keeps its number. */
  fallback?: number;
  change(value: number): void;
}): JSX.Element {
  const name = props.unit ? `${props.label} (${props.unit})` : props.label;
  return (
    <label class="field">
      <span>{name}</span>
      <input
        type="range"
        min={props.min}
        max={props.max}
        step={props.step}
        value={props.value}
        onInput={(e) => props.change(Number(e.currentTarget.value))}
        aria-label={name}
      />
      <NumberInput
        label={name}
        value={props.value}
        fallback={props.fallback}
        digits={5}
        change={(next) => next !== null && props.change(next)}
      />
    </label>
  );
}
