// The measuring tool: clicks on the picture become points, and points measures.

import { signal } from "@preact/signals";
import { project } from "../camera";
import { type Store, size } from "../store";
import { type Pixel, type Tool, tool, use } from "../tool";
import { press } from "../touch";
import { KINDS, type Kind, type Measure, type Point, snapped } from "./geometry";

/** How near the pointer must be to a corner or an edge to take it, in pixels of the page. */
const REACH = 12;
/** How much of that the pointer may lie beside the body. */
const OUTSIDE = 2 / 3;

export const NAME = "Measure";
export const kind = signal<Kind>("distance");
export const measures = signal<Measure[]>([]);
/** The points of the measure that is begun. */
export const begun = signal<Point[]>([]);
/** The point that a click would take. */
export const hovered = signal<Point | null>(null);

let nextId = 1;

/** Takes the tool, or puts it down. */
export function toggleMeasuring(store: Store): void {
  use(tool.value?.name === NAME ? null : measuring(store));
}

/** Measures something else from now on. */
export function measureBy(store: Store, next: Kind): void {
  kind.value = next;
  begun.value = [];
  use(measuring(store));
}

function measuring(store: Store): Tool {
  const { name, hint, points } = KINDS.find((k) => k.kind === kind.value)!;
  const picked = async (at: Pixel, reach: number): Promise<Point | null> => {
    const hit = await store.pick(...at, reach * OUTSIDE);
    const rig = store.rig;
    if (!hit || !rig) return null;
    return snapped(hit, at, (point) => project(rig.camera, point, size.value), reach);
  };
  let isAsking = false;
  const count = points > 1 ? ` (${begun.value.length} of ${points})` : "";
  return {
    name: NAME,
    hint: `${name}: ${press()} on ${hint}${count}`,
    move(at, event) {
      // One question at a time: the next pointer move asks again.
      if (isAsking || event.buttons > 0) return;
      isAsking = true;
      void picked(at, reachOf(event)).then((point) => {
        isAsking = false;
        if (tool.value?.name === NAME) hovered.value = point;
      });
    },
    click(at, event) {
      void picked(at, reachOf(event)).then((point) => {
        if (!point) {
          store.notice("There is nothing to measure here");
          return;
        }
        const all = [...begun.value, point];
        const isWhole = all.length === points;
        if (isWhole)
          measures.value = [...measures.value, { id: nextId++, kind: kind.value, points: all }];
        begun.value = isWhole ? [] : all;
        // The hint counts the points.
        if (tool.value?.name === NAME) use(measuring(store));
      });
    },
    end() {
      begun.value = [];
      hovered.value = null;
    },
  };
}

/** The reach in pixels of the picture; fingers are less exact than mice. */
function reachOf(event: PointerEvent): number {
  const width = (event.currentTarget as HTMLElement | null)?.clientWidth ?? size.value[0];
  const reach = event.pointerType === "touch" ? 2 * REACH : REACH;
  return (reach * size.value[0]) / Math.max(1, width);
}
