// What lies over the picture and goes away with Escape or a click elsewhere: menus, dialogs and
// sheets.

import type { RefObject } from "preact";
import { useLayoutEffect } from "preact/hooks";

interface Layer {
  close(): void;
  /** The element that a press must hit to keep it open; without one, any press keeps it. */
  element: () => HTMLElement | null;
  /** True if the picture and its keys are out of reach meanwhile. */
  covers: boolean;
}

/** What is open, the last opened last. */
const layers: Layer[] = [];

/** True if something covers the picture, so that its keys do nothing. */
export const isCovered = (): boolean =>
  layers.some((layer) => layer.covers) || document.querySelector("dialog[open]") !== null;

/** The menus that are open. A page learns of it late, so the document is asked. */
const menus = (): HTMLDetailsElement[] => [
  ...document.querySelectorAll<HTMLDetailsElement>("details.menu[open]"),
];

/** Listens on the page, once and for all. */
export function listenForDismissal(): void {
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || document.querySelector("dialog[open]")) return;
    const menu = menus().at(-1);
    const top = menu ? { close: () => (menu.open = false) } : layers.at(-1);
    if (!top) return;
    event.preventDefault();
    top.close();
  });
  const press = (event: Event): void => {
    for (const menu of menus()) if (!menu.contains(event.target as Node)) menu.open = false;
    for (const layer of [...layers]) {
      const element = layer.element();
      if (element && !element.contains(event.target as Node)) layer.close();
    }
  };
  document.addEventListener("pointerdown", press, true);
}

/** Closes it on Escape while it is open, and, with an element, on a press outside of that. */
export function useDismiss(
  isOpen: boolean,
  close: () => void,
  { element, covers = false }: { element?: RefObject<HTMLElement>; covers?: boolean } = {},
): void {
  useLayoutEffect(() => {
    if (!isOpen) return;
    const layer: Layer = { close, element: () => element?.current ?? null, covers };
    layers.push(layer);
    return () => void layers.splice(layers.indexOf(layer), 1);
  }, [isOpen]);
}
