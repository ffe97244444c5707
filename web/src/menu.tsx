// A menu of the bar.

import type { ComponentChildren, JSX } from "preact";

/**
 * A menu of buttons in the bar. It closes when one of them is chosen, on Escape, and on a press
 * elsewhere (see dismiss.ts).
 */
export function Menu(props: {
  name: string;
  class?: string;
  children: ComponentChildren;
}): JSX.Element {
  const close = (event: JSX.TargetedEvent<HTMLElement>): void => {
    const details = event.currentTarget.closest("details");
    if (details) details.open = false;
  };
  return (
    <details class={`menu ${props.class ?? ""}`}>
      <summary title={props.name}>{props.name}</summary>
      {/* biome-ignore lint/a11y/useKeyWithClickEvents: its buttons have keys */}
      {/* biome-ignore lint/a11y/noStaticElementInteractions: its buttons have keys */}
      <div onClick={close}>{props.children}</div>
    </details>
  );
}
