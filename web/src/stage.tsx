// The picture, its pointer and keys, and what lies over it.

import type { JSX, RefObject } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { AnimationBar } from "./animation";
import { toggleCompare } from "./compare/state";
import { listen } from "./controls";
import { useDismiss } from "./dismiss";
import { host } from "./host";
import { chosenLight, removeLight } from "./light";
import { Overlay } from "./overlay";
import type { PickedHit } from "./protocol.gen";
import {
  busy,
  connected,
  explaining,
  focusing,
  gone,
  picked,
  pickedPixel,
  type Store,
} from "./store";
import { tool } from "./tool";

/** What keys of the stage do elsewhere on the page. */
export interface Elsewhere {
  help(): void;
  panel(): void;
  /** True if the panel is shown. */
  hasPanel(): boolean;
  /** Closes the panel if it lies over the picture; false if it does not. */
  closeSheet(): boolean;
}

/** What was picked, in a few words. */
const nameOf = ({ path, material, material_name }: PickedHit): string =>
  [path.filter(Boolean).at(-1) || "unnamed", material !== null && material_name]
    .filter(Boolean)
    .join(", ");

export function Stage({ store, elsewhere }: { store: Store; elsewhere: Elsewhere }): JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = box.current!;
    element.prepend(store.picture.canvas);
    const resized = new ResizeObserver(() => {
      store.resize(element.clientWidth * devicePixelRatio, element.clientHeight * devicePixelRatio);
    });
    resized.observe(element);
    const stop = listen(element, store, {
      ...elsewhere,
      compare: () => void toggleCompare(store),
      remove: () => chosenLight.value !== null && removeLight(store, chosenLight.value),
      undo: () => store.undo(),
      redo: () => store.redo(),
      select: (x, y) => {
        if (elsewhere.closeSheet()) return;
        if (focusing.value) {
          focusing.value = false;
          void store.focus(x, y, false);
          return;
        }
        pickedPixel.value = [Math.floor(x), Math.floor(y)];
        chosenLight.value = null;
        void store.pick(x, y).then((hit) => {
          picked.value = hit;
          // Without the panel, its name is all that is told of it.
          if (hit && !elsewhere.hasPanel()) store.notice(nameOf(hit));
        });
      },
      explain: (x, y) => void store.explain([Math.floor(x), Math.floor(y)]),
    });
    return () => {
      resized.disconnect();
      stop();
    };
  }, []);
  useDismiss(explaining.value, () => store.stopExplaining());
  return (
    <div class="scene">
      <Picture store={store} box={box} />
      <AnimationBar store={store} />
    </div>
  );
}

function Picture({ store, box }: { store: Store; box: RefObject<HTMLDivElement> }): JSX.Element {
  return (
    <div
      class="stage"
      ref={box}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: an application takes keys
      tabIndex={0}
      role="application"
      aria-label={
        "the picture: drag to turn, wheel to come closer, double-click to focus, " +
        "? for all keys"
      }
    >
      <Overlay store={store} />
      {tool.value && (
        <p class="hint" role="status">
          {tool.value.hint}
        </p>
      )}
      {busy.value && (
        <p class="busy" role="status">
          {busy.value} …
        </p>
      )}
      {!connected.value && (
        <p class="busy lost" role="alert">
          {host.lost}
          {gone.value && ` ${host.gone}`}
        </p>
      )}
    </div>
  );
}
