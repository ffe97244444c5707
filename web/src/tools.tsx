// The menu of tools: what is measured, cut, drawn and read over the picture.

import type { Signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { showsEdges } from "./cad/edges";
import { showsAxes, showsGrid } from "./cad/frame";
import { showsSection, toggleSection } from "./cad/section";
import { inspecting, showsHistogram } from "./compare/inspect";
import { compareWith } from "./compare/state";
import { isTyping } from "./keys";
import { measures, NAME, toggleMeasuring } from "./measure/tool";
import { Menu } from "./menu";
import type { Store } from "./store";
import { tool } from "./tool";

function Toggle(props: { name: string; key_?: string; of: Signal<boolean> }): JSX.Element {
  const { name, key_, of } = props;
  return (
    <button aria-pressed={of.value} onClick={() => (of.value = !of.value)}>
      {name} {key_ && <kbd>{key_}</kbd>}
    </button>
  );
}

export function Tools({ store }: { store: Store }): JSX.Element {
  const file = useRef<HTMLInputElement>(null);
  useEffect(() => {
    const key = (event: KeyboardEvent): void => {
      if (event.key !== "m" || event.ctrlKey || event.metaKey || isTyping(event)) return;
      toggleMeasuring(store);
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
  return (
    <>
      <input
        ref={file}
        type="file"
        accept=".exr,.hdr,.pfm,.png,.jpg,.jpeg,.webp,.tif,.tiff,image/*"
        hidden
        aria-label="picture to compare with"
        onChange={(e) => {
          const chosen = e.currentTarget.files?.[0];
          e.currentTarget.value = "";
          if (chosen) void compareWith(store, chosen);
        }}
      />
      <Menu name="Tools">
        <button aria-pressed={tool.value?.name === NAME} onClick={() => toggleMeasuring(store)}>
          Measure <kbd>M</kbd>
        </button>
        {measures.value.length > 0 && (
          <button onClick={() => (measures.value = [])}>Clear measures</button>
        )}
        <button aria-pressed={showsSection.value} onClick={() => toggleSection(store)}>
          Section
        </button>
        <hr />
        <Toggle name="Edges" of={showsEdges} />
        <Toggle name="Axes" of={showsAxes} />
        <Toggle name="Grid" of={showsGrid} />
        <hr />
        <button onClick={() => file.current?.click()}>Compare with a picture …</button>
        <Toggle name="Numbers under the pointer" key_="I" of={inspecting} />
        <Toggle name="Histogram" key_="H" of={showsHistogram} />
      </Menu>
    </>
  );
}
