// Tools that take the pointer on the picture, such as measuring: at most one at a time.

import { signal } from "@preact/signals";

/** A position in pixels of the picture, from its upper left corner. */
export type Pixel = [number, number];

export interface Tool {
  /** The name on its button, which also ends it. */
  name: string;
  /** What to do next, shown over the picture. */
  hint: string;
  /** The pointer went down; true to take the drag, which then does not move the camera. */
  down?(at: Pixel, event: PointerEvent): boolean;
  /** The pointer moved, in a drag that was taken or freely. */
  move?(at: Pixel, event: PointerEvent): void;
  /** A drag that was taken has ended. */
  up?(at: Pixel, event: PointerEvent): void;
  /** A click, instead of showing what is there. */
  click?(at: Pixel, event: PointerEvent): void;
  /** The tool was ended, by Escape or by another one. */
  end?(): void;
}

/** The tool in use. */
export const tool = signal<Tool | null>(null);

/** Takes this tool in place of the last one; `null` for none. */
export function use(next: Tool | null): void {
  const last = tool.value;
  tool.value = next;
  if (last && last.name !== next?.name) last.end?.();
}
